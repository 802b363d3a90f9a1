//! A movie of the scene's frames as a page sees them. It is made frame by frame while nothing else is to be done.

use std::path::PathBuf;
use std::sync::Arc;

use super::super::save;
use super::super::shared::{Known, Shared};
use super::super::view::{PageLook, PageView};
use super::studio::{Ended, Studio};
use crate::image::Bits;
use crate::movie::{Movie, MovieError, MovieKind, MovieShape, Rate};
use crate::options::Quality;
use crate::renderer::Device;
use crate::time::FrameNumber;

/// A movie under way: the scene and the view are those of its begin.
pub(super) struct Filming {
    known: Arc<Known>,
    look: PageLook,
    quality: Quality,
    out: PathBuf,
    kind: MovieKind,
    movie: Movie,
    next: i64,
}

impl From<MovieError> for Ended {
    fn from(error: MovieError) -> Self {
        Self::Failed(chain(&error))
    }
}

/// An error and what is behind it, in one line.
fn chain(error: &dyn std::error::Error) -> String {
    let sources = std::iter::successors(Some(error), |error| error.source());
    sources.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

impl Filming {
    /// Begins a movie of what `view` shows; the error is one line.
    pub(super) fn begin(shared: &Shared, known: &Arc<Known>, view: &PageView, kind: MovieKind) -> Result<Self, String> {
        if view.look.buffer.is_some() {
            return Err("a movie holds colour only: take the buffer colour".to_owned());
        }
        let scene = known.scene();
        let out = save::folder(shared, scene)?;
        let [width, height] = view.look.size;
        let shape = MovieShape { width, height, rate: Rate::of(scene.frames.rate), bits: Bits::Sixteen };
        // The name is found at the end; the disk is that of its folder.
        let movie = Movie::begin(&out.join(&scene.name), kind, shape).map_err(|why| chain(&why))?;
        let (look, quality, next) = (view.look.clone(), view.quality, view.look.frames(scene).first);
        Ok(Self { known: Arc::clone(known), look, quality, out, kind, movie, next })
    }

    /// Frames that are there, and all.
    pub(super) fn progress(&self) -> (u64, u64) {
        let frames = self.look.frames(self.known.scene());
        (self.next.abs_diff(frames.first), frames.last.abs_diff(frames.first) + 1)
    }

    pub(super) fn is_done(&self) -> bool {
        let (done, all) = self.progress();
        done >= all
    }

    /// What renders it.
    pub(super) const fn device(&self) -> &Device {
        &self.look.device
    }

    /// Renders the next frame on the open device. Where it is stopped the frame is to be rendered again.
    pub(super) fn step(&mut self, studio: &mut Studio<'_>) -> Result<(), Ended> {
        self.look.frame = FrameNumber::from(self.next);
        let scene = self.look.scene(&self.known, self.look.size);
        let options = self.look.options(self.quality, studio.memory());
        let (rendered, _) = studio.render(&scene, &self.look, &options)?;
        let display = self.known.loaded.display();
        let picture = display.shown(rendered.picture, Bits::Eight, scene.image.transparent);
        self.movie.push(&picture)?;
        studio.recycle(picture);
        self.next += 1;
        Ok(())
    }

    /// Ends the movie, and gives its file a name that nothing has.
    pub(super) fn finish(self, shared: &Shared) -> Result<PathBuf, String> {
        let Self { known, out, kind, movie, .. } = self;
        let mut file = movie.finish().map_err(|why| chain(&why))?;
        let paths = save::paths(&out, &known.scene().name, kind.extension());
        save::told(&out, shared, || file.create(paths))
    }
}
