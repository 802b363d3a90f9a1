//! The box between a page and its worker.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::super::message::{Message, SavedKind};
use super::super::shared::Listener;
use super::super::view::PageView;
use crate::movie;
use crate::stop::Stop;

/// Files that wait to be saved.
const MOST_SAVES: usize = 8;
/// Messages that wait to be told.
const MOST_WORDS: usize = 16;

/// The box of a page.
#[derive(Default)]
pub(in super::super) struct Page {
    held: Mutex<Held>,
    changed: Condvar,
    /// Ends what refines an older view.
    pub(super) stop: Arc<Stop>,
}

/// The contents of the box.
#[derive(Default)]
pub(super) struct Held {
    pub(super) view: Option<PageView>,
    pub(super) saves: VecDeque<SavedKind>,
    /// A movie that is to be made, or the end of the one under way.
    pub(super) movie: Option<Wish>,
    pub(super) refusals: VecDeque<String>,
    /// The last picture that was shown, and when that was heard.
    pub(super) shown: (u64, Option<Instant>),
    /// A comparison that is done, by its number.
    pub(super) compared: Option<(u64, Result<Errors, String>)>,
    /// The scene is another, or cannot be read, or there is another page.
    pub(super) has_news: bool,
    /// The picture under way may be stopped by a newer view.
    may_stop: bool,
    closed: bool,
}

/// What the page wants of a movie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wish {
    Make(movie::MovieKind),
    Stop,
}

/// Errors of the first side against the second.
pub(super) struct Errors {
    pub(super) flip: f64,
    pub(super) rmse: f64,
    /// Samples of the reference.
    pub(super) samples: Option<u64>,
}

impl Listener for Page {
    fn news(&self) {
        self.put(true, |held| held.has_news = true);
    }
}

impl Page {
    fn hold(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what the box holds, and wakes the worker. `stops`: a refinement under way is of no use any more.
    pub(super) fn put(&self, stops: bool, change: impl FnOnce(&mut Held)) {
        let mut held = self.hold();
        change(&mut held);
        if stops && held.may_stop || held.closed {
            self.stop.set();
        }
        drop(held);
        self.changed.notify_one();
    }

    /// Waits until `find` finds something to do in the box, and says whether that may be stopped; `None`: the page has
    /// gone.
    pub(super) fn wait<T>(&self, mut find: impl FnMut(&mut Held) -> Option<(T, bool)>) -> Option<T> {
        let mut held = self.hold();
        loop {
            if held.closed {
                return None;
            }
            if let Some((found, may_stop)) = find(&mut held) {
                held.may_stop = may_stop;
                self.stop.clear();
                return Some(found);
            }
            held = self.changed.wait(held).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Takes a message of the page.
    pub(in super::super) fn hear(&self, text: &str) {
        match serde_json::from_str(text) {
            Ok(Message::View(asked)) => match asked.check() {
                Ok(view) => {
                    let same = self.hold().view.as_ref().is_some_and(|old| old.shows_as(&view));
                    self.put(!same, |held| held.view = Some(view));
                }
                Err(why) => self.refuse(why),
            },
            Ok(Message::Shown { picture }) => self.put(false, |held| held.shown = (picture, Some(Instant::now()))),
            Ok(Message::Save { what }) => self.put(false, |held| {
                if held.saves.len() < MOST_SAVES {
                    held.saves.push_back(what);
                }
            }),
            Ok(Message::Movie { format }) => match format.as_deref().map(movie_kind) {
                None => self.put(true, |held| held.movie = Some(Wish::Stop)),
                Some(Ok(kind)) => self.put(false, |held| held.movie = Some(Wish::Make(kind))),
                Some(Err(why)) => self.refuse(why),
            },
            Err(why) => self.refuse(format!("the page said what it should not: {why}")),
        }
    }

    fn refuse(&self, why: String) {
        self.put(false, |held| {
            if held.refusals.len() < MOST_WORDS {
                held.refusals.push_back(why);
            }
        });
    }

    /// The page has gone.
    pub(in super::super) fn close(&self) {
        self.put(true, |held| held.closed = true);
    }
}

/// The format of movies with this extension.
fn movie_kind(extension: &str) -> Result<movie::MovieKind, String> {
    let known = movie::MovieKind::ALL.into_iter().find(|kind| kind.extension() == extension);
    known.ok_or_else(|| format!("there are no movies as .{extension}: expected mp4, mov, y4m or gif"))
}
