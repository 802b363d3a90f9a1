//! The ffmpeg line that turns frames into a movie.

use std::path::Path;

use splatblur::image::Format;
use splatblur::movie::{MovieKind, Rate, encoding};

use super::sequence::file_name;
use crate::cli::frames::FrameList;

/// Pictures that a movie can be made of: what the line depends on.
pub(super) struct Sources<'a> {
    pub(super) directory: &'a Path,
    pub(super) stem: &'a str,
    pub(super) format: Format,
    pub(super) frames: &'a FrameList,
    pub(super) rate: f64,
    pub(super) size: (u32, u32),
    pub(super) transparent: bool,
}

impl Sources<'_> {
    /// The line; `None` for a single frame, and where frames do not follow one another, which ffmpeg cannot number.
    ///
    /// ffmpeg writes `%04d` of a negative number as a minus and four digits, as [`file_name`] does. `-frames:v` keeps
    /// other frames of an earlier run out.
    pub(super) fn ffmpeg(&self) -> Option<String> {
        if self.frames.count() == 1 || !self.frames.follow_each_other() {
            return None;
        }
        // Tells EXR's linear light apart from the screen's.
        let linear = if matches!(self.format, Format::Exr(_)) { "-apply_trc iec61966_2_1 " } else { "" };
        let pattern = self.directory.to_string_lossy().replace('%', "%%");
        let name = format!("{}.%04d.{}", self.stem.replace('%', "%%"), self.format.extension());
        let count = self.frames.count();
        let input = format!(
            "ffmpeg -framerate {} -start_number {} {linear}-i {} -frames:v {count}",
            Rate::of(self.rate),
            self.frames.first(),
            quoted(&Path::new(&pattern).join(name).to_string_lossy())
        );
        let movie =
            |extension: &str| quoted(&self.directory.join(format!("{}.{extension}", self.stem)).to_string_lossy());
        // H.264 has no alpha.
        let kind = if self.transparent { MovieKind::Mov } else { MovieKind::Mp4 };
        // Options begin with a minus; paths must not.
        let plain = |word: String| if word.starts_with('-') { word } else { quoted(&word) };
        let words: Vec<_> = encoding(kind, [self.size.0, self.size.1]).into_iter().map(plain).collect();
        Some(format!("{input} {} {}", words.join(" "), movie(kind.extension())))
    }

    /// The first and the last file, for a person.
    pub(super) fn files(&self) -> String {
        let path = |frame| self.directory.join(file_name(self.stem, frame, self.format)).display().to_string();
        let (first, last) = (self.frames.first(), self.frames.last());
        if self.frames.count() == 1 {
            path(first)
        } else {
            format!("{} .. {}", path(first), file_name(self.stem, last, self.format))
        }
    }
}

/// A word for a POSIX shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+,:@=%".contains(c);
    if word.chars().all(plain) && !word.is_empty() && !word.starts_with('-') {
        word.to_owned()
    } else if word.starts_with('-') {
        quoted(&format!("./{word}"))
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use splatblur::image::Bits;

    use super::*;
    use crate::cli::frames::frames;

    fn range(first: i64, last: i64) -> FrameList {
        FrameList::range(first, last).unwrap()
    }

    fn movie<'a>(directory: &'a str, format: Format, frames: &'a FrameList, size: (u32, u32)) -> Sources<'a> {
        let directory = Path::new(directory);
        Sources { directory, stem: "spin", format, frames, rate: 29.97, size, transparent: false }
    }

    const PNG: Format = Format::Png { bits: Bits::Eight, alpha: false };

    #[test]
    fn lines() {
        let line = movie("out/spin", PNG, &range(1, 48), (640, 480)).ffmpeg().unwrap();
        let input = "ffmpeg -framerate 30000/1001 -start_number 1 -i out/spin/spin.%04d.png -frames:v 48 -vf scale=";
        assert!(line.starts_with(input), "{line}");
        let output = "-colorspace bt709 -color_primaries bt709 -color_trc bt709 -color_range tv out/spin/spin.mp4";
        assert!(line.contains(" -c:v libx264 -crf 16 ") && line.ends_with(output), "{line}");
        let line = movie("my 100% 'out'", Format::EXR, &range(-5, -2), (641, 480)).ffmpeg().unwrap();
        assert!(
            line.contains(r"-start_number -5 -apply_trc iec61966_2_1 -i 'my 100%% '\''out'\''/spin.%04d.exr'"),
            "{line}"
        );
        assert!(line.contains("-frames:v 4 -vf 'pad="), "{line}");
        assert!(line.ends_with(r"'my 100% '\''out'\''/spin.mp4'"), "{line}");
        let two = range(1, 2);
        let mut clear = movie("-o", PNG, &two, (2, 2));
        clear.transparent = true;
        let line = clear.ffmpeg().unwrap();
        assert!(line.contains("-i ./-o/spin") && line.contains("format=yuva444p10le"), "{line}");
        assert!(line.ends_with(" tv ./-o/spin.mov"), "{line}");
        assert_eq!(movie("o", PNG, &range(3, 3), (2, 2)).ffmpeg(), None);
        for list in ["1..9x2", "1,3", "1..2x0.5", "2,1"] {
            assert_eq!(movie("o", PNG, &frames(list).unwrap(), (2, 2)).ffmpeg(), None, "{list}");
        }
    }

    #[test]
    fn files() {
        assert_eq!(movie("o", PNG, &range(3, 3), (2, 2)).files(), "o/spin.0003.png");
        assert_eq!(movie("o", PNG, &range(-1, 3), (2, 2)).files(), "o/spin.-0001.png .. spin.0003.png");
    }
}
