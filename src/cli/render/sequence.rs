//! Frames to files: each is written while later ones render; finished ones may be skipped.

use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, mpsc};
use std::time::Instant;

use splatblur::FrameNumber;
use splatblur::film::Picture;
use splatblur::image::{self, Format, ImageError};
use splatblur::renderer::{Rendered, Stats};

use crate::cli::frames::Frames;
use crate::cli::words::with_flags;

/// `<stem>.<frame, 4 digits>.<ext>`; longer where the number is, negative with a minus before its four digits, which is
/// how ffmpeg reads `%04d`. A frame that is not whole has four decimals after `_`.
pub(in crate::cli) fn file_name(stem: &str, frame: FrameNumber, format: Format) -> String {
    format!("{stem}.{}.{}", frame.padded(), format.extension())
}

/// What to write, and where.
pub(super) struct Sequence<'a> {
    pub(super) frames: &'a Frames,
    pub(super) directory: &'a Path,
    pub(super) stem: &'a str,
    pub(super) format: Format,
    /// Skip frames whose file carries the same settings and is whole.
    pub(super) resume: bool,
    /// Held while a file is being written: whoever holds it may end the program and leave nothing half done.
    pub(super) gate: &'a Mutex<()>,
}

/// One frame of a finished sequence.
#[derive(Debug)]
pub(super) struct Finished {
    pub(super) frame: FrameNumber,
    pub(super) path: PathBuf,
    /// Wall time of rendering (with several frames under way, since the one before), and what it took; `None`: an
    /// earlier run made it.
    pub(super) rendered: Option<(f64, Stats)>,
}

struct Page {
    path: PathBuf,
    picture: Picture,
    settings: String,
    /// What mode auto reached.
    comment: Option<String>,
}

/// The writer ended before the last frame.
#[derive(Debug, thiserror::Error)]
#[error("the writer has stopped")]
struct WriterStopped;

/// Frames that were begun and not handed out, and the wall time since the last that was.
struct Rendering {
    waiting: VecDeque<(FrameNumber, PathBuf, String)>,
    seconds: f64,
}

impl Rendering {
    /// Begins `frame`, or finishes one that was begun. Returns the frame that is ready then, if there is one.
    fn step(
        &mut self,
        render: &mut impl FnMut(Option<FrameNumber>) -> anyhow::Result<Option<(FrameNumber, Rendered)>>,
        frame: Option<FrameNumber>,
    ) -> anyhow::Result<Option<(Finished, Page)>> {
        let start = Instant::now();
        let rendered = render(frame);
        self.seconds += start.elapsed().as_secs_f64();
        let Some((number, Rendered { picture, stats })) = rendered? else { return Ok(None) };
        while let Some((frame, path, settings)) = self.waiting.pop_front() {
            if frame == number {
                let rendered = Some((std::mem::take(&mut self.seconds), stats));
                let comment = stats.achieved.map(|achieved| with_flags(&achieved.to_string()));
                let page = Page { path: path.clone(), picture, settings, comment };
                return Ok(Some((Finished { frame, path, rendered }, page)));
            }
        }
        Ok(None)
    }
}

