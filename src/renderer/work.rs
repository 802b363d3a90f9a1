//! A frame under way: what is left to do for it, on a backend that may have other frames under way.

use std::borrow::Cow;

use super::{as_fine, check, finite, of_backend, posed, reconstructed, with_detail, with_velocity};
use crate::auto::AutoFrame;
use crate::backend::{Backend, BackendError, Rendered};
use crate::options::{Quality, RenderOptions};
use crate::scene::{BlockErrors, Cut, Scene};
use crate::time::FrameNumber;

/// A frame without the layer `object` that was begun.
///
/// It goes in legs: a leg is one rendering of a blur mode, and a pair of mode auto. One leg of a frame is under way
/// until the frame is [done](Self::is_done). Each is [landed](Self::land) once, in the order in which the backend has
/// begun them.
pub(super) struct FrameWork<'a> {
    kind: Kind<'a>,
    /// Estimated error by what its surfels leave out.
    errors: BlockErrors,
    /// What was asked for.
    options: &'a RenderOptions,
}

enum Kind<'a> {
    /// A blur mode; `None`: it is under way.
    Mode(Option<Box<Rendered>>),
    Auto(Box<AutoFrame<'a>>),
}

impl<'a> FrameWork<'a> {
    /// Begins a frame and its first leg.
    ///
    /// # Errors
    /// The number is not finite, the scene holds what cannot be rendered, or the backend cannot begin.
    pub(super) fn begin(
        backend: &mut dyn Backend,
        scene: &'a Scene,
        number: FrameNumber,
        options: &'a RenderOptions,
    ) -> Result<Self, BackendError> {
        let scene = scene.at_frame(finite(number)?.get())?;
        check(&scene, options)?;
        let Cut { scene, errors } = match scene {
            Cow::Borrowed(scene) => as_fine(scene, number, options),
            Cow::Owned(scene) => as_fine(&scene, number, options).into_owned(),
        };
        let mut of_backend = of_backend(options);
        if options.reconstruct {
            of_backend = Cow::Owned(with_velocity(&of_backend));
        }
        let kind = match options.quality {
            Quality::Mode(mode) => {
                let frame = posed(backend, &scene, number, mode, &of_backend)?;
                backend.begin(frame)?;
                Kind::Mode(None)
            }
            Quality::Error(target) => {
                let mut frame = Box::new(AutoFrame::new(scene, number, of_backend, target));
                frame.begin(backend)?;
                Kind::Auto(frame)
            }
        };
        Ok(Self { kind, errors, options })
    }

    /// Renderings of a leg.
    pub(super) const fn renderings(&self) -> usize {
        match self.kind {
            Kind::Mode(_) => 1,
            Kind::Auto(_) => AutoFrame::RENDERINGS,
        }
    }

    /// Waits for the leg that is under way, and begins the next one. Returns whether there is one.
    ///
    /// # Errors
    /// The backend cannot render the frame within its limits, the device failed, or it was stopped.
    pub(super) fn land(&mut self, backend: &mut dyn Backend) -> Result<bool, BackendError> {
        match &mut self.kind {
            Kind::Mode(rendered) => {
                *rendered = backend.finish()?.map(Box::new);
                Ok(false)
            }
            Kind::Auto(frame) => {
                frame.land(backend)?;
                frame.begin(backend)
            }
        }
    }

    /// Is nothing left to wait for?
    pub(super) fn is_done(&self) -> bool {
        match &self.kind {
            Kind::Mode(rendered) => rendered.is_some(),
            Kind::Auto(frame) => frame.is_done(),
        }
    }

    /// What was asked for; `None` where it is not done.
    pub(super) fn finish(self, backend: &mut dyn Backend) -> Option<Rendered> {
        let rendered = match self.kind {
            Kind::Mode(rendered) => rendered.map(|rendered| *rendered),
            Kind::Auto(frame) => frame.finish(backend),
        };
        let rendered = with_detail(rendered?, &self.errors, self.options);
        Some(if self.options.reconstruct { reconstructed(rendered, self.options) } else { rendered })
    }
}
