//! Progress on a terminal; nothing in a pipe.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use splatblur::study::Progress;

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

    /// For [`splatblur::model::Progress`].
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

/// Frames finished, and the time left.
pub(super) struct Rendering(ProgressBar);

impl Rendering {
    pub(super) fn new(frames: u64, quiet: bool) -> Self {
        let bar = bar(frames, "[{wide_bar}] {pos}/{len} frames, {elapsed} gone, {eta} left", quiet);
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(500));
        }
        Self(bar)
    }

    pub(super) fn finished(&self, skipped: bool) {
        self.0.inc(1);
        if skipped {
            // A skipped frame takes no time, so that it says nothing about the time left.
            self.0.reset_eta();
        }
    }
}

impl Drop for Rendering {
    fn drop(&mut self) {
        self.0.finish_and_clear();
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
    pub(super) fn tell(&self, progress: Progress<'_>) {
        match progress {
            Progress::At { step, what, share } => {
                if self.0.message() != what {
                    self.0.set_message(what.to_owned());
                }
                self.0.set_position(step * STEPS + (share.clamp(0.0, 1.0) * STEPS as f32) as u64);
            }
            Progress::SkipTo(step) => {
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
