//! Frames to files: each is written while later ones render; finished ones may be skipped.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, mpsc};
use std::time::Instant;

use rayon::ThreadPool;
use splatblur::FrameNumber;
use splatblur::files::Nameless;
use splatblur::film::Picture;
use splatblur::image::{self, Bits, Display, Format};
use splatblur::model::ColourBy;
use splatblur::movie::Movie;
use splatblur::renderer::{FinishedFrame, FrameError, FrameQueue, Rendered, Stats};

use crate::cli::frames::FrameList;
use crate::cli::words::with_flags;

/// `<stem>.<frame, 4 digits>.<ext>`; longer where the number is, negative with a minus before its four digits, which is
/// how ffmpeg reads `%04d`. A frame that is not whole has four decimals after `_`.
pub(in crate::cli) fn file_name(stem: &str, frame: FrameNumber, format: Format) -> String {
    format!("{stem}.{}.{}", frame.padded(), format.extension())
}

/// What to write, and where.
pub(super) struct FrameOutput<'a> {
    pub(super) frames: &'a FrameList,
    pub(super) directory: &'a Path,
    pub(super) stem: &'a str,
    pub(super) format: Format,
    /// How PNG files and movies show light.
    pub(super) display: Display,
    /// Bits with which they are shown.
    pub(super) bits: Bits,
    /// Is there no background? Then colours are shown without their coverage.
    pub(super) transparent: bool,
    /// What colours stand for, to be drawn into pictures.
    pub(super) legends: &'a [ColourBy],
    /// Skip frames whose file carries the same settings and is whole.
    pub(super) resume: bool,
    /// Write files of pictures; else a movie alone is made.
    pub(super) writes: bool,
    /// Held while a file is being written: whoever holds it may end the program and leave nothing half done.
    pub(super) gate: &'a Mutex<()>,
}

/// One frame of a finished sequence.
#[derive(Debug)]
pub(super) struct Finished {
    pub(super) frame: FrameNumber,
    /// `None`: it is in the movie alone.
    pub(super) path: Option<PathBuf>,
    /// Wall time of rendering (with several frames under way, since the one before), and what it took; `None`: an
    /// earlier run made it.
    pub(super) rendered: Option<(f64, Stats)>,
}

/// What the writer is given, in the order of the frames.
enum Page {
    Rendered {
        path: PathBuf,
        picture: Picture,
        settings: String,
        /// What mode auto reached.
        comment: Option<String>,
    },
    /// A file that an earlier run made, for the movie.
    There(PathBuf),
}

/// The writer ended before the last frame.
#[derive(Debug, thiserror::Error)]
#[error("the writer has stopped")]
struct WriterStopped;

/// What becomes of a frame.
pub(super) struct Target {
    path: PathBuf,
    settings: String,
}

/// Where frames are rendered.
pub(super) struct Rendering<'a> {
    pub(super) queue: FrameQueue<'a, Target>,
    pub(super) pool: &'a ThreadPool,
}

impl<'a> Rendering<'a> {
    /// Lets the queue work in the pool; adds the time that this takes to `seconds`.
    fn work<O: Send>(
        &mut self,
        seconds: &mut f64,
        work: impl FnOnce(&mut FrameQueue<'a, Target>) -> Result<O, FrameError> + Send,
    ) -> Result<O, FrameError> {
        let start = Instant::now();
        let done = self.pool.install(|| work(&mut self.queue));
        *seconds += start.elapsed().as_secs_f64();
        done
    }
}

/// Where frames go that leave the queue.
struct HandOut<'a, S, F> {
    pages: &'a mpsc::SyncSender<Page>,
    writes: bool,
    seen: S,
    finished: F,
    /// Wall time since the last frame that was rendered.
    seconds: f64,
    list: Vec<Finished>,
}

impl<S: FnMut(FrameNumber, &Rendered), F: Fn(&Finished)> HandOut<'_, S, F> {
    fn hand_out(&mut self, done: FinishedFrame<Target>) -> anyhow::Result<()> {
        let FinishedFrame { number: frame, tag: Target { path, settings }, rendered } = done;
        let (done, page) = match rendered {
            None => (Finished { frame, path: Some(path.clone()), rendered: None }, Page::There(path)),
            Some(rendered) => {
                (self.seen)(frame, &rendered);
                let Rendered { picture, stats } = rendered;
                let rendered = Some((std::mem::take(&mut self.seconds), stats));
                let comment = stats.achieved.map(|achieved| with_flags(&achieved.to_string()));
                let done = Finished { frame, path: self.writes.then(|| path.clone()), rendered };
                (done, Page::Rendered { path, picture, settings, comment })
            }
        };
        self.pages.send(page).map_err(|_| WriterStopped)?;
        (self.finished)(&done);
        self.list.push(done);
        Ok(())
    }
}

