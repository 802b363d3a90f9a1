//! The worker of a page: takes the newest view out of the box, and makes what it needs next.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::super::display::show;
use super::super::message::{Header, SavedKind, Sent, Told};
use super::super::pace::{Level, Pace};
use super::super::save::{Finished, save};
use super::super::shared::{Known, Shared};
use super::super::stage::{Outcome, StagesDone, Task, next};
use super::super::view::{Other, PageView};
use super::filming::Filming;
use super::page::{Errors, Held, Page, Wish};
use super::sides::Sides;
use super::studio::{Ended, Studio};
use super::words::{about, header};
use crate::film::{Aov, Picture};
use crate::movie;
use crate::options::{Look, Quality};
use crate::reference::{ReferenceOptions, SCRAMBLINGS, Sums};
use crate::renderer::Device;

/// Samples of a pixel at which a reference is good enough to look at.
const MOST_SAMPLES: u64 = 1024;

/// Renders what a page asks for.
pub(in super::super) struct Worker<'a> {
    shared: &'a Arc<Shared>,
    page: &'a Arc<Page>,
    /// Takes what is sent; false where the page has gone.
    send: &'a dyn Fn(Sent) -> bool,
    known: Option<Arc<Known>>,
    studio: Studio<'a>,
    pace: Pace,
    sides: Sides,
    /// Pictures that were sent.
    sent: u64,
    /// The quick picture that the page has not shown yet: its level, the time of rendering, and its begin.
    under_way: Option<(Level, Duration, Instant)>,
    /// The view that was told to rest.
    rests: Option<u64>,
    /// A movie under way.
    filming: Option<Filming>,
}

/// What the worker does next.
enum Job {
    News,
    Refuse(String),
    Save(SavedKind),
    Compared(u64, Errors),
    Render(Task, Box<PageView>),
    Rest(u64),
    /// A movie is to be begun, of a view if there is one, or ended.
    Movie(Wish, Option<Box<PageView>>),
    /// The next frame of the movie.
    Film,
}

impl<'a> Worker<'a> {
    pub(in super::super) fn new(shared: &'a Arc<Shared>, page: &'a Arc<Page>, send: &'a dyn Fn(Sent) -> bool) -> Self {
        page.put(false, |held| held.has_news = true);
        Self {
            shared,
            page,
            send,
            known: None,
            studio: Studio::new(shared, Arc::clone(&page.stop)),
            pace: Pace::default(),
            sides: Sides::default(),
            sent: 0,
            under_way: None,
            rests: None,
            filming: None,
        }
    }

    /// Works until the page has gone; false: what was sent could not be taken.
    pub(in super::super) fn run(mut self) -> bool {
        let page = self.page;
        while let Some(job) = page.wait(|held| self.job(held)) {
            let told = match job {
                Job::News => self.news(),
                Job::Refuse(why) => self.refuse(&why),
                Job::Rest(serial) => {
                    self.rests = Some(serial);
                    (self.send)(Told::Rests { serial }.sent())
                }
                Job::Save(kind) => self.save(kind),
                Job::Compared(serial, Errors { flip, rmse, samples }) => {
                    (self.send)(Told::Compared { serial, flip, rmse, samples }.sent())
                }
                Job::Render(task, view) => self.render(task, &view),
                Job::Movie(Wish::Make(kind), view) => self.begin_movie(kind, view.as_deref()),
                Job::Movie(Wish::Stop, _) => self.filming.take().is_none() || (self.send)(Told::Filmed.sent()),
                Job::Film => self.film(),
            };
            if !told {
                return false;
            }
        }
        true
    }

    fn refuse(&self, why: &str) -> bool {
        (self.send)(Told::Refused { message: (self.shared.setup.words)(why) }.sent())
    }

    /// The job for what the box holds, and whether a newer view may stop it.
    fn job(&mut self, held: &mut Held) -> Option<(Job, bool)> {
        let job = Self::word(held).or_else(|| self.work(held))?;
        let may_stop = matches!(job, Job::Film) || matches!(job, Job::Render(task, _) if task != Task::Quick);
        Some((job, may_stop))
    }

    /// What the page is told at once.
    fn word(held: &mut Held) -> Option<Job> {
        if std::mem::take(&mut held.has_news) {
            return Some(Job::News);
        }
        if let Some(wish) = held.movie.take() {
            return Some(Job::Movie(wish, held.view.clone().map(Box::new)));
        }
        held.refusals.pop_front().map(Job::Refuse)
    }

