//! The frames under way, from the one that was asked for last to the one that is handed out next, in their order.
//!
//! A backend finishes renderings in the order in which they were begun: the CPU has them done, the GPU has its
//! submissions (`Gpu::flights`). A frame of mode auto takes several renderings, each of which depends on those before.
//! Renderings of different frames take turns. Frames with the layer `object`, and frames that are passed, are in this
//! queue alone.

use std::collections::VecDeque;

use super::work::FrameWork;
use super::{check, check_values, render_frame};
use crate::backend::{Backend, BackendError, Rendered};
use crate::film::Aov;
use crate::options::RenderOptions;
use crate::scene::Scene;
use crate::time::FrameNumber;

/// Frames of a scene that are rendered one after the other, and leave in the order in which they came.
///
/// A caller gives a frame ([`begin`](Self::begin) or [`pass`](Self::pass)), then takes what must leave before the next
/// one ([`ready`](Self::ready)). At the end it takes the rest ([`finish`](Self::finish)). So the backend has as many
/// frames under way as it allows ([`Backend::in_flight`]), and at most one picture waits. Each frame has a `tag`, which
/// comes back with it.
///
/// A frame that fails is not in the queue any more; those before and after it are.
pub struct FrameQueue<'a, T> {
    backend: &'a mut dyn Backend,
    scene: &'a Scene,
    options: &'a RenderOptions,
    waiting: VecDeque<Waiting<'a, T>>,
    /// Frames that have left.
    left: u64,
    /// The legs that the backend has under way, in their order: the number of the frame in the queue, counted from the
    /// first that was ever in it, and the leg's renderings.
    legs: VecDeque<(u64, usize)>,
}

/// A frame that leaves the queue.
#[derive(Debug)]
pub struct FinishedFrame<T> {
    /// Its number.
    pub number: FrameNumber,
    /// What was given with it.
    pub tag: T,
    /// `None`: it was passed, not begun.
    pub rendered: Option<Rendered>,
}

/// Why a frame was not rendered.
#[derive(Debug, thiserror::Error)]
#[error("frame {number}")]
pub struct FrameError {
    /// The frame.
    pub number: FrameNumber,
    /// The cause.
    #[source]
    pub cause: BackendError,
}

/// A frame in the queue.
struct Waiting<'a, T> {
    number: FrameNumber,
    tag: T,
    state: State<'a>,
}

enum State<'a> {
    UnderWay(Box<FrameWork<'a>>),
    /// It is rendered, or need not be.
    Done(Option<Box<Rendered>>),
    Failed(BackendError),
}

impl<'a, T> FrameQueue<'a, T> {
    /// An empty queue. `backend` must have no frames under way.
    ///
    /// # Errors
    /// The scene or the options hold what the renderer refuses.
    pub fn new(
        backend: &'a mut dyn Backend,
        scene: &'a Scene,
        options: &'a RenderOptions,
    ) -> Result<Self, BackendError> {
        check_values(scene, options)?;
        check(scene, options)?;
        Ok(Self { backend, scene, options, waiting: VecDeque::new(), left: 0, legs: VecDeque::new() })
    }

    /// Begins frame `number`. With the layer `object` it is rendered at once.
    ///
    /// # Errors
    /// The number is not finite, the backend cannot render the frame within its limits, or it was stopped.
    pub fn begin(&mut self, number: impl Into<FrameNumber>, tag: T) -> Result<(), FrameError> {
        let number = number.into();
        let state = self.try_begin(number).map_err(|cause| FrameError { number, cause })?;
        self.waiting.push_back(Waiting { number, tag, state });
        Ok(())
    }

    /// Takes a frame that need not be rendered. It leaves in its turn.
    pub fn pass(&mut self, number: impl Into<FrameNumber>, tag: T) {
        self.waiting.push_back(Waiting { number: number.into(), tag, state: State::Done(None) });
    }

    /// Hands out the next frame if it was passed, or rendered at once, or failed, or if the backend takes no more
    /// frames before it is finished. `None`: there is room for another frame.
    ///
    /// # Errors
    /// As of [`finish`](Self::finish).
    pub fn ready(&mut self) -> Result<Option<FinishedFrame<T>>, FrameError> {
        let under_way = |waiting: &&Waiting<T>| matches!(waiting.state, State::UnderWay(_));
        let is_done = self.waiting.front().is_some_and(|next| !under_way(&next));
        let is_full = self.waiting.iter().filter(under_way).count() >= self.backend.in_flight();
        if is_done || is_full { self.finish() } else { Ok(None) }
    }

