//! Progress: a bar on a terminal and nothing in a pipe, or a line a frame anywhere.

use std::fmt::Write as _;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use splatblur::FrameNumber;
use splatblur::backend::{Meter, Reading};
use splatblur::study::StudyProgress;

use super::output::say;

/// Steps of a bar that shows a share.
const STEPS: u64 = 1000;

fn bar(length: u64, template: &str, quiet: bool) -> ProgressBar {
    // The stderr target draws on a terminal only.
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let bar = ProgressBar::with_draw_target(Some(length), target);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// Slow steps of loading, each with the share that is finished.
pub(super) struct Loading(ProgressBar);

impl Loading {
    pub(super) fn new(quiet: bool) -> Self {
        Self(bar(STEPS, "{msg} [{wide_bar}] {percent}%", quiet))
    }

    /// For [`splatblur::model::LoadProgress`].
    pub(super) fn step(&self, what: &str, share: f32) {
        if self.0.message() != what {
            self.0.set_message(what.to_owned());
        }
        self.0.set_position((share.clamp(0.0, 1.0) * STEPS as f32) as u64);
    }
}

impl Drop for Loading {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Shown {
    /// A bar, on a terminal only
    Bar,
    /// A line on stderr for each frame that is done, in a file or a pipe too
    Lines,
}

/// How progress is shown, as it is asked for.
#[derive(Debug, Args)]
pub(super) struct ProgressArgs {
    /// How progress is shown: a bar, on a terminal only, or a line on stderr for each frame, also into a log.
    #[arg(
        long,
        value_name = "HOW",
        value_enum,
        default_value = "bar",
        hide_possible_values = true,
        conflicts_with = "quiet",
        help_heading = "Running"
    )]
    progress: Shown,
}

/// The line of a frame that took so many seconds, `finished` of `all`; `None`: its files were there already.
fn line(frame: FrameNumber, seconds: Option<f64>, finished: u64, all: u64) -> String {
    let took = seconds.map_or_else(|| "there already".to_owned(), |seconds| format!("{seconds:.1} s"));
    format!("frame {frame}: {took}, {finished} of {all}")
}

/// How far a run is. Counted in frames; a frame that is under way counts in part.
#[derive(Clone, Copy, Debug, Default)]
struct FrameCount {
    all: u64,
    rendered: u64,
    /// They take no time, so that they say nothing about the time left.
    skipped: u64,
}

impl FrameCount {
    /// The line below the bar, apart from the times. `reading`: of the frame under way.
    fn text(self, several_renderings: bool, reading: Reading) -> String {
        let finished = self.rendered + self.skipped;
        let mut text = format!("{finished}/{} frames", self.all);
        if reading.renderings > 0 && finished < self.all {
            let part = if several_renderings { format!("rendering {}", reading.renderings) } else { "this".to_owned() };
            // Writing to a string cannot fail.
            let _ = write!(text, ", {part} {:.0}%", 100.0 * reading.share);
        }
        text
    }

    /// The time left after `gone`, from the frames and the share of a frame that it took; `None` before there is
    /// anything to go by.
    fn left(self, gone: Duration, share: f64) -> Option<Duration> {
        let done = self.rendered as f64 + share;
        let rest = (self.all - self.skipped) as f64 - done;
        (done >= LEAST_SHARE).then(|| gone.mul_f64((rest / done).max(0.0)))
    }
}

/// Share of a frame below which it says nothing about the time left.
const LEAST_SHARE: f64 = 0.05;
/// Time between two looks at the meter.
const LOOK: Duration = Duration::from_millis(250);

/// Frames finished, how far the one under way is, and the time left.
pub(super) struct Rendering {
    frames: Arc<Mutex<FrameCount>>,
    meter: Arc<Meter>,
    says_lines: bool,
    /// Dropped, it ends the thread that draws; `None` where nothing is drawn.
    drawing: Option<(mpsc::Sender<()>, thread::JoinHandle<()>)>,
}

