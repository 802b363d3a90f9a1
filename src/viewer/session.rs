//! One page: what it asks for, and the worker that renders it.
//!
//! The page's messages go into a box; the worker takes the newest view out of it. One picture is under way at a time:
//! the next is begun when the page has shown it. So a slow link gets few pictures instead of old ones.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use super::camera::CameraAt;
use super::display::show;
use super::message::{AboutScene, Header, Kind, Message, Sent, Told};
use super::pace::{Level, Pace};
use super::save::{Finished, save};
use super::stage::{Done, Outcome, Task, next};
use super::view::{Look, Other, View};
use super::watch::{Known, Listener, Shared};
use crate::backend::BackendError;
use crate::compare::{Comparison, Metric};
use crate::film::{Aov, Picture};
use crate::options::{Quality, RenderOptions};
use crate::reference::{self, ReferenceError, ReferenceOptions, SCRAMBLINGS, Sums};
use crate::renderer::{Device, Renderer};
use crate::scene::Scene;
use crate::scene_file;
use crate::stop::Stop;
use crate::study::provenance::PROGRAM;

/// Files that wait to be saved.
const MOST_SAVES: usize = 8;
/// Messages that wait to be told.
const MOST_WORDS: usize = 16;
/// Samples of a pixel at which a reference is good enough to look at.
const MOST_SAMPLES: u64 = 1024;
/// Parts of the shutter in the drawn time weight.
const CURVE: u32 = 64;

/// The box of a page.
#[derive(Default)]
pub(super) struct Page {
    held: Mutex<Held>,
    changed: Condvar,
    /// Ends what refines an older view.
    stop: Arc<Stop>,
}

#[derive(Default)]
struct Held {
    view: Option<View>,
    saves: VecDeque<Kind>,
    refusals: VecDeque<String>,
    /// The last picture that was shown, and when that was heard.
    shown: (u64, Option<Instant>),
    /// A comparison that is done, by its number.
    compared: Option<(u64, Result<Errors, String>)>,
    /// The scene is another, or cannot be read.
    has_news: bool,
    /// What is under way may be stopped by a newer view.
    may_stop: bool,
    closed: bool,
}

/// Errors of the first side against the second.
struct Errors {
    flip: f64,
    rmse: f64,
    /// Of the reference.
    samples: Option<u64>,
}

impl Listener for Page {
    fn scene_changed(&self) {
        self.put(true, |held| held.has_news = true);
    }
}

