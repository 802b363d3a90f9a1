//! Movies of frames. Y4M and GIF are written here; MP4 and MOV by an installed ffmpeg, which is given the pixels.
//!
//! A movie has the sRGB codes of the frames as PNG files have them. MP4 and Y4M are Y'CbCr by the matrix of BT.709, in
//! the limited range. MOV alone has alpha, straight; elsewhere what is transparent lies over black.
//!
//! A movie grows in a file without a name. So nothing half is left, however the program ends.

mod ffmpeg;
mod gif;
mod rate;
pub mod wipe;
mod y4m;

use std::io;
use std::path::Path;

pub use self::ffmpeg::{abandon, encoding};
pub use self::rate::Rate;
use crate::files::Nameless;
use crate::film::Picture;
use crate::image::{Bits, ImageError};

/// Formats of movies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MovieKind {
    /// H.264, 4:2:0, 8 bits, by ffmpeg.
    Mp4,
    /// Apple `ProRes` 4444 with straight alpha, by ffmpeg.
    Mov,
    /// YUV4MPEG2: uncompressed, 4:4:4, 8 bits.
    Y4m,
    /// GIF: 256 colours a frame, repeated without end.
    Gif,
}

impl MovieKind {
    /// All.
    pub const ALL: [Self; 4] = [Self::Mp4, Self::Mov, Self::Y4m, Self::Gif];

    /// The format that a file's extension names, in upper or lower case.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        Self::ALL.into_iter().find(|kind| extension.eq_ignore_ascii_case(kind.extension()))
    }

    /// File name extension.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Mp4 => "mp4",
            Self::Mov => "mov",
            Self::Y4m => "y4m",
            Self::Gif => "gif",
        }
    }

    /// Has it transparent pixels?
    pub const fn has_alpha(self) -> bool {
        matches!(self, Self::Mov)
    }

    /// Finds out whether movies of this format can be made here.
    ///
    /// # Errors
    /// It needs ffmpeg, and there is none, or it lacks the encoder.
    pub fn check(self) -> Result<(), MovieError> {
        ffmpeg::check(self)
    }
}

/// What all frames of a movie share.
#[derive(Clone, Copy, Debug)]
pub struct MovieShape {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Frames a second.
    pub rate: Rate,
    /// Bits of a channel of what MOV is made of. The others have 8.
    pub bits: Bits,
}

/// Why a movie could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MovieError {
    /// ffmpeg is not installed.
    #[error(
        "a movie as .{} needs the program ffmpeg, which is not installed; .y4m and .gif need none",
        kind.extension()
    )]
    NoFfmpeg {
        /// The format.
        kind: MovieKind,
    },
    /// ffmpeg was built without an encoder.
    #[error(
        "a movie as .{} needs the encoder {encoder}, which the installed ffmpeg lacks; .y4m and .gif need no ffmpeg",
        kind.extension()
    )]
    NoEncoder {
        /// The format.
        kind: MovieKind,
        /// Its name in ffmpeg.
        encoder: &'static str,
    },
    /// ffmpeg ended with an error.
    #[error("ffmpeg failed: {what}")]
    Ffmpeg {
        /// Its last line.
        what: String,
    },
    /// GIF counts hundredths of a second, and browsers show a frame for two of them or more.
    #[error("GIF has 0.01 to 50 frames a second, not {rate}; .y4m has any")]
    GifRate {
        /// Frames a second.
        rate: Rate,
    },
    /// The frame is not one that can be shown.
    #[error(transparent)]
    Picture(#[from] ImageError),
    /// A frame has another size than the movie.
    #[error("a frame of {} x {} pixels in a movie of {} x {}", found[0], found[1], expected[0], expected[1])]
    Size {
        /// Width and height of the frame.
        found: [u32; 2],
        /// Width and height of the movie.
        expected: [u32; 2],
    },
    /// The movie cannot be written.
    #[error("cannot write the movie")]
    Write(#[from] io::Error),
}

/// A movie that is being made. Dropped, it leaves nothing.
#[derive(Debug)]
pub struct Movie {
    shape: MovieShape,
    file: Nameless,
    encoder: Encoder,
}

#[derive(Debug)]
enum Encoder {
    Y4m(y4m::Encoder),
    Gif(Box<gif::Encoder>),
    Ffmpeg(ffmpeg::Encoder),
}

impl Movie {
    /// Begins a movie in the directory of `path`, where it will be.
    ///
    /// # Errors
    /// The format cannot be made here, cannot have the rate, or no file can be made in the directory.
    pub fn begin(path: &Path, kind: MovieKind, shape: MovieShape) -> Result<Self, MovieError> {
        kind.check()?;
        let file = Nameless::beside(path)?;
        let own = file.file().try_clone()?;
        let encoder = match kind {
            MovieKind::Y4m => Encoder::Y4m(y4m::Encoder::new(own, shape)?),
            MovieKind::Gif => Encoder::Gif(Box::new(gif::Encoder::new(own, shape)?)),
            MovieKind::Mp4 | MovieKind::Mov => Encoder::Ffmpeg(ffmpeg::Encoder::new(own, kind, shape)?),
        };
        Ok(Self { shape, file, encoder })
    }

    /// Adds a frame; layers are left out.
    ///
    /// # Errors
    /// The frame has another size or a value that is not finite, or it cannot be written.
    pub fn push(&mut self, picture: &Picture) -> Result<(), MovieError> {
        let (found, expected) = ([picture.width, picture.height], [self.shape.width, self.shape.height]);
        if found != expected {
            return Err(MovieError::Size { found, expected });
        }
        match &mut self.encoder {
            Encoder::Y4m(encoder) => encoder.push(picture),
            Encoder::Gif(encoder) => encoder.push(picture),
            Encoder::Ffmpeg(encoder) => encoder.push(picture),
        }
    }

    /// Ends the movie; the file that holds it wants a name yet.
    ///
    /// # Errors
    /// The rest cannot be written, or ffmpeg fails.
    pub fn finish(self) -> Result<Nameless, MovieError> {
        match self.encoder {
            Encoder::Y4m(encoder) => encoder.finish()?,
            Encoder::Gif(encoder) => encoder.finish()?,
            Encoder::Ffmpeg(encoder) => encoder.finish()?,
        }
        Ok(self.file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_name_formats() {
        for (name, kind) in [
            ("a.mp4", Some(MovieKind::Mp4)),
            ("out.d/a.MOV", Some(MovieKind::Mov)),
            ("a.y4m", Some(MovieKind::Y4m)),
            ("a.b.Gif", Some(MovieKind::Gif)),
            ("a.avi", None),
            ("mp4", None),
            (".mp4", None),
        ] {
            assert_eq!(MovieKind::of(Path::new(name)), kind, "{name}");
        }
    }

    #[test]
    fn frames_of_another_size_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let shape = MovieShape { width: 2, height: 2, rate: Rate::of(24.0), bits: Bits::Eight };
        let mut movie = Movie::begin(&dir.path().join("a.y4m"), MovieKind::Y4m, shape).unwrap();
        let picture = Picture { width: 2, height: 1, rgba: vec![[0.0; 4]; 2], layers: Vec::new() };
        let why = movie.push(&picture).unwrap_err().to_string();
        assert_eq!(why, "a frame of 2 x 1 pixels in a movie of 2 x 2");
        drop(movie);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
