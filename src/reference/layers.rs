//! Layers of see-through surfels on a ray (Zwicker et al. 2002, section 7.2; docs/math.md, section 12).
//!
//! The limit of a layer is the least depth + epsilon of the hits that no nearer layer has. Those up to it are the
//! layer, and are blended as an opaque surface is. Layers are composited front to back.

use super::trace::{Seen, Tracer};
use super::traverse::{LEAST_EPSILON, MOST_LAYERS};

/// A layer of see-through surfels.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayLayer {
    /// The surface by itself, as if it were opaque.
    pub seen: Seen,
    /// Mean opacity, in [0, 1].
    pub opacity: f64,
    /// The greatest depth that belongs to it.
    pub limit: f64,
}

/// What a group of rays sees of surfaces.
#[derive(Clone, Debug, Default)]
pub(super) struct Surfaces {
    /// For each ray its limit T of opaque surfaces (docs/math.md, eq. 5); infinite where there are none.
    pub limits: Vec<f64>,
    /// For each ray what it sees of opaque surfaces.
    pub opaque: Vec<Option<Seen>>,
    layers: Vec<RayLayer>,
    /// For each ray the end of its layers.
    ends: Vec<usize>,
    /// Rays with more layers than are taken, since it was last reset.
    pub cut: u64,
}

impl Surfaces {
    /// Forgets all rays.
    pub(super) fn clear(&mut self) {
        self.limits.clear();
        self.opaque.clear();
        self.layers.clear();
        self.ends.clear();
    }

    /// Layers of a ray, nearest first.
    pub(super) fn layers(&self, ray: usize) -> &[RayLayer] {
        let first = if ray == 0 { 0 } else { self.ends[ray - 1] };
        &self.layers[first..self.ends[ray]]
    }

    /// Adds the ray of a lane, of which `tracer` has the hits.
    pub(super) fn add(&mut self, tracer: &mut Tracer<'_, '_>, lane: usize) {
        self.limits.push(tracer.found[lane].limit);
        let opaque = tracer.seen(lane);
        self.opaque.push(opaque);
        let mut hits = std::mem::take(&mut tracer.found[lane].see_through);
        hits.sort_unstable_by(|a, b| a.depth.total_cmp(&b.depth));
        let mut rest = &mut *hits;
        for _ in 0..MOST_LAYERS {
            if rest.is_empty() {
                break;
            }
            let limit = rest.iter().fold(f64::INFINITY, |least, hit| {
                let epsilon = tracer.target(lane, hit).map_or(0.0, |target| target.pose.epsilon);
                least.min(hit.depth + epsilon.max(LEAST_EPSILON * hit.depth))
            });
            let (layer, behind) = rest.split_at_mut(rest.partition_point(|hit| hit.depth <= limit));
            rest = behind;
            let Some(seen) = tracer.surface(lane, layer) else { break };
            self.layers.push(RayLayer { seen, opacity: tracer.opacity(layer), limit });
        }
        self.cut += u64::from(!rest.is_empty());
        self.ends.push(self.layers.len());
        tracer.found[lane].see_through = hits;
    }
}
