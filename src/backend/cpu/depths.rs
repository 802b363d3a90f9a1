//! How far behind the nearest surface a kernel still belongs to it (docs/math.md, section 4).

/// Smallest depth tolerance, as a share of the depth: 4 units in the last place.
pub(in crate::backend) const LEAST_EPSILON: f32 = 4.0 * f32::EPSILON;

/// What of the camera the pass needs, and the depth tolerance of the splats' object.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct Depths {
    pub near: f32,
    pub epsilon: f32,
}

impl Depths {
    /// The tolerance of a splat at `depth`.
    #[inline(always)]
    pub(in crate::backend) fn tolerance(self, depth: f32) -> f32 {
        let least = LEAST_EPSILON * depth;
        if self.epsilon > least { self.epsilon } else { least }
    }

    /// The depth up to which a splat at `depth` shows, where T is `first` and the depth of the nearest disc `nearest`
    /// (docs/math.md, eq. 5).
    #[inline(always)]
    pub(in crate::backend) fn limit(self, depth: f32, first: f32, nearest: f32) -> f32 {
        let own = nearest + self.tolerance(depth);
        if own < first { own } else { first }
    }
}