    /// Hands out the next frame, and waits for it. `None`: no frames are left.
    ///
    /// # Errors
    /// The backend cannot render the frame within its limits, or the device failed.
    pub fn finish(&mut self) -> Result<Option<FinishedFrame<T>>, FrameError> {
        while let Some(Waiting { state: State::UnderWay(work), .. }) = self.waiting.front()
            && !work.is_done()
            && !self.legs.is_empty()
        {
            self.land();
        }
        let Some(Waiting { number, tag, state }) = self.waiting.pop_front() else { return Ok(None) };
        self.left += 1;
        let rendered = match state {
            State::Done(rendered) => rendered.map(|rendered| *rendered),
            State::UnderWay(work) => work.finish(self.backend),
            State::Failed(cause) => return Err(FrameError { number, cause }),
        };
        Ok(Some(FinishedFrame { number, tag, rendered }))
    }

    /// Waits for the oldest leg under way, whichever frame it belongs to, and begins what follows from it.
    fn land(&mut self) {
        let Some((of, renderings)) = self.legs.pop_front() else { return };
        // A frame leaves after its last leg, or after it failed.
        let frame = of.checked_sub(self.left).and_then(|at| self.waiting.get_mut(at as usize));
        let Some(Waiting { state: state @ State::UnderWay(_), .. }) = frame else {
            (0..renderings).for_each(|_| drop(self.backend.finish()));
            return;
        };
        let State::UnderWay(work) = state else { return };
        match work.land(self.backend) {
            Ok(true) => self.legs.push_back((of, renderings)),
            Ok(false) => (),
            Err(cause) => *state = State::Failed(cause),
        }
    }

    fn try_begin(&mut self, number: FrameNumber) -> Result<State<'a>, BackendError> {
        if self.options.look.aovs.contains(&Aov::Object) {
            let rendered = render_frame(self.backend, self.scene, number, self.options)?;
            return Ok(State::Done(Some(Box::new(rendered))));
        }
        let work = FrameWork::begin(self.backend, self.scene, number, self.options)?;
        self.legs.push_back((self.left + self.waiting.len() as u64, work.renderings()));
        Ok(State::UnderWay(Box::new(work)))
    }
}

impl<T> Drop for FrameQueue<'_, T> {
    /// Gives up what is under way, so that the backend can begin something else.
    fn drop(&mut self) {
        let renderings: usize = self.legs.iter().map(|(_, renderings)| renderings).sum();
        (0..renderings).for_each(|_| self.backend.abandon());
    }
}

/// [`Renderer::render_sequence`](super::Renderer::render_sequence).
pub(super) struct RenderedFrames<'a, N> {
    /// `None` after the end.
    queue: Option<FrameQueue<'a, ()>>,
    /// Those that are not begun.
    numbers: N,
    /// What comes after the frames that are under way.
    failed: Option<BackendError>,
}

impl<'a, N> RenderedFrames<'a, N> {
    pub(super) fn new(queue: Result<FrameQueue<'a, ()>, BackendError>, numbers: N) -> Self {
        match queue {
            Ok(queue) => Self { queue: Some(queue), numbers, failed: None },
            Err(error) => Self { queue: None, numbers, failed: Some(error) },
        }
    }
}

impl<N: Iterator<Item: Into<FrameNumber>>> RenderedFrames<'_, N> {
    /// The next frame; `None` after the last, or where one failed and those before it were handed out.
    fn step(&mut self) -> Result<Option<FinishedFrame<()>>, FrameError> {
        let Some(queue) = &mut self.queue else { return Ok(None) };
        while self.failed.is_none() {
            if let Some(done) = queue.ready()? {
                return Ok(Some(done));
            }
            let Some(number) = self.numbers.next() else { break };
            if let Err(error) = queue.begin(number, ()) {
                self.failed = Some(error.cause);
            }
        }
        queue.finish()
    }
}

impl<N: Iterator<Item: Into<FrameNumber>>> Iterator for RenderedFrames<'_, N> {
    type Item = Result<(FrameNumber, Rendered), BackendError>;

    fn next(&mut self) -> Option<Self::Item> {
        let done = self.step();
        if let Ok(Some(FinishedFrame { number, rendered: Some(rendered), .. })) = done {
            return Some(Ok((number, rendered)));
        }
        self.queue = None;
        let error = done.err().map(|error| error.cause);
        // The earlier frame's error comes first.
        error.or(self.failed.take()).map(Err)
    }
}
