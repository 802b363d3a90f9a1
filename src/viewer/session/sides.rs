//! What was made of a page's view: both sides of the slider, and how far they are.

use std::sync::Arc;
use std::thread;

use super::super::save::Finished;
use super::super::shared::Shared;
use super::super::stage::{Outcome, StagesDone};
use super::super::view::{Other, PageLook, PageView};
use super::page::{Errors, Page};
use crate::compare::{Comparison, Metric};
use crate::film::Picture;
use crate::options::Quality;
use crate::reference::Sums;

/// What was made of a view.
#[derive(Default)]
pub(super) struct Sides {
    /// What `done` is about.
    pub(super) look: Option<PageLook>,
    quality: Option<Quality>,
    other: Option<Other>,
    pub(super) done: StagesDone,
    pub(super) first: Option<Finished>,
    second: Option<Arc<Picture>>,
    /// Sums of the reference.
    pub(super) sums: Option<Sums>,
    /// Number of the comparison that is of use, and whether one is under way. It has a thread of its own, since it
    /// cannot be stopped.
    comparisons: u64,
    pub(super) is_comparing: bool,
}

impl Sides {
    /// Keeps of what was made only what is part of `view`.
    pub(super) fn keep(&mut self, view: &PageView) {
        if self.look.as_ref() != Some(&view.look) {
            self.done = StagesDone::default();
            self.first = None;
            self.forget_second();
            self.look = Some(view.look.clone());
        }
        if self.quality != Some(view.quality) {
            self.done.first = Outcome::Missing;
            self.done.compared = false;
            self.comparisons += 1;
            self.first = None;
            self.quality = Some(view.quality);
        }
        if self.other != view.other {
            self.forget_second();
            self.other = view.other;
        }
    }

    fn forget_second(&mut self) {
        self.done.second = Outcome::Missing;
        self.done.compared = false;
        self.comparisons += 1;
        self.second = None;
        self.sums = None;
    }

    /// Takes the first side.
    pub(super) fn put_first(&mut self, finished: Finished) {
        self.first = Some(finished);
        self.done.first = Outcome::Finished;
        self.done.compared = false;
    }

    /// Takes the second side.
    pub(super) fn put_second(&mut self, picture: Picture, outcome: Outcome) {
        self.second = Some(Arc::new(picture));
        self.done.second = outcome;
        self.done.compared = false;
    }

    /// Begins to compare both sides; `page` gets the errors.
    pub(super) fn compare(&mut self, shared: &Arc<Shared>, page: &Arc<Page>) {
        self.done.compared = true;
        let (Some(first), Some(second)) = (&self.first, &self.second) else { return };
        let (first, second) = (Arc::clone(&first.picture), Arc::clone(second));
        let (shared, page) = (Arc::clone(shared), Arc::clone(page));
        let samples = self.sums.as_ref().map(Sums::samples);
        self.comparisons += 1;
        let number = self.comparisons;
        let work = move || {
            let compared = shared.setup.pool.install(|| Comparison::new(&first, &second, &[Metric::Flip]));
            let errors = compared.map(|compared| {
                let [flip, rmse] = [Metric::Flip, Metric::Rmse].map(|m| compared.value(m).unwrap_or(f64::NAN));
                Errors { flip, rmse, samples }
            });
            page.put(false, |held| held.compared = Some((number, errors.map_err(|why| why.to_string()))));
        };
        self.is_comparing = thread::Builder::new().spawn(work).is_ok();
    }

    /// A comparison is done. Is it that of the sides as they are now?
    pub(super) fn compared(&mut self, number: u64) -> bool {
        self.is_comparing = false;
        number == self.comparisons
    }
}