impl Rendering {
    /// `meter`: of the frame under way. `several_renderings`: a frame takes nobody knows how many, as in mode auto, so
    /// that its share says nothing about the time left.
    pub(super) fn new(
        all: u64,
        meter: Arc<Meter>,
        several_renderings: bool,
        quiet: bool,
        &ProgressArgs { progress }: &ProgressArgs,
    ) -> Self {
        let says_lines = progress == Shown::Lines;
        let frames = Arc::new(Mutex::new(FrameCount { all, ..FrameCount::default() }));
        let bar = bar(all * STEPS, "[{wide_bar}] {msg}", quiet || says_lines);
        let drawing = (!bar.is_hidden()).then(|| {
            let (stop, stopped) = mpsc::channel();
            let (frames, meter, start) = (Arc::clone(&frames), Arc::clone(&meter), Instant::now());
            let draw = move || {
                while stopped.recv_timeout(LOOK) == Err(mpsc::RecvTimeoutError::Timeout) {
                    let frames = *frames.lock().unwrap_or_else(PoisonError::into_inner);
                    let (reading, gone) = (meter.read(), start.elapsed());
                    let share = if several_renderings { 0.0 } else { reading.share };
                    let left = frames.left(gone, share).map_or_else(
                        || "time left not known yet".to_owned(),
                        |left| format!("{} left", HumanDuration(Duration::from_secs(left.as_secs()))),
                    );
                    let text = frames.text(several_renderings, reading);
                    bar.set_message(format!("{text}, {} s gone, {left}", gone.as_secs()));
                    let finished = (frames.rendered + frames.skipped) as f64 + share;
                    bar.set_position((finished * STEPS as f64) as u64);
                }
                bar.finish_and_clear();
            };
            (stop, thread::spawn(draw))
        });
        Self { frames, meter, says_lines, drawing }
    }

    /// `seconds`: that the frame took; `None`: its files were there already.
    pub(super) fn finished(&self, frame: FrameNumber, seconds: Option<f64>) {
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        *(if seconds.is_none() { &mut frames.skipped } else { &mut frames.rendered }) += 1;
        self.meter.reset();
        if self.says_lines {
            say(&line(frame, seconds, frames.rendered + frames.skipped, frames.all));
        }
    }
}

impl Drop for Rendering {
    fn drop(&mut self) {
        if let Some((stop, drawing)) = self.drawing.take() {
            drop(stop);
            // A panic while drawing is no reason for another.
            let _ = drawing.join();
        }
    }
}

/// Renderings finished, what is going on, and the time left.
pub(super) struct Steps(ProgressBar);

impl Steps {
    pub(super) fn new(steps: u64, quiet: bool) -> Self {
        let bar = bar(steps * STEPS, "{msg} [{wide_bar}] {percent}%, {elapsed} gone, {eta} left", quiet);
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(500));
        }
        Self(bar)
    }

    /// For [`splatblur::study::Tell`].
    pub(super) fn tell(&self, progress: StudyProgress<'_>) {
        match progress {
            StudyProgress::At { step, what, share } => {
                if self.0.message() != what {
                    self.0.set_message(what.to_owned());
                }
                self.0.set_position(step * STEPS + (share.clamp(0.0, 1.0) * STEPS as f32) as u64);
            }
            StudyProgress::SkipTo(step) => {
                self.0.set_position(step * STEPS);
                self.0.reset_eta();
            }
        }
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_frames_and_shares() {
        let seconds = |frames: FrameCount, gone: u64, share: f64| {
            frames.left(Duration::from_secs(gone), share).map(|left| left.as_secs_f64())
        };
        let frames = |all, rendered, skipped| FrameCount { all, rendered, skipped };
        // Nothing to go by.
        assert_eq!(seconds(frames(10, 0, 0), 100, 0.0), None);
        assert_eq!(seconds(frames(10, 0, 4), 100, 0.01), None);
        // A quarter of the only frame.
        assert_eq!(seconds(frames(1, 0, 0), 10, 0.25), Some(30.0));
        // Two and a half of ten frames in 50 s; of five in the same time, where five were skipped.
        assert_eq!(seconds(frames(10, 2, 0), 50, 0.5), Some(150.0));
        assert_eq!(seconds(frames(10, 2, 5), 50, 0.5), Some(50.0));
        assert_eq!(seconds(frames(3, 3, 0), 50, 0.0), Some(0.0));
    }

    #[test]
    fn the_line_says_how_far_the_frame_is() {
        let frames = FrameCount { all: 48, rendered: 2, skipped: 1 };
        let reading = Reading { renderings: 2, share: 0.4 };
        assert_eq!(frames.text(false, reading), "3/48 frames, this 40%");
        assert_eq!(frames.text(true, reading), "3/48 frames, rendering 2 40%");
        assert_eq!(frames.text(false, Reading::default()), "3/48 frames");
        assert_eq!(FrameCount { all: 3, rendered: 3, skipped: 0 }.text(false, reading), "3/3 frames");
    }
}
