//! YUV4MPEG2: a line of text, then each frame as `FRAME` and three planes of bytes (mjpegtools, `yuv4mpeg(5)`).
//!
//! Planes are Y', Cb and Cr of BT.709 (ITU-R BT.709-6, item 3), 8 bits, limited range, 4:4:4: every pixel keeps its
//! colour, and odd sizes need no padding. The format cannot name its matrix.

use std::fs::File;
use std::io::{self, BufWriter, Write as _};

use super::{MovieError, MovieShape};
use crate::film::Picture;
use crate::image;

#[derive(Debug)]
pub(super) struct Encoder(BufWriter<File>);

impl Encoder {
    pub(super) fn new(file: File, MovieShape { width, height, rate, .. }: MovieShape) -> io::Result<Self> {
        let mut file = BufWriter::new(file);
        let (frames, seconds) = (rate.frames, rate.seconds);
        // Progressive, square pixels. The last word is how ffmpeg writes and reads the range.
        writeln!(file, "YUV4MPEG2 W{width} H{height} F{frames}:{seconds} Ip A1:1 C444 XCOLORRANGE=LIMITED")?;
        Ok(Self(file))
    }

    pub(super) fn push(&mut self, picture: &Picture) -> Result<(), MovieError> {
        let codes = image::srgb_codes(picture, false)?;
        self.0.write_all(b"FRAME\n")?;
        for plane in 0..3 {
            let values: Vec<u8> = codes.chunks_exact(3).map(|rgb| ycbcr([rgb[0], rgb[1], rgb[2]])[plane]).collect();
            self.0.write_all(&values)?;
        }
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<(), MovieError> {
        Ok(self.0.flush()?)
    }
}

/// Y', Cb and Cr of R'G'B', all in codes of 8 bits: Y' from 16 to 235, Cb and Cr from 16 to 240 about 128.
fn ycbcr(rgb: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = rgb.map(|code| f64::from(code) / 255.0);
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let (cb, cr) = ((b - y) / 1.8556, (r - y) / 1.5748);
    [16.0 + 219.0 * y, 128.0 + 224.0 * cb, 128.0 + 224.0 * cr].map(|value| value.round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The codes of the colour bars, as tables of BT.709 have them.
    #[test]
    fn colour_bars() {
        for (rgb, expected) in [
            ([0, 0, 0], [16, 128, 128]),
            ([255, 255, 255], [235, 128, 128]),
            ([255, 0, 0], [63, 102, 240]),
            ([0, 255, 0], [173, 42, 26]),
            ([0, 0, 255], [32, 240, 118]),
            ([255, 255, 0], [219, 16, 138]),
            ([0, 255, 255], [188, 154, 16]),
            ([255, 0, 255], [78, 214, 230]),
        ] {
            assert_eq!(ycbcr(rgb), expected, "{rgb:?}");
        }
    }
}