impl Sequence<'_> {
    /// Renders and writes all frames in order; stops at the first error. `render` begins a frame and may hand one out
    /// that was begun before; without a number it finishes the next of those. `finished` hears of each rendered or
    /// skipped frame.
    pub(super) fn run(
        &self,
        settings: impl Fn(FrameNumber) -> anyhow::Result<String>,
        mut render: impl FnMut(Option<FrameNumber>) -> anyhow::Result<Option<(FrameNumber, Rendered)>>,
        finished: impl Fn(&Finished),
    ) -> anyhow::Result<Vec<Finished>> {
        std::thread::scope(|scope| {
            // No buffer: at most one picture waits while one is written and one rendered.
            let (pages, received) = mpsc::sync_channel(0);
            let writer = scope.spawn(move || self.write_all(&received));
            let rendered = self.render_all(&pages, settings, &mut render, finished);
            drop(pages);
            match writer.join() {
                Ok(written) => written?,
                Err(panic) => std::panic::resume_unwind(panic),
            }
            rendered
        })
    }

    fn render_all(
        &self,
        pages: &mpsc::SyncSender<Page>,
        settings: impl Fn(FrameNumber) -> anyhow::Result<String>,
        render: &mut impl FnMut(Option<FrameNumber>) -> anyhow::Result<Option<(FrameNumber, Rendered)>>,
        finished: impl Fn(&Finished),
    ) -> anyhow::Result<Vec<Finished>> {
        let mut list = Vec::new();
        let mut rendering = Rendering { waiting: VecDeque::new(), seconds: 0.0 };
        let all = self.frames.all().iter().try_for_each(|&frame| {
            let path = self.directory.join(file_name(self.stem, frame, self.format));
            let settings = settings(frame)?;
            let same = || image::read_settings(&path).is_some_and(|found| found == settings);
            if self.resume && same() && image::is_whole(&path) {
                let done = Finished { frame, path, rendered: None };
                finished(&done);
                list.push(done);
                return Ok(());
            }
            rendering.waiting.push_back((frame, path, settings));
            if let Some((done, page)) = rendering.step(render, Some(frame))? {
                pages.send(page).map_err(|_| WriterStopped)?;
                finished(&done);
                list.push(done);
            }
            Ok(())
        });
        // Frames that were begun before an error are finished all the same.
        let rest = loop {
            match rendering.step(render, None) {
                Ok(Some((done, page))) => {
                    if pages.send(page).is_err() {
                        break Ok(());
                    }
                    finished(&done);
                    list.push(done);
                }
                Ok(None) => break Ok(()),
                Err(error) => break Err(error),
            }
        };
        match all.and(rest) {
            // The writer says why it stopped.
            Err(error) if !error.is::<WriterStopped>() => Err(error),
            _ => {
                // Skipped frames are there before those that were under way.
                let place: HashMap<_, _> = self.frames.all().iter().zip(0..).collect();
                list.sort_by_key(|done| place.get(&done.frame).copied().unwrap_or(usize::MAX));
                Ok(list)
            }
        }
    }

    fn write_all(&self, pages: &mpsc::Receiver<Page>) -> Result<(), ImageError> {
        for page in pages {
            let _held = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
            let Page { path, picture, settings, comment } = &page;
            match comment {
                Some(comment) => image::write_with_comment(path, picture, self.format, settings, comment)?,
                None => image::write(path, picture, self.format, settings)?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use splatblur::image::Bits;

    use super::*;

    const PNG: Format = Format::Png { bits: Bits::Eight, alpha: false };

    /// Runs frames 1..3 with a fake renderer; returns the frames that it was asked for.
    fn run(directory: &Path, resume: bool, settings: &str) -> anyhow::Result<Vec<f64>> {
        let gate = Mutex::new(());
        let frames = Frames::range(1, 3).unwrap();
        let sequence = Sequence { frames: &frames, directory, stem: "a", format: PNG, resume, gate: &gate };
        let asked = RefCell::new(Vec::new());
        let waiting = RefCell::new(VecDeque::new());
        let list = sequence.run(
            |frame| Ok(format!("{settings} {frame}")),
            |frame| {
                // Two under way.
                asked.borrow_mut().extend(frame);
                waiting.borrow_mut().extend(frame);
                if frame.is_some() && waiting.borrow().len() < 2 {
                    return Ok(None);
                }
                let Some(number) = waiting.borrow_mut().pop_front() else { return Ok(None) };
                let picture = Picture { width: 1, height: 1, rgba: vec![[0.5; 4]], layers: Vec::new() };
                Ok(Some((number, Rendered { picture, stats: Stats::default() })))
            },
            |_| (),
        )?;
        assert_eq!(list.iter().map(|f| f.frame.get()).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
        let rendered: Vec<_> = list.iter().filter(|f| f.rendered.is_some()).map(|f| f.frame).collect();
        assert_eq!(rendered, *asked.borrow());
        Ok(rendered.into_iter().map(FrameNumber::get).collect())
    }

    #[test]
    fn names() {
        let names = [0.0, 7.0, 12_345.0, -5.0, -12_345.0, 1.5].map(|frame| file_name("a", frame.into(), Format::EXR));
        assert_eq!(
            names,
            ["a.0000.exr", "a.0007.exr", "a.12345.exr", "a.-0005.exr", "a.-12345.exr", "a.0001_5000.exr"]
        );
    }

    #[test]
    fn resume_skips_what_has_the_same_settings() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(run(dir.path(), true, "x").unwrap(), [1.0, 2.0, 3.0]);
        assert_eq!(run(dir.path(), true, "x").unwrap(), [0.0; 0]);
        std::fs::remove_file(dir.path().join("a.0002.png")).unwrap();
        std::fs::write(dir.path().join("a.0003.png"), "damaged").unwrap();
        assert_eq!(run(dir.path(), true, "x").unwrap(), [2.0, 3.0]);
        // Cut short: the header, and with it the settings, are still there.
        let whole = std::fs::read(dir.path().join("a.0001.png")).unwrap();
        for length in [whole.len() - 1, whole.len() - 12, whole.len() - 20] {
            std::fs::write(dir.path().join("a.0001.png"), &whole[..length]).unwrap();
            assert_eq!(run(dir.path(), true, "x").unwrap(), [1.0], "cut to {length} of {}", whole.len());
        }
        // Something was written behind the end.
        std::fs::write(dir.path().join("a.0001.png"), [&whole[..], b"junk"].concat()).unwrap();
        assert_eq!(run(dir.path(), true, "x").unwrap(), [1.0]);
        // Other settings, or no --resume: all over again.
        assert_eq!(run(dir.path(), true, "y").unwrap(), [1.0, 2.0, 3.0]);
        assert_eq!(run(dir.path(), false, "y").unwrap(), [1.0, 2.0, 3.0]);
        // Another frame's file under this frame's name is not this frame.
        std::fs::copy(dir.path().join("a.0001.png"), dir.path().join("a.0002.png")).unwrap();
        assert_eq!(run(dir.path(), true, "y").unwrap(), [2.0]);
    }

    #[test]
    fn a_write_error_ends_the_sequence_and_leaves_finished_frames_only() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("a.0002.png")).unwrap();
        let error = run(dir.path(), false, "x").unwrap_err();
        assert!(format!("{error:#}").contains("a.0002.png"), "{error:#}");
        let mut names: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["a.0001.png", "a.0002.png"]);
    }
}