    /// The next job, once the page has shown all that was sent.
    fn work(&mut self, held: &mut Held) -> Option<Job> {
        let (shown, heard) = held.shown;
        if shown < self.sent {
            return None;
        }
        if let (Some((level, rendering, begin)), Some(heard)) = (self.under_way.take(), heard) {
            self.pace.learn(level, rendering, heard.saturating_duration_since(begin).saturating_sub(rendering));
        }
        let view = held.view.as_ref()?;
        self.known.as_ref()?;
        self.sides.keep(view);
        if self.sides.done.first == Outcome::Finished
            && let Some(kind) = held.saves.pop_front()
        {
            return Some(Job::Save(kind));
        }
        if let Some((number, compared)) = held.compared.take() {
            // A comparison of sides that are gone is of no use.
            if self.sides.compared(number) {
                return Some(match compared {
                    Ok(errors) => Job::Compared(view.serial, errors),
                    Err(why) => Job::Refuse(why),
                });
            }
        }
        let is_comparing = self.sides.is_comparing;
        let film = self.filming.is_some().then_some(Job::Film);
        match next(view.moving, view.other.is_some(), self.sides.done) {
            Some(Task::Compare) if is_comparing => film,
            Some(task) => Some(Job::Render(task, Box::new(view.clone()))),
            None if view.moving => None,
            None if is_comparing || self.rests == Some(view.serial) => film,
            None => Some(Job::Rest(view.serial)),
        }
    }

    fn begin_movie(&mut self, kind: movie::MovieKind, view: Option<&PageView>) -> bool {
        if self.filming.is_some() {
            return self.refuse("a movie is under way already");
        }
        let (Some(known), Some(view)) = (&self.known, view) else { return self.refuse("there is nothing to film yet") };
        match Filming::begin(self.shared, known, view, kind) {
            Ok(filming) => {
                let (done, frames) = filming.progress();
                self.filming = Some(filming);
                (self.send)(Told::Filming { done, frames }.sent())
            }
            Err(why) => self.refuse(&why),
        }
    }

    /// Makes the next frame of the movie, and saves it after the last.
    fn film(&mut self) -> bool {
        let Some(mut filming) = self.filming.take() else { return true };
        match self.open(filming.device()).and_then(|()| filming.step(&mut self.studio)) {
            Ok(()) if filming.is_done() => {
                let told = match filming.finish(self.shared) {
                    Ok(path) => (self.send)(Told::Saved { path: path.display().to_string() }.sent()),
                    Err(why) => self.refuse(&why),
                };
                told && (self.send)(Told::Filmed.sent())
            }
            Ok(()) => {
                let (done, frames) = filming.progress();
                self.filming = Some(filming);
                (self.send)(Told::Filming { done, frames }.sent())
            }
            // Later again.
            Err(Ended::Stopped) => {
                self.filming = Some(filming);
                true
            }
            Err(Ended::Failed(why)) => self.refuse(&why) && (self.send)(Told::Filmed.sent()),
        }
    }

    /// Tells the page of the scene.
    fn news(&mut self) -> bool {
        self.studio.make_room();
        let state = self.shared.state();
        let is_new = match (&self.known, &state.scene) {
            (Some(old), Some(new)) => !Arc::ptr_eq(old, new),
            (old, new) => old.is_some() != new.is_some(),
        };
        let mut told = true;
        if is_new && let Some(known) = &state.scene {
            self.pace.forget();
            self.sides.look = None;
            told &= (self.send)(Told::Scene(Box::new(about(known, self.shared.setup.modes))).sent());
        }
        self.known = state.scene;
        if let Some(why) = state.broken {
            told &= (self.send)(Told::Broken { message: (self.shared.setup.words)(&why) }.sent());
        } else if state.loading {
            told &= (self.send)(Told::Loading.sent());
        }
        told
    }

    fn save(&self, kind: SavedKind) -> bool {
        let (Some(known), Some(look), Some(finished)) = (&self.known, &self.sides.look, &self.sides.first) else {
            return true;
        };
        match save(self.shared, known, look, finished, kind) {
            Ok(path) => (self.send)(Told::Saved { path: path.display().to_string() }.sent()),
            Err(why) => self.refuse(&why),
        }
    }

    fn render(&mut self, task: Task, view: &PageView) -> bool {
        let Some(known) = self.known.clone() else { return true };
        let made = match task {
            Task::Quick | Task::Whole => self.quick(task, view, &known),
            Task::First => self.first(view, &known),
            Task::Second => match view.other {
                Some(Other::Reference) => self.reference(view, &known),
                Some(Other::Mode(quality)) => self.second(view, quality, &known),
                None => Ok(true),
            },
            Task::Compare => {
                self.sides.compare(self.shared, self.page);
                Ok(true)
            }
        };
        match made {
            Ok(told) => told,
            Err(Ended::Stopped) => true,
            Err(Ended::Failed(why)) => {
                let done = &mut self.sides.done;
                match task {
                    Task::Quick | Task::Whole => {
                        *done = StagesDone { quick: Some(true), first: Outcome::Failed, ..*done }
                    }
                    Task::First => done.first = Outcome::Failed,
                    Task::Second => done.second = Outcome::Failed,
                    Task::Compare => done.compared = true,
                }
                self.refuse(&why)
            }
        }
    }

