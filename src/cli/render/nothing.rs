//! Says so where no frame shows anything of a scene that has objects, with the likely causes.

use splatblur::renderer::Rendered;
use splatblur::scene::{Scene, Unseen, why_unseen};
use splatblur::time::FrameNumber;

/// Most names of objects for one cause.
const NAMES: usize = 3;

/// What was seen of a scene so far.
pub(super) struct Nothing<'a> {
    scene: &'a Scene,
    /// The first frame that shows nothing, and whether splats were drawn in it.
    first: Option<(FrameNumber, bool)>,
    has_shown: bool,
}

impl<'a> Nothing<'a> {
    pub(super) fn new(scene: &'a Scene) -> Self {
        Self { scene, first: None, has_shown: false }
    }

    /// Looks at a frame.
    pub(super) fn look(&mut self, number: FrameNumber, rendered: &Rendered) {
        if self.has_shown {
            return;
        }
        let image = &self.scene.image;
        let background = if image.transparent { [0.0; 4] } else { image.background.as_vec3().extend(1.0).to_array() };
        let is_background = |pixel: &[f32; 4]| {
            pixel.iter().zip(background).all(|(value, of)| (value - of).abs() <= 1e-5 * of.abs().max(1.0))
        };
        let drawn = rendered.stats.splats > 0;
        if drawn && !rendered.picture.rgba.iter().all(is_background) {
            self.has_shown = true;
        } else if self.first.is_none() {
            self.first = Some((number, drawn));
        }
    }

    /// What to say at the end.
    pub(super) fn warning(&self) -> Option<String> {
        let (frame, drawn) = self.first.filter(|_| !self.has_shown && !self.scene.objects.is_empty())?;
        let mut causes: Vec<(Unseen, Vec<&str>)> = Vec::new();
        for object in &self.scene.objects {
            let cause = why_unseen(self.scene, object, frame, drawn);
            match causes.iter_mut().find(|(known, _)| *known == cause) {
                Some((_, names)) => names.push(&object.name),
                None => causes.push((cause, vec![&object.name])),
            }
        }
        let one = |(cause, names): &(Unseen, Vec<&str>)| {
            let shown = names.iter().take(NAMES).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
            let more = names.len().saturating_sub(NAMES);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            format!("{cause}: {shown}{more}")
        };
        let causes = causes.iter().map(one).collect::<Vec<_>>().join("; ");
        Some(format!("no frame shows anything; likely causes in frame {frame}: {causes}"))
    }
}
