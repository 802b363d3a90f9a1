//! Rays against a model: boxes in f32, padded so that nothing is missed; surfels in f64.
//!
//! A ray's direction is scaled so that its parameter is camera depth. Transforms are affine, so this holds in model space too:
//! depths from different objects compare without any conversion.
//!
//! Up to eight rays go together. Nodes are entered by the beam of all of them: the intervals of what the rays' box tests would
//! compute. Before a leaf each ray is tested by itself.

use glam::DVec3;

#[cfg(target_arch = "x86_64")]
use super::boxes::avx;
use super::boxes::{Beam, BoxRays, PACKET, above, below, enter_beam, enter_rays};
use super::bvh::{Bvh, LANES, LEAF, Leaf, Node, WIDTH};

/// Smallest depth tolerance, as a share of the depth: 4 units in the last place of f32, as for the splatter (design section 2).
pub(super) const LEAST_EPSILON: f64 = 4.0 * f32::EPSILON as f64;

/// A ray in model space, relative to the model's origin: points are `origin` + depth `direction`.
#[derive(Clone, Copy, Debug)]
pub(super) struct ModelRay {
    pub origin: DVec3,
    pub direction: DVec3,
    /// Nearest visible depth.
    pub near: f64,
    /// Depth tolerance of the object, world units.
    pub epsilon: f64,
    pub two_sided: bool,
    /// Number of the object, copied to its hits.
    pub object: u32,
    /// Which of the samples that go together it belongs to.
    pub lane: usize,
}

/// A surfel under a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub object: u32,
    pub surfel: u32,
    /// Camera depth of the surfel's plane on the ray.
    pub depth: f64,
    /// Position on the surfel in units of its axes.
    pub u: f64,
    pub v: f64,
    /// Seen from behind.
    pub back: bool,
}

/// What a sample has hit; kept so that no memory is taken per ray.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// Surfels hit so far; those beyond the final limit are still among them.
    pub hits: Vec<Hit>,
    /// T of the visibility rule so far: the least depth + epsilon.
    pub limit: f64,
}

impl Found {
    /// Before the first object.
    pub(super) fn clear(&mut self) {
        self.hits.clear();
        self.limit = f64::INFINITY;
    }
}

/// Adds the surfels that `rays`, at most [`PACKET`], hit at depths up to the limits of their lanes, and lowers the limits.
///
/// Compiled for the baseline and for AVX2, where the boxes are tested with intrinsics (compilers make shuffles of it). Boxes only
/// decide what is looked at, and the intersection's operations are the same: so are the hits, to the bit.
pub(super) fn traverse(bvh: &Bvh, rays: &[ModelRay], found: &mut [Found], stack: &mut Vec<Waiting>) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2(bvh: &Bvh, rays: &[ModelRay], found: &mut [Found], stack: &mut Vec<Waiting>) {
            let beam = |node: &Node, beam: &Beam| avx::enter_beam(node, beam);
            traverse_body(bvh, rays, found, stack, beam, |node, slot, rays| avx::enter_rays(node, slot, rays));
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            #[allow(unsafe_code, reason = "AVX2 was detected on the line before")]
            // SAFETY: the CPU has the only feature that the function enables.
            return unsafe { avx2(bvh, rays, found, stack) };
        }
    }
    traverse_body(bvh, rays, found, stack, enter_beam, enter_rays);
}

/// A child that is still to be visited.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    node: u32,
    slot: u32,
    /// Parameter before which no ray enters it.
    entry: f32,
}