    /// Opens the device that a view asks for.
    fn open(&mut self, device: &Device) -> Result<(), Ended> {
        if self.studio.open(device)? {
            self.pace.forget();
        }
        Ok(())
    }

    fn quick(&mut self, task: Task, view: &PageView, known: &Known) -> Result<bool, Ended> {
        let begin = Instant::now();
        self.open(&view.look.device)?;
        let level = self.pace.level();
        let whole = task == Task::Whole;
        let size = if whole { view.look.size } else { level.size(view.look.size) };
        let scene = view.look.scene(known, size);
        let options = view.look.quick(&scene, view.quality, level.samples, self.studio.memory());
        let (rendered, time) = self.studio.render(&scene, &view.look, &options)?;
        let mut header = header(view, &scene, "both", self.studio.describe(), time);
        header.mode = options.quality.to_string();
        let told = self.picture(header, &rendered.picture, view.look.buffer)?;
        self.under_way = (!whole).then_some((level, time, begin));
        self.sides.done.quick = Some(whole || level.is_whole());
        self.studio.recycle(rendered.picture);
        Ok(told)
    }

    fn first(&mut self, view: &PageView, known: &Known) -> Result<bool, Ended> {
        self.open(&view.look.device)?;
        let scene = view.look.scene(known, view.look.size);
        let options = view.look.options(view.quality, self.studio.memory());
        let (rendered, time) = self.studio.render(&scene, &view.look, &options)?;
        let side = if view.other.is_some() { "first" } else { "both" };
        let mut header = header(view, &scene, side, self.studio.describe(), time);
        header.finished = true;
        header.mode = view.quality.to_string();
        header.error = rendered.stats.achieved.map(|achieved| achieved.error);
        let comment = rendered.stats.achieved.map(|achieved| (self.shared.setup.words)(&achieved.to_string()));
        header.note.clone_from(&comment);
        if view.look.buffer == Some(Aov::Error) && options.look.aovs.is_empty() {
            header.note = Some("buffer error is for mode auto, which estimates it, and for the reference".to_owned());
        }
        let told = self.picture(header, &rendered.picture, view.look.buffer)?;
        let (picture, backend) = (Arc::new(rendered.picture), self.studio.name());
        self.sides.put_first(Finished { picture, scene, options, backend, comment });
        Ok(told)
    }

    fn second(&mut self, view: &PageView, quality: Quality, known: &Known) -> Result<bool, Ended> {
        self.open(&view.look.device)?;
        let scene = view.look.scene(known, view.look.size);
        let options = view.look.options(quality, self.studio.memory());
        let (rendered, time) = self.studio.render(&scene, &view.look, &options)?;
        let mut header = header(view, &scene, "second", self.studio.describe(), time);
        header.finished = true;
        header.mode = quality.to_string();
        header.error = rendered.stats.achieved.map(|achieved| achieved.error);
        let told = self.picture(header, &rendered.picture, view.look.buffer)?;
        self.sides.put_second(rendered.picture, Outcome::Finished);
        Ok(told)
    }

    /// The reference with twice the samples.
    fn reference(&mut self, view: &PageView, known: &Known) -> Result<bool, Ended> {
        let scene = view.look.scene(known, view.look.size);
        let before = self.sides.sums.as_ref().map_or(0, Sums::samples);
        let options = ReferenceOptions {
            samples: (2 * before).clamp(SCRAMBLINGS as u64, MOST_SAMPLES),
            look: Look {
                shading: view.look.shading,
                aovs: view.look.buffer.into_iter().filter(|aov| !matches!(aov, Aov::Error | Aov::LodError)).collect(),
                ..Look::default()
            },
            ..ReferenceOptions::default()
        };
        // Lost where it is stopped: then the view is another anyway.
        let earlier = self.sides.sums.take();
        let (made, time) = self.studio.trace(&scene, &view.look, &options, earlier)?;
        let is_last = made.stats.samples >= MOST_SAMPLES;
        let mut header = header(view, &scene, "second", "the CPU".to_owned(), time);
        header.finished = is_last;
        header.mode = format!("reference:{}", made.stats.samples);
        header.error = Some(made.stats.mean_error);
        let told = self.picture(header, &made.picture, view.look.buffer)?;
        self.sides.put_second(made.picture, if is_last { Outcome::Finished } else { Outcome::Part });
        self.sides.sums = Some(made.sums);
        Ok(told)
    }

    /// Sends a picture.
    fn picture(&mut self, mut header: Header, picture: &Picture, buffer: Option<Aov>) -> Result<bool, Ended> {
        let display = self.known.as_ref().map(|known| known.loaded.display()).unwrap_or_default();
        let shown = self.shared.setup.pool.install(|| show(picture, buffer, display));
        let shown = shown.map_err(|why| Ended::Failed(why.to_string()))?;
        self.sent += 1;
        header.picture = self.sent;
        (header.width, header.height) = (picture.width, picture.height);
        header.range = shown.range;
        Ok((self.send)(header.sent(&shown.png)))
    }
}
