//! The driver: a scene and frame numbers to pictures.

use std::collections::VecDeque;

use crate::auto;
use crate::backend::{Backend, BackendError};
use crate::film::Aov;
use crate::frame::Frame;
use crate::options::{Quality, RenderOptions};
use crate::reconstruct;
use crate::scene::Scene;

pub use crate::backend::{Rendered, Stats};

/// Renders one frame of a scene.
///
/// # Errors
/// The backend cannot render the frame within its limits, or the scene holds what only the reference can show.
pub fn render_frame(
    backend: &mut dyn Backend,
    scene: &Scene,
    frame: i64,
    options: &RenderOptions,
) -> Result<Rendered, BackendError> {
    check(scene)?;
    if options.reconstruct {
        let rendered = render_frame(backend, scene, frame, &with_velocity(options))?;
        return Ok(reconstructed(rendered, options));
    }
    match options.quality {
        Quality::Error(target) => auto::render(backend, scene, frame, options, target),
        Quality::Mode(mode) => backend.render(Frame::new(scene, frame, mode, options)),
    }
}

/// What [`reconstruct::along`] needs to be rendered.
fn with_velocity(options: &RenderOptions) -> RenderOptions {
    let mut options = RenderOptions { reconstruct: false, ..options.clone() };
    if !options.aovs.contains(&Aov::Velocity) {
        options.aovs.push(Aov::Velocity);
        options.aovs.sort_unstable();
    }
    options
}

fn reconstructed(mut rendered: Rendered, options: &RenderOptions) -> Rendered {
    reconstruct::along(&mut rendered.picture);
    rendered.picture.layers.retain(|layer| options.aovs.contains(&layer.aov));
    rendered
}

fn check(scene: &Scene) -> Result<(), BackendError> {
    match scene.objects.iter().find(|object| object.sphere.is_some()) {
        Some(object) => Err(BackendError::Sphere { object: object.name.clone() }),
        None => Ok(()),
    }
}

/// Renders frames of a scene one after the other, with as many under way as the backend allows.
pub struct Frames<'a> {
    backend: &'a mut dyn Backend,
    scene: &'a Scene,
    options: &'a RenderOptions,
    /// Begun and not finished.
    under_way: VecDeque<i64>,
}

impl<'a> Frames<'a> {
    /// No frames yet. `backend` must have none under way.
    ///
    /// # Errors
    /// The scene holds what only the reference can show.
    pub fn new(
        backend: &'a mut dyn Backend,
        scene: &'a Scene,
        options: &'a RenderOptions,
    ) -> Result<Self, BackendError> {
        check(scene)?;
        Ok(Self { backend, scene, options, under_way: VecDeque::new() })
    }

    /// Begins frame `number`; hands out an earlier one, or this one, with its number, if the backend takes no more.
    ///
    /// # Errors
    /// The backend cannot render the frame within its limits.
    pub fn begin(&mut self, number: i64) -> Result<Option<(i64, Rendered)>, BackendError> {
        let Quality::Mode(mode) = self.options.quality else { return self.whole(number) };
        if self.options.reconstruct {
            return self.whole(number);
        }
        self.backend.begin(Frame::new(self.scene, number, mode, self.options))?;
        self.under_way.push_back(number);
        if self.under_way.len() < self.backend.in_flight() {
            return Ok(None);
        }
        self.finish()
    }

    /// Renders frame `number`, whose steps wait for those before.
    fn whole(&mut self, number: i64) -> Result<Option<(i64, Rendered)>, BackendError> {
        Ok(Some((number, render_frame(self.backend, self.scene, number, self.options)?)))
    }

    /// Hands out the next frame, in the order in which they were begun; `None` after the last.
    ///
    /// # Errors
    /// The backend cannot render the frame within its limits.
    pub fn finish(&mut self) -> Result<Option<(i64, Rendered)>, BackendError> {
        let Some(number) = self.under_way.pop_front() else { return Ok(None) };
        Ok(self.backend.finish()?.map(|rendered| (number, rendered)))
    }
}