#[inline(always)]
fn traverse_body(
    bvh: &Bvh,
    rays: &[ModelRay],
    found: &mut [Found],
    stack: &mut Vec<Waiting>,
    enter_beam: impl Fn(&Node, &Beam) -> ([f32; WIDTH], u32),
    enter_rays: impl Fn(&Node, usize, &BoxRays) -> u32,
) {
    if bvh.nodes.is_empty() {
        return;
    }
    let mut starts = [0.0; PACKET];
    let Some((mut boxes, mut beam)) = approach(bvh, rays, found, &mut starts) else { return };
    stack.clear();
    let mut at = Waiting { node: 0, slot: 0, entry: 0.0 };
    let mut number = 0;
    loop {
        if number & LEAF == 0 {
            let node = &bvh.nodes[number as usize];
            let (entries, mut mask) = enter_beam(node, &beam);
            if mask != 0 {
                // The nearest child is next; the others wait in any order.
                let mut nearest = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                while mask != 0 {
                    let slot = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    let later = if entries[slot] < entries[nearest] { nearest } else { slot };
                    nearest = nearest + slot - later;
                    stack.push(Waiting { node: number, slot: later as u32, entry: entries[later] });
                }
                at = Waiting { node: number, slot: nearest as u32, entry: entries[nearest] };
                number = node.children[nearest];
                continue;
            }
        } else {
            let lanes = enter_rays(&bvh.nodes[at.node as usize], at.slot as usize, &boxes);
            if lanes != 0 && leaf(&bvh.leaves[(number & !LEAF) as usize], rays, lanes, found, &mut boxes, &starts) {
                beam.limit = boxes.limit.into_iter().fold(f32::NEG_INFINITY, |a, b| if a > b { a } else { b });
            }
        }
        // What lies beyond the limit by now is passed over.
        loop {
            let Some(waiting) = stack.pop() else { return };
            if waiting.entry <= beam.limit {
                number = bvh.nodes[waiting.node as usize].children[waiting.slot as usize];
                at = waiting;
                break;
            }
        }
    }
}

/// The rays from the model's sphere on; `None` if all miss it.
#[inline(always)]
fn approach(bvh: &Bvh, rays: &[ModelRay], found: &[Found], starts: &mut [f64; PACKET]) -> Option<(BoxRays, Beam)> {
    // What misses the sphere enters nothing.
    let mut boxes = BoxRays {
        origin: [[0.0; PACKET]; 3],
        inverse: [[0.0; PACKET]; 3],
        near: [f32::INFINITY; PACKET],
        limit: [f32::NEG_INFINITY; PACKET],
    };
    let nothing = [f32::INFINITY, f32::NEG_INFINITY];
    let (mut origins, mut inverses) = ([nothing; 3], [nothing; 3]);
    let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    let (mut near, mut limit) = (f32::INFINITY, f32::NEG_INFINITY);
    for (l, ray) in rays.iter().enumerate() {
        let d2 = ray.direction.length_squared();
        let from = ray.origin - bvh.centre;
        let middle = -from.dot(ray.direction) / d2;
        let closest = from + ray.direction * middle;
        let half2 = (bvh.radius * bvh.radius - closest.length_squared()) / d2;
        // Also false for a direction that is 0 or not finite.
        if !(0.0..f64::INFINITY).contains(&half2) {
            continue;
        }
        let half = half2.sqrt();
        let start = middle - half;
        let most = found[ray.lane].limit;
        if middle + half < ray.near || start > most {
            continue;
        }
        let origin = ray.origin + ray.direction * start;
        let end = ray.origin + ray.direction * (middle + half);
        // A component near 0 is replaced by one that moves the ray by less than the padding.
        let least = 1e-9 * d2.sqrt();
        for axis in 0..3 {
            let d = ray.direction[axis];
            let d = if d.abs() < least { least.copysign(d) } else { d };
            let o = origin[axis] as f32;
            let inverse = ((1.0 / d) as f32).clamp(f32::MIN, f32::MAX);
            boxes.origin[axis][l] = o;
            boxes.inverse[axis][l] = inverse;
            origins[axis] = [origins[axis][0].min(o), origins[axis][1].max(o)];
            inverses[axis] = [inverses[axis][0].min(inverse), inverses[axis][1].max(inverse)];
            ends[axis] =
                [ends[axis][0].min(origin[axis]).min(end[axis]), ends[axis][1].max(origin[axis]).max(end[axis])];
        }
        starts[l] = start;
        boxes.near[l] = below(ray.near - start);
        boxes.limit[l] = above(most - start);
        near = near.min(boxes.near[l]);
        limit = limit.max(boxes.limit[l]);
    }
    if limit == f32::NEG_INFINITY {
        return None;
    }
    let mut beam = Beam { first: [0; 3], early: [0.0; 3], late: [0.0; 3], inverse: inverses, near, limit };
    for axis in 0..3 {
        let [low, high] = inverses[axis];
        if low > 0.0 {
            [beam.late[axis], beam.early[axis]] = origins[axis];
        } else if high < 0.0 {
            beam.first[axis] = 1;
            [beam.early[axis], beam.late[axis]] = origins[axis];
        } else {
            // Rays that go both ways: inside the sphere they are between these planes, and boxes beside them are entered nowhere.
            (beam.late[axis], beam.early[axis]) = (below(ends[axis][0]), above(ends[axis][1]));
            beam.inverse[axis] = [f32::INFINITY; 2];
        }
    }
    Some((boxes, beam))
}

