//! MP4 and MOV by an installed ffmpeg: it is given raw frames by a pipe, and writes into a file that has no name.
//!
//! Where this program is killed the pipe closes; then ffmpeg ends, and the file with it.

use std::fs::File;
use std::io::{BufRead as _, BufReader, ErrorKind, Write as _};
use std::mem;
use std::process::{Child, ChildStderr, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use super::{MovieError, MovieKind, MovieShape};
use crate::film::Picture;
use crate::image::{self, Bits};

/// The encoder of a format, by its name in ffmpeg; `None`: none is needed.
const fn encoder(kind: MovieKind) -> Option<&'static str> {
    match kind {
        MovieKind::Mp4 => Some("libx264"),
        MovieKind::Mov => Some("prores_ks"),
        MovieKind::Y4m | MovieKind::Gif => None,
    }
}

/// Arguments of ffmpeg that turn frames with sRGB codes, of a size in pixels, into a movie.
///
/// The matrix and the range of BT.709 are stated and used: without the first ffmpeg takes those of BT.601, and without
/// the second players guess. The codes are tagged as BT.709 too, though their curve is that of sRGB: players show codes
/// of that tag as they are, as browsers show those of a PNG file, and few know the tag of sRGB.
pub fn encoding(kind: MovieKind, [width, height]: [u32; 2]) -> Vec<String> {
    // Pixels that share their colour come in pairs; the last of an odd row or column is there twice.
    let odd = [width % 2, height % 2];
    let pad = format!("pad=ceil(iw/2)*2:ceil(ih/2)*2,fillborders=right={}:bottom={}:mode=smear,", odd[0], odd[1]);
    let scale = "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int";
    let tags = "setparams=range=tv:color_primaries=bt709:color_trc=bt709:colorspace=bt709";
    let (pad, layout) = match kind {
        MovieKind::Mp4 if odd != [0, 0] => (&*pad, "yuv420p"),
        MovieKind::Mp4 | MovieKind::Y4m | MovieKind::Gif => ("", "yuv420p"),
        MovieKind::Mov => ("", "yuva444p10le"),
    };
    let filters = format!("{pad}{scale},format={layout},{tags}");
    let mut words = vec!["-vf", &filters, "-c:v"];
    words.extend(encoder(kind));
    words.extend(match kind {
        MovieKind::Mov => &["-profile:v", "4444"][..],
        _ => &["-crf", "16"],
    });
    for tag in ["-colorspace", "-color_primaries", "-color_trc"] {
        words.extend([tag, "bt709"]);
    }
    words.extend(["-color_range", "tv"]);
    words.into_iter().map(str::to_owned).collect()
}

/// Finds out whether ffmpeg is there, and has the encoder.
pub(super) fn check(kind: MovieKind) -> Result<(), MovieError> {
    let Some(encoder) = encoder(kind) else { return Ok(()) };
    let listed = Command::new("ffmpeg").args(["-hide_banner", "-encoders"]).stdin(Stdio::null()).output();
    match listed {
        Ok(listed) if !listed.status.success() => Err(failure(&String::from_utf8_lossy(&listed.stderr))),
        Ok(listed) if !String::from_utf8_lossy(&listed.stdout).split_whitespace().any(|word| word == encoder) => {
            Err(MovieError::NoEncoder { kind, encoder })
        }
        Ok(_) => Ok(()),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(MovieError::NoFfmpeg { kind }),
        Err(error) => Err(failure(&error.to_string())),
    }
}

/// The last line that says something.
fn failure(text: &str) -> MovieError {
    let last = text.lines().map(str::trim).rfind(|line| !line.is_empty());
    MovieError::Ffmpeg { what: last.unwrap_or("it says nothing").to_owned() }
}

/// All that are running.
static RUNNING: Mutex<Vec<Arc<Mutex<Child>>>> = Mutex::new(Vec::new());

/// Ends every ffmpeg that is at work, for a program that ends: whoever waits for one waits from now on for ever.
pub fn abandon() {
    let running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
    for child in &*running {
        // It has ended by itself where this fails.
        let _ = child.lock().unwrap_or_else(PoisonError::into_inner).kill();
    }
    // A writer whose pipe breaks now must not tell of an error.
    mem::forget(running);
}