impl Page {
    fn hold(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes what the box holds, and wakes the worker. `stops`: a refinement under way is of no use any more.
    fn put(&self, stops: bool, change: impl FnOnce(&mut Held)) {
        let mut held = self.hold();
        change(&mut held);
        if stops && held.may_stop || held.closed {
            self.stop.set();
        }
        drop(held);
        self.changed.notify_one();
    }

    /// Takes a message of the page.
    pub(super) fn hear(&self, text: &str) {
        match serde_json::from_str(text) {
            Ok(Message::View(asked)) => match asked.check() {
                Ok(view) => {
                    let same = self.hold().view.as_ref().is_some_and(|old| {
                        old.look == view.look && old.quality == view.quality && old.other == view.other
                    });
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
    pub(super) fn close(&self) {
        self.put(true, |held| held.closed = true);
    }
}

/// Renders what a page asks for.
pub(super) struct Worker<'a> {
    shared: &'a Arc<Shared>,
    page: &'a Arc<Page>,
    /// Takes what is sent; false where the page has gone.
    send: &'a dyn Fn(Sent) -> bool,
    known: Option<Arc<Known>>,
    renderer: Option<(Device, Renderer)>,
    pace: Pace,
    /// Pictures that were sent.
    sent: u64,
    /// The quick picture that the page has not shown yet: its level, the time of rendering, and its begin.
    under_way: Option<(Level, Duration, Instant)>,
    /// What `done` is about.
    look: Option<Look>,
    quality: Option<Quality>,
    other: Option<Other>,
    done: Done,
    first: Option<Finished>,
    second: Option<Arc<Picture>>,
    sums: Option<Sums>,
    /// Number of the comparison that is of use, and whether one is under way. It has a thread of its own, since it
    /// cannot be stopped.
    comparisons: u64,
    is_comparing: bool,
    /// The view that was told to rest.
    rests: Option<u64>,
}

/// What the worker does next.
enum Job {
    News,
    Refuse(String),
    Save(Kind),
    Compared(u64, Errors),
    Render(Task, Box<View>),
    Rest(u64),
}

/// Why a task has no result.
enum Ended {
    /// A newer view came, or the page has gone.
    Stopped,
    Failed(String),
}

impl From<BackendError> for Ended {
    fn from(error: BackendError) -> Self {
        if matches!(error, BackendError::Stopped) { Self::Stopped } else { Self::Failed(error.to_string()) }
    }
}

impl From<ReferenceError> for Ended {
    fn from(error: ReferenceError) -> Self {
        if matches!(error, ReferenceError::Stopped) { Self::Stopped } else { Self::Failed(error.to_string()) }
    }
}

impl<'a> Worker<'a> {
    pub(super) fn new(shared: &'a Arc<Shared>, page: &'a Arc<Page>, send: &'a dyn Fn(Sent) -> bool) -> Self {
        page.hold().has_news = true;
        Self {
            shared,
            page,
            send,
            known: None,
            renderer: None,
            pace: Pace::default(),
            sent: 0,
            under_way: None,
            look: None,
            quality: None,
            other: None,
            done: Done::default(),
            first: None,
            second: None,
            sums: None,
            comparisons: 0,
            is_comparing: false,
            rests: None,
        }
    }

    /// Works until the page has gone; false: what was sent could not be taken.
    pub(super) fn run(mut self) -> bool {
        while let Some(job) = self.wait() {
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

    /// Waits for something to do; `None`: the page has gone.
    fn wait(&mut self) -> Option<Job> {
        let page = self.page;
        let mut held = page.hold();
        loop {
            if held.closed {
                return None;
            }
            if let Some(job) = self.job(&mut held) {
                held.may_stop = matches!(job, Job::Render(task, _) if task != Task::Quick);
                page.stop.clear();
                return Some(job);
            }
            held = page.changed.wait(held).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// What is to be done with what the box holds.
    fn job(&mut self, held: &mut Held) -> Option<Job> {
        if std::mem::take(&mut held.has_news) {
            return Some(Job::News);
        }
        if let Some(why) = held.refusals.pop_front() {
            return Some(Job::Refuse(why));
        }
        let (shown, heard) = held.shown;
        if shown < self.sent {
            return None;
        }
        if let (Some((level, rendering, begin)), Some(heard)) = (self.under_way.take(), heard) {
            self.pace.learn(level, rendering, heard.saturating_duration_since(begin).saturating_sub(rendering));
        }
        let view = held.view.as_ref()?;
        self.known.as_ref()?;
        self.compare_with(view);
        if self.done.first == Outcome::Finished
            && let Some(kind) = held.saves.pop_front()
        {
            return Some(Job::Save(kind));
        }
        if let Some((number, compared)) = held.compared.take() {
            self.is_comparing = false;
            // That of sides that are gone is of no use.
            if number == self.comparisons {
                return Some(match compared {
                    Ok(errors) => Job::Compared(view.serial, errors),
                    Err(why) => Job::Refuse(why),
                });
            }
        }
        match next(view.moving, view.other.is_some(), self.done) {
            Some(Task::Compare) if self.is_comparing => None,
            Some(task) => Some(Job::Render(task, Box::new(view.clone()))),
            None if view.moving || self.is_comparing || self.rests == Some(view.serial) => None,
            None => Some(Job::Rest(view.serial)),
        }
    }

    /// Keeps of what was made only what is part of `view`.
    fn compare_with(&mut self, view: &View) {
        if self.look.as_ref() != Some(&view.look) {
            self.done = Done::default();
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

    /// Tells the page of the scene.
    fn news(&mut self) -> bool {
        let state = self.shared.state();
        let is_new = match (&self.known, &state.scene) {
            (Some(old), Some(new)) => !Arc::ptr_eq(old, new),
            (old, new) => old.is_some() != new.is_some(),
        };
        let mut told = true;
        if is_new && let Some(known) = &state.scene {
            self.pace.forget();
            self.look = None;
            told &= (self.send)(Told::Scene(Box::new(self.about(known))).sent());
        }
        self.known = state.scene;
        if let Some(why) = state.broken {
            told &= (self.send)(Told::Broken { message: (self.shared.setup.words)(&why) }.sent());
        } else if state.loading {
            told &= (self.send)(Told::Loading.sent());
        }
        told
    }

    fn about(&self, known: &Known) -> AboutScene {
        let scene = known.scene();
        AboutScene {
            name: scene.name.clone(),
            width: scene.image.width,
            height: scene.image.height,
            first: scene.frames.first,
            last: scene.frames.last,
            rate: scene.frames.rate,
            open: scene.shutter.open,
            close: scene.shutter.close,
            weight: scene.shutter.weight.to_string(),
            surfels: scene.objects.iter().map(|object| object.model.elements() as u64).sum(),
            objects: scene.objects.len(),
            notes: known.loaded.notes.clone(),
            modes: self.shared.setup.modes,
            program: PROGRAM,
        }
    }

    fn save(&self, kind: Kind) -> bool {
        let (Some(known), Some(look), Some(finished)) = (&self.known, &self.look, &self.first) else { return true };
        match save(self.shared, known, look, finished, kind) {
            Ok(path) => (self.send)(Told::Saved { path: path.display().to_string() }.sent()),
            Err(why) => self.refuse(&why),
        }
    }

    fn render(&mut self, task: Task, view: &View) -> bool {
        let Some(known) = self.known.clone() else { return true };
        let made = match task {
            Task::Quick | Task::Whole => self.quick(task, view, &known),
            Task::First => self.first(view, &known),
            Task::Second => match view.other {
                Some(Other::Reference) => self.reference(view, &known),
                Some(Other::Mode(quality)) => self.second(view, quality, &known),
                None => Ok(true),
            },
            Task::Compare => Ok(self.compare()),
        };
        match made {
            Ok(told) => told,
            Err(Ended::Stopped) => true,
            Err(Ended::Failed(why)) => {
                match task {
                    Task::Quick | Task::Whole => {
                        self.done = Done { quick: Some(true), first: Outcome::Failed, ..self.done };
                    }
                    Task::First => self.done.first = Outcome::Failed,
                    Task::Second => self.done.second = Outcome::Failed,
                    Task::Compare => self.done.compared = true,
                }
                self.refuse(&why)
            }
        }
    }

    /// The renderer for a device, with its memory.
    fn renderer(&mut self, device: &Device) -> Result<u64, Ended> {
        if self.renderer.as_ref().is_none_or(|(of, _)| of != device) {
            self.pace.forget();
            let chosen = if *device == Device::Auto { &self.shared.setup.device } else { device };
            let mut renderer = Renderer::open(chosen.clone())?;
            renderer.heed(Arc::clone(&self.page.stop));
            self.renderer = Some((device.clone(), renderer));
        }
        let is_gpu = self.renderer.as_ref().is_some_and(|(_, renderer)| renderer.backend_name() == "gpu");
        Ok(self.shared.setup.memory[usize::from(is_gpu)])
    }

    /// Renders with the open renderer; the picture, its statistics and the seconds.
    fn rendered(
        &mut self,
        scene: &Scene,
        view: &View,
        options: &RenderOptions,
    ) -> Result<(crate::backend::Rendered, Duration), Ended> {
        let Some((_, renderer)) = &mut self.renderer else { return Err(Ended::Stopped) };
        let begin = Instant::now();
        let rendered = self.shared.setup.pool.install(|| renderer.render(scene, view.look.frame, options))?;
        Ok((rendered, begin.elapsed()))
    }

    fn quick(&mut self, task: Task, view: &View, known: &Known) -> Result<bool, Ended> {
        let begin = Instant::now();
        let memory = self.renderer(&view.look.device)?;
        let level = self.pace.level();
        let whole = task == Task::Whole;
        let size = if whole { view.look.size } else { level.size(view.look.size) };
        let scene = view.look.scene(known.scene(), known.of_model, size);
        let options = view.look.quick(view.quality, level.samples, memory);
        let (rendered, time) = self.rendered(&scene, view, &options)?;
        let mut header = self.header(view, &scene, "both", time);
        header.mode = options.quality.to_string();
        let told = self.picture(header, &rendered.picture, view.look.buffer)?;
        self.under_way = (!whole).then_some((level, time, begin));
        self.done.quick = Some(whole || level.is_whole());
        if let Some((_, renderer)) = &mut self.renderer {
            renderer.recycle(rendered.picture);
        }
        Ok(told)
    }

    fn first(&mut self, view: &View, known: &Known) -> Result<bool, Ended> {
        let memory = self.renderer(&view.look.device)?;
        let scene = view.look.scene(known.scene(), known.of_model, view.look.size);
        let options = view.look.options(view.quality, memory);
        let (rendered, time) = self.rendered(&scene, view, &options)?;
        let mut header = self.header(view, &scene, if view.other.is_some() { "first" } else { "both" }, time);
        header.finished = true;
        header.mode = view.quality.to_string();
        header.error = rendered.stats.achieved.map(|achieved| achieved.error);
        let comment = rendered.stats.achieved.map(|achieved| (self.shared.setup.words)(&achieved.to_string()));
        header.note.clone_from(&comment);
        if view.look.buffer == Some(Aov::Error) && options.aovs.is_empty() {
            header.note = Some("buffer error is for mode auto, which estimates it, and for the reference".to_owned());
        }
        let told = self.picture(header, &rendered.picture, view.look.buffer)?;
        let backend = self.renderer.as_ref().map_or("cpu", |(_, renderer)| renderer.backend_name());
        self.first = Some(Finished { picture: Arc::new(rendered.picture), scene, options, backend, comment });
        self.done.first = Outcome::Finished;
        self.done.compared = false;
        Ok(told)
    }

    fn second(&mut self, view: &View, quality: Quality, known: &Known) -> Result<bool, Ended> {
        let memory = self.renderer(&view.look.device)?;
        let scene = view.look.scene(known.scene(), known.of_model, view.look.size);
        let (rendered, time) = self.rendered(&scene, view, &view.look.options(quality, memory))?;
        let mut header = self.header(view, &scene, "second", time);
        header.finished = true;
        header.mode = quality.to_string();
        header.error = rendered.stats.achieved.map(|achieved| achieved.error);
        let told = self.picture(header, &rendered.picture, view.look.buffer)?;
        self.second = Some(Arc::new(rendered.picture));
        self.done.second = Outcome::Finished;
        self.done.compared = false;
        Ok(told)
    }

    /// The reference with twice the samples.
    fn reference(&mut self, view: &View, known: &Known) -> Result<bool, Ended> {
        let scene = view.look.scene(known.scene(), known.of_model, view.look.size);
        let before = self.sums.as_ref().map_or(0, Sums::samples);
        let splatted = view.look.options(view.quality, 0);
        let options = ReferenceOptions {
            samples: (2 * before).clamp(SCRAMBLINGS as u64, MOST_SAMPLES),
            shading: splatted.shading,
            aovs: view.look.buffer.into_iter().filter(|&aov| aov != Aov::Error).collect(),
            ..ReferenceOptions::default()
        };
        // Lost where it is stopped: then the view is another anyway.
        let earlier = self.sums.take();
        let begin = Instant::now();
        let stop = Some(&*self.page.stop);
        let made = self
            .shared
            .setup
            .pool
            .install(|| reference::render_until(&scene, view.look.frame, &options, earlier, (&|_| (), stop)))?;
        let mut header = self.header(view, &scene, "second", begin.elapsed());
        header.finished = made.stats.samples >= MOST_SAMPLES;
        header.mode = format!("reference:{}", made.stats.samples);
        "the CPU".clone_into(&mut header.backend);
        header.error = Some(made.stats.mean_error);
        let told = self.picture(header, &made.picture, view.look.buffer)?;
        self.done.second = if made.stats.samples >= MOST_SAMPLES { Outcome::Finished } else { Outcome::Part };
        self.done.compared = false;
        self.second = Some(Arc::new(made.picture));
        self.sums = Some(made.sums);
        Ok(told)
    }

    /// Begins to compare both sides.
    fn compare(&mut self) -> bool {
        let (Some(first), Some(second)) = (&self.first, &self.second) else { return true };
        let (first, second) = (Arc::clone(&first.picture), Arc::clone(second));
        let (shared, page) = (Arc::clone(self.shared), Arc::clone(self.page));
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
        self.done.compared = true;
        true
    }

    fn header(&self, view: &View, scene: &Scene, side: &'static str, time: Duration) -> Header {
        let camera = CameraAt::of(scene, view.look.frame.get());
        let mut alone = scene.camera.clone();
        camera.place(&mut alone);
        let strata = scene.shutter.strata(CURVE, 0.5);
        Header {
            picture: 0,
            serial: view.serial,
            side,
            finished: false,
            width: 0,
            height: 0,
            mode: String::new(),
            backend: self.renderer.as_ref().map_or_else(String::new, |(_, renderer)| {
                renderer.describe_with(self.shared.setup.pool.current_num_threads())
            }),
            seconds: time.as_secs_f64(),
            error: None,
            note: None,
            buffer: view.look.buffer.map_or("colour", Aov::name),
            range: None,
            camera,
            line: scene_file::camera_line(&alone),
            curve: strata.into_iter().map(|(_, weight)| weight * f64::from(CURVE)).collect(),
        }
    }

    /// Sends a picture.
    fn picture(&mut self, mut header: Header, picture: &Picture, buffer: Option<Aov>) -> Result<bool, Ended> {
        let shown = self.shared.setup.pool.install(|| show(picture, buffer));
        let shown = shown.map_err(|why| Ended::Failed(why.to_string()))?;
        self.sent += 1;
        header.picture = self.sent;
        (header.width, header.height) = (picture.width, picture.height);
        header.range = shown.range;
        Ok((self.send)(header.sent(&shown.png)))
    }
}