impl FrameOutput<'_> {
    /// Renders and writes all frames in order, into the movie too; stops at the first error. `seen` is shown each frame
    /// that was rendered, and `finished` hears of each that was rendered or skipped. Returns them, and the finished
    /// movie, which has no name yet.
    pub(super) fn run(
        &self,
        movie: Option<Movie>,
        settings: impl Fn(FrameNumber) -> anyhow::Result<String>,
        rendering: Rendering<'_>,
        seen: impl FnMut(FrameNumber, &Rendered),
        finished: impl Fn(&Finished),
    ) -> anyhow::Result<(Vec<Finished>, Option<Nameless>)> {
        std::thread::scope(|scope| {
            // No buffer: at most one picture waits while one is written and one rendered.
            let (pages, received) = mpsc::sync_channel(0);
            let writer = scope.spawn(move || self.write_all(&received, movie));
            let out = HandOut { pages: &pages, writes: self.writes, seen, finished, seconds: 0.0, list: Vec::new() };
            let rendered = self.render_all(rendering, out, settings);
            drop(pages);
            let written = match writer.join() {
                Ok(written) => written?,
                Err(panic) => std::panic::resume_unwind(panic),
            };
            Ok((rendered?, written.map(Movie::finish).transpose()?))
        })
    }

    fn render_all(
        &self,
        mut rendering: Rendering<'_>,
        mut out: HandOut<'_, impl FnMut(FrameNumber, &Rendered), impl Fn(&Finished)>,
        settings: impl Fn(FrameNumber) -> anyhow::Result<String>,
    ) -> anyhow::Result<Vec<Finished>> {
        let all = self.frames.all().iter().try_for_each(|&frame| {
            let path = self.directory.join(file_name(self.stem, frame, self.format));
            let settings = settings(frame)?;
            let same = || image::read_settings(&path).is_some_and(|found| found == settings);
            let is_there = self.resume && same() && image::is_whole(&path);
            let target = Target { path, settings };
            if is_there {
                rendering.queue.pass(frame, target);
            } else {
                rendering.work(&mut out.seconds, |queue| queue.begin(frame, target))?;
            }
            while let Some(done) = rendering.work(&mut out.seconds, FrameQueue::ready)? {
                out.hand_out(done)?;
            }
            Ok(())
        });
        // Frames that were begun before an error are finished all the same.
        let rest = loop {
            match rendering.work(&mut out.seconds, FrameQueue::finish) {
                Ok(Some(done)) => {
                    if let Err(error) = out.hand_out(done) {
                        break Err(error);
                    }
                }
                Ok(None) => break Ok(()),
                Err(error) => break Err(error.into()),
            }
        };
        match all.and(rest) {
            // The writer says why it stopped.
            Err(error) if !error.is::<WriterStopped>() => Err(error),
            _ => Ok(out.list),
        }
    }

    /// Writes pages until there are no more; returns the movie with all of them.
    fn write_all(&self, pages: &mpsc::Receiver<Page>, mut movie: Option<Movie>) -> anyhow::Result<Option<Movie>> {
        for page in pages {
            let is_shown = matches!(self.format, Format::Png { .. });
            let picture = match page {
                Page::There(path) => match &movie {
                    Some(_) => image::read(&path)?,
                    None => continue,
                },
                Page::Rendered { path, picture, settings, comment } => {
                    let mut picture = if is_shown { self.shown(picture) } else { picture };
                    // There was room for them before the first frame.
                    image::draw_legends(&mut picture, self.legends);
                    if self.writes {
                        let _held = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
                        match &comment {
                            Some(comment) => {
                                image::write_with_comment(&path, &picture, self.format, &settings, comment)?;
                            }
                            None => image::write(&path, &picture, self.format, &settings)?,
                        }
                    }
                    picture
                }
            };
            if let Some(movie) = &mut movie {
                movie.push(&if is_shown { picture } else { self.shown(picture) })?;
            }
        }
        Ok(movie)
    }

    /// A picture as its PNG file shows it, or the movie.
    fn shown(&self, picture: Picture) -> Picture {
        self.display.shown(picture, self.bits, self.transparent)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::collections::VecDeque;
    use std::sync::Arc;

    use splatblur::backend::{Backend, BackendError};
    use splatblur::frame::Frame;
    use splatblur::image::Bits;
    use splatblur::movie::{MovieKind, MovieShape, Rate};
    use splatblur::options::{BlurMode, RenderOptions};
    use splatblur::scene::{Object, Scene, Shape};
    use splatblur::stop::Stop;

    use super::*;

    const PNG: Format = Format::Png { bits: Bits::Eight, alpha: false };

    /// Has two frames under way. Its pictures have one grey pixel, a quarter of the light for each frame's number.
    #[derive(Default)]
    struct Fake {
        under_way: VecDeque<f64>,
        /// The frames that it was asked for.
        asked: Vec<f64>,
    }

    impl Backend for Fake {
        fn describe(&self) -> String {
            "fake".to_owned()
        }

        fn in_flight(&self) -> usize {
            2
        }

        fn begin(&mut self, frame: Frame) -> Result<(), BackendError> {
            let number = frame.all_samples().next().unwrap().time;
            self.asked.push(number);
            self.under_way.push_back(number);
            assert!(self.under_way.len() <= 2);
            Ok(())
        }

        fn finish(&mut self) -> Result<Option<Rendered>, BackendError> {
            Ok(self.under_way.pop_front().map(|number| {
                let grey = number as f32 / 4.0;
                let picture = Picture { width: 1, height: 1, rgba: vec![[grey, grey, grey, 1.0]], layers: Vec::new() };
                Rendered { picture, stats: Stats::default() }
            }))
        }

        fn abandon(&mut self) {
            self.under_way.pop_back();
        }

        fn heed(&mut self, _stop: Arc<Stop>) {}

        fn stop(&self) -> Arc<Stop> {
            Arc::default()
        }

        fn render(&mut self, _frame: Frame) -> Result<Rendered, BackendError> {
            panic!("frames go through the queue")
        }
    }

    /// Runs frames 1..3 with a fake renderer; returns the frames that it was asked for.
    fn run(directory: &Path, resume: bool, settings: &str) -> anyhow::Result<Vec<f64>> {
        run_with(directory, resume, settings, None).map(|(asked, _)| asked)
    }

    fn run_with(
        directory: &Path,
        resume: bool,
        settings: &str,
        movie: Option<Movie>,
    ) -> anyhow::Result<(Vec<f64>, Option<Nameless>)> {
        let gate = Mutex::new(());
        let frames = FrameList::range(1, 3).unwrap();
        let sequence = FrameOutput {
            frames: &frames,
            directory,
            stem: "a",
            format: PNG,
            display: Display::default(),
            bits: Bits::Eight,
            transparent: false,
            legends: &[],
            resume,
            writes: true,
            gate: &gate,
        };
        let mut scene = Scene::new([Object::new(Shape::default())]);
        (scene.image.width, scene.image.height) = (1, 1);
        let options =
            RenderOptions { quality: BlurMode::Still { pixel_samples: 1 }.into(), ..RenderOptions::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let mut fake = Fake::default();
        let seen = RefCell::new(Vec::new());
        let (list, movie) = sequence.run(
            movie,
            |frame| Ok(format!("{settings} {frame}")),
            Rendering { queue: FrameQueue::new(&mut fake, &scene, &options)?, pool: &pool },
            |frame, _| seen.borrow_mut().push(frame.get()),
            |_| (),
        )?;
        assert_eq!(list.iter().map(|f| f.frame.get()).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
        let rendered: Vec<_> = list.iter().filter(|f| f.rendered.is_some()).map(|f| f.frame.get()).collect();
        assert_eq!(rendered, fake.asked);
        assert_eq!(rendered, *seen.borrow());
        Ok((rendered, movie))
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

    /// Frames of an earlier run are read back, and stand in the movie where they belong, though two frames are under
    /// way at a time.
    #[test]
    fn a_movie_has_the_frames_in_their_order() {
        let dir = tempfile::tempdir().unwrap();
        let make = |resume| {
            let shape = MovieShape { width: 1, height: 1, rate: Rate::of(24.0), bits: Bits::Eight };
            let movie = Movie::begin(&dir.path().join("a.y4m"), MovieKind::Y4m, shape).unwrap();
            let (asked, file) = run_with(dir.path(), resume, "x", Some(movie)).unwrap();
            let path = dir.path().join("a.y4m");
            file.unwrap().replace(&path).unwrap();
            (asked, std::fs::read(path).unwrap())
        };
        let (asked, movie) = make(false);
        assert_eq!(asked, [1.0, 2.0, 3.0]);
        // Grey of 1/4, 1/2 and 3/4 of the light: codes 137, 188 and 225 of sRGB.
        let luma: Vec<u8> = movie.windows(7).filter(|w| w.starts_with(b"FRAME\n")).map(|w| w[6]).collect();
        assert_eq!(luma, [134, 177, 209]);
        for missing in [&[1][..], &[2], &[3], &[1, 3], &[]] {
            for number in missing {
                std::fs::remove_file(dir.path().join(format!("a.000{number}.png"))).unwrap();
            }
            let missing: Vec<f64> = missing.iter().map(|&number| f64::from(number)).collect();
            assert_eq!(make(true), (missing, movie.clone()));
        }
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