/// An ffmpeg at work. Dropped, it is ended.
#[derive(Debug)]
pub(super) struct Encoder {
    child: Arc<Mutex<Child>>,
    /// Closed to end the movie.
    frames: Option<ChildStdin>,
    /// Reads what ffmpeg says, so that its pipe never fills; the last line.
    complaints: Option<JoinHandle<String>>,
    kind: MovieKind,
    bits: Bits,
}

impl Encoder {
    pub(super) fn new(file: File, kind: MovieKind, shape: MovieShape) -> Result<Self, MovieError> {
        let bits = if kind == MovieKind::Mov { shape.bits } else { Bits::Eight };
        let layout = match (kind, bits) {
            (MovieKind::Mov, Bits::Sixteen) => "rgba64le",
            (MovieKind::Mov, Bits::Eight) => "rgba",
            _ => "rgb24",
        };
        let mut command = Command::new("ffmpeg");
        command.args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y"]);
        command.args(["-f", "rawvideo", "-pixel_format", layout, "-video_size"]);
        command.arg(format!("{}x{}", shape.width, shape.height));
        command.args(["-framerate", &shape.rate.to_string(), "-i", "pipe:0"]);
        command.args(encoding(kind, [shape.width, shape.height]));
        // Opened anew, and not as a pipe: the index of a movie is written last, but into its head.
        command.args(["-f", kind.extension(), "/dev/fd/1"]);
        command.stdin(Stdio::piped()).stdout(file).stderr(Stdio::piped());
        // Ctrl-C is heard by this program alone, which then ends ffmpeg.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|error| failure(&error.to_string()))?;
        let (frames, said) = (child.stdin.take(), child.stderr.take());
        let complaints = said.map(|said| thread::spawn(move || last_line(said)));
        let child = Arc::new(Mutex::new(child));
        RUNNING.lock().unwrap_or_else(PoisonError::into_inner).push(Arc::clone(&child));
        Ok(Self { child, frames, complaints, kind, bits })
    }

    pub(super) fn push(&mut self, picture: &Picture) -> Result<(), MovieError> {
        let bytes = match self.bits {
            Bits::Eight => image::srgb_codes(picture, self.kind.has_alpha())?,
            Bits::Sixteen => {
                let codes = image::srgb_codes_16(picture, self.kind.has_alpha())?;
                codes.into_iter().flat_map(u16::to_le_bytes).collect()
            }
        };
        let Some(frames) = &mut self.frames else { return Ok(()) };
        match frames.write_all(&bytes) {
            // It has ended; why, it says.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Err(self.end().err().unwrap_or(error.into())),
            written => Ok(written?),
        }
    }

    pub(super) fn finish(mut self) -> Result<(), MovieError> {
        self.end()
    }

    /// Waits until ffmpeg has written all, or tells what it complains about.
    fn end(&mut self) -> Result<(), MovieError> {
        drop(self.frames.take());
        // It says no more when it ends. Until then the child must be free for `abandon`.
        let last = self.complaints.take().and_then(|reader| reader.join().ok()).unwrap_or_default();
        let mut running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        let status = self.child.lock().unwrap_or_else(PoisonError::into_inner).wait()?;
        running.retain(|child| !Arc::ptr_eq(child, &self.child));
        drop(running);
        if status.success() { Ok(()) } else { Err(failure(&format!("{last}\n"))) }
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        if self.complaints.is_some() {
            // It has ended by itself where this fails.
            let _ = self.child.lock().unwrap_or_else(PoisonError::into_inner).kill();
            let _ = self.end();
        }
    }
}

fn last_line(said: ChildStderr) -> String {
    let lines = BufReader::new(said).split(b'\n').map_while(Result::ok);
    let words = lines.map(|line| String::from_utf8_lossy(&line).trim().to_owned());
    words.filter(|line| !line.is_empty()).last().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_line_is_told() {
        let what = |text| failure(text).to_string();
        assert_eq!(what("a\n b \n\n"), "ffmpeg failed: b");
        assert_eq!(what("\n"), "ffmpeg failed: it says nothing");
    }

    #[test]
    fn odd_sizes_are_padded_where_pixels_share_colours() {
        let padded = |kind, size| encoding(kind, size)[1].starts_with("pad=");
        assert!(padded(MovieKind::Mp4, [641, 480]) && padded(MovieKind::Mp4, [640, 481]));
        assert!(!padded(MovieKind::Mp4, [640, 480]) && !padded(MovieKind::Mov, [641, 481]));
    }
}