/// Intersects the rays `lanes` (bit mask) with the surfels of a leaf; true if a limit fell.
#[inline(always)]
fn leaf(
    leaf: &Leaf,
    rays: &[ModelRay],
    mut lanes: u32,
    found: &mut [Found],
    boxes: &mut BoxRays,
    starts: &[f64; PACKET],
) -> bool {
    let mut fell = false;
    while lanes != 0 {
        let l = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let ray = &rays[l];
        let found = &mut found[ray.lane];
        if intersect(leaf, ray, found) {
            boxes.limit[l] = above(found.limit - starts[l]);
            fell = true;
        }
    }
    fell
}

/// Intersects the surfels of a leaf; true if the limit fell.
///
/// The ray meets c + a u + b v where s d - a u - b v = c - o. By Cramer's rule, with n = u x v and w = (c - o) x d:
/// s = n.(c - o) / n.d, a = v.w / n.d and b = -u.w / n.d, also where u and v are not orthogonal.
#[inline(always)]
fn intersect(leaf: &Leaf, ray: &ModelRay, found: &mut Found) -> bool {
    let before = found.limit;
    let ([ox, oy, oz], [dx, dy, dz]) = (ray.origin.to_array(), ray.direction.to_array());
    let (near, limit) = (ray.near, found.limit);
    let mut facing = [0.0; LANES];
    let mut depth = [0.0; LANES];
    let mut a = [0.0; LANES];
    let mut b = [0.0; LANES];
    let mut bits = [0_u64; LANES];
    // One lane's scalars from beginning to end: that is what becomes vector code without shuffles.
    for l in 0..LANES {
        let at = |v: &[[f32; LANES]; 3]| (f64::from(v[0][l]), f64::from(v[1][l]), f64::from(v[2][l]));
        let ((cx, cy, cz), (ux, uy, uz), (vx, vy, vz)) = (at(&leaf.centre), at(&leaf.u), at(&leaf.v));
        let (cx, cy, cz) = (cx - ox, cy - oy, cz - oz);
        let (nx, ny, nz) = (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
        let (wx, wy, wz) = (cy * dz - cz * dy, cz * dx - cx * dz, cx * dy - cy * dx);
        let nd = nx * dx + ny * dy + nz * dz;
        let over = 1.0 / nd;
        let s = (nx * cx + ny * cy + nz * cz) * over;
        let pv = (vx * wx + vy * wy + vz * wz) * over;
        let up = (ux * wx + uy * wy + uz * wz) * -over;
        // Edge-on, missing and overflowing surfels have NaN or infinite coordinates.
        let inside = pv * pv + up * up <= 1.0;
        let within = (s >= near) & (s <= limit) & ((nd < 0.0) | ray.two_sided);
        facing[l] = nd;
        depth[l] = s;
        a[l] = pv;
        b[l] = up;
        bits[l] = if inside & within { 1 << l } else { 0 };
    }
    let mut mask = bits.iter().fold(0, |mask, bit| mask | bit);
    while mask != 0 {
        let l = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        let (u, v, back) = (a[l], b[l], facing[l] > 0.0);
        found.hits.push(Hit { object: ray.object, surfel: leaf.surfel[l], depth: depth[l], u, v, back });
        found.limit = found.limit.min(depth[l] + ray.epsilon.max(LEAST_EPSILON * depth[l]));
    }
    found.limit < before
}
