//! GIF: each frame has a palette of its own, exact up to 256 colours, else chosen by a neural net (Dekker 1994).
//!
//! The crate `gif` and not `image`, which wraps it: that one writes the last byte when it is dropped, where a full disk
//! is not heard of.

use std::fs::File;
use std::io::{self, BufWriter, Write as _};

use ::gif::{EncodingError, Frame, Repeat};

use super::{MovieError, MovieShape};
use crate::film::Picture;
use crate::image;

/// The palette learns from about so many pixels of a frame: a tenth of a picture as large as a page shows, and all of a
/// small one, which else would be far off.
const LEARNT: usize = 50_000;

pub(super) struct Encoder {
    gif: ::gif::Encoder<BufWriter<File>>,
    size: [u16; 2],
    shape: MovieShape,
    frames: u64,
}

impl std::fmt::Debug for Encoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Encoder").field("shape", &self.shape).field("frames", &self.frames).finish_non_exhaustive()
    }
}

impl From<EncodingError> for MovieError {
    fn from(error: EncodingError) -> Self {
        Self::Write(match error {
            EncodingError::Io(error) => error,
            other => io::Error::other(other),
        })
    }
}

impl Encoder {
    pub(super) fn new(file: File, shape: MovieShape) -> Result<Self, MovieError> {
        let rate = f64::from(shape.rate.frames) / f64::from(shape.rate.seconds);
        if !(0.01..=50.0).contains(&rate) {
            return Err(MovieError::GifRate { rate: shape.rate });
        }
        let size = [shape.width, shape.height].map(|side| u16::try_from(side).unwrap_or(0));
        let mut gif = ::gif::Encoder::new(BufWriter::new(file), size[0], size[1], &[])?;
        gif.set_repeat(Repeat::Infinite)?;
        Ok(Self { gif, size, shape, frames: 0 })
    }

    pub(super) fn push(&mut self, picture: &Picture) -> Result<(), MovieError> {
        let codes = image::srgb_codes(picture, false)?;
        // The crate takes every so many pixels, 1 to 30.
        let step = (picture.rgba.len() / LEARNT).clamp(1, 30);
        let mut frame = Frame::from_rgb_speed(self.size[0], self.size[1], &codes, step as i32);
        // Times add up to those of the rate, though each is in hundredths of a second.
        let [begin, end] = [self.frames, self.frames + 1].map(|frame| self.shape.rate.begin(frame, 100));
        frame.delay = (end - begin) as u16;
        self.frames += 1;
        Ok(self.gif.write_frame(&frame)?)
    }

    pub(super) fn finish(self) -> Result<(), MovieError> {
        Ok(self.gif.into_inner()?.flush()?)
    }
}
