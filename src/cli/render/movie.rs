//! The ffmpeg line that turns frames into a movie.

use std::path::Path;

use splatblur::image::Format;

use super::sequence::file_name;
use crate::cli::frames::Frames;

/// What the line depends on.
pub(super) struct Movie<'a> {
    pub(super) directory: &'a Path,
    pub(super) stem: &'a str,
    pub(super) format: Format,
    pub(super) frames: &'a Frames,
    pub(super) rate: f64,
    pub(super) size: (u32, u32),
    pub(super) transparent: bool,
}

impl Movie<'_> {
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
            self.rate,
            self.frames.first(),
            quoted(&Path::new(&pattern).join(name).to_string_lossy())
        );
        let movie =
            |extension: &str| quoted(&self.directory.join(format!("{}.{extension}", self.stem)).to_string_lossy());
        Some(if self.transparent {
            // H.264 has no alpha.
            format!("{input} -c:v prores_ks -profile:v 4444 -pix_fmt yuva444p10le {}", movie("mov"))
        } else {
            // 4:2:0 needs even sides.
            let odd = self.size.0 % 2 + self.size.1 % 2 > 0;
            let pad = if odd { "-vf 'pad=ceil(iw/2)*2:ceil(ih/2)*2' " } else { "" };
            format!("{input} {pad}-c:v libx264 -crf 16 -pix_fmt yuv420p {}", movie("mp4"))
        })
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

    fn range(first: i64, last: i64) -> Frames {
        Frames::range(first, last).unwrap()
    }

    fn movie<'a>(directory: &'a str, format: Format, frames: &'a Frames, size: (u32, u32)) -> Movie<'a> {
        let directory = Path::new(directory);
        Movie { directory, stem: "spin", format, frames, rate: 29.97, size, transparent: false }
    }

    const PNG: Format = Format::Png { bits: Bits::Eight, alpha: false };

    #[test]
    fn lines() {
        assert_eq!(
            movie("out/spin", PNG, &range(1, 48), (640, 480)).ffmpeg().unwrap(),
            "ffmpeg -framerate 29.97 -start_number 1 -i out/spin/spin.%04d.png -frames:v 48 -c:v libx264 -crf 16 \
             -pix_fmt yuv420p out/spin/spin.mp4"
        );
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
        assert!(line.contains("-i ./-o/spin") && line.ends_with("-pix_fmt yuva444p10le ./-o/spin.mov"), "{line}");
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
