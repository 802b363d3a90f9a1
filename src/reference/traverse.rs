//! Finds the surfels or triangles of a model that rays hit, or an ideal sphere. Boxes are tested in f32, padded so
//! that nothing is missed; what they hold is tested in f64.
//!
//! A ray's direction is scaled so that its parameter is camera depth. Transforms are affine, so this holds in model
//! space too: depths from different objects compare without any conversion.
//!
//! A packet of up to eight rays goes together. A beam that holds all rays enters the nodes: its intervals bound what
//! the rays' box tests would compute. Before a leaf each ray is tested by itself.

use glam::DVec3;

#[cfg(target_arch = "x86_64")]
use super::boxes::avx;
use super::boxes::{Beam, BoxRays, PACKET, above, below, corners, enter_beam, enter_rays, moved, moved_corners};
use super::bvh::{Bvh, LANES, LEAF, Leaf, Rates, Sides, WIDTH};
use crate::model::mesh::MeshSurface;
use crate::model::paths::Elapsed;
use crate::scene::Sphere;

/// Smallest depth tolerance as a share of the depth: 4 units in the last place of f32, as in the splatter
/// (docs/math.md, eq. 5).
pub(super) const LEAST_EPSILON: f64 = 4.0 * f32::EPSILON as f64;

/// Most layers of see-through surfels of a ray. Farther ones are left out.
pub(super) const MOST_LAYERS: usize = 8;

/// A ray in model space relative to the model's origin. Its points are `origin` + depth `direction`.
#[derive(Clone, Copy, Debug)]
pub(super) struct ModelRay {
    pub origin: DVec3,
    pub direction: DVec3,
    /// Nearest visible depth.
    pub near: f64,
    /// Depth tolerance of the object, world units; infinite for an object that hides nothing.
    pub epsilon: f64,
    pub two_sided: bool,
    /// Number of the object, which its hits get.
    pub object: u32,
    /// Lane of the sample that it belongs to.
    pub lane: usize,
    /// Factors on the columns of the paths of surfels that move by themselves.
    pub elapsed: Elapsed<f64>,
}

/// How far a triangle reaches beyond its edges, in weights of its corners, so that edges in f32 leave no gaps between.
const BEYOND: f64 = 1e-6;

/// Number in the hits of an ideal sphere.
pub(super) const SPHERE: u32 = u32::MAX;

/// A surfel or a triangle that a ray hits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub object: u32,
    /// Number of the surfel, or of the triangle in the mesh.
    pub element: u32,
    /// Camera depth of its plane on the ray.
    pub depth: f64,
    /// Position on the surfel in units of its axes, or weights of the triangle's second and third corner.
    pub u: f64,
    pub v: f64,
    /// True if it is seen from behind.
    pub back: bool,
    /// True if all of it weighs the same: it is no surfel.
    pub is_even: bool,
}

/// The hits of a sample. It is reused, so that rays allocate no memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// Surfels hit so far. Those beyond the final limit are still among them.
    pub hits: Vec<Hit>,
    /// See-through surfels hit at depths up to the limit of all opaque ones.
    pub see_through: Vec<Hit>,
    /// T of the visibility rule so far (docs/math.md, eq. 5): the least depth + epsilon.
    pub limit: f64,
    /// Depth of the nearest opaque hit, once all are found; infinite without one.
    pub nearest: f64,
}

impl Found {
    /// Returns to the state before the first object.
    pub(super) fn clear(&mut self) {
        self.hits.clear();
        self.see_through.clear();
        self.limit = f64::INFINITY;
        self.nearest = f64::INFINITY;
    }
}

/// Adds the surfels that `rays`, at most [`PACKET`], hit at depths up to the limits of their lanes, and lowers the
/// limits. Only rays whose times (factor 0 of `elapsed`) lie in `times` are followed, the end left out.
///
/// The function is compiled for the baseline and for AVX2. The AVX2 version tests boxes with intrinsics, because
/// compilers turn the plain code into shuffles. Boxes only decide which surfels are looked at, and the operations of
/// the intersection are the same, so both versions give the same hits to the bit.
pub(super) fn traverse(bvh: &Bvh, rays: &[ModelRay], times: [f64; 2], found: &mut [Found], stack: &mut Vec<Waiting>) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2(bvh: &Bvh, rays: &[ModelRay], times: [f64; 2], found: &mut [Found], stack: &mut Vec<Waiting>) {
            let beam = |sides: &Sides, beam: &Beam| avx::enter_beam(sides, beam);
            let rays_enter = |corners: [[f32; 3]; 2], rays: &BoxRays| avx::enter_rays(corners, rays);
            if bvh.drifts.is_empty() {
                traverse_body::<false>(bvh, (rays, times), found, stack, beam, rays_enter);
            } else {
                traverse_body::<true>(bvh, (rays, times), found, stack, beam, rays_enter);
            }
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            #[allow(unsafe_code, reason = "AVX2 was detected on the line before")]
            // SAFETY: the CPU has the only feature that the function enables.
            return unsafe { avx2(bvh, rays, times, found, stack) };
        }
    }
    plain(bvh, rays, times, found, stack);
}

/// [`traverse`] for the baseline.
pub(super) fn plain(bvh: &Bvh, rays: &[ModelRay], times: [f64; 2], found: &mut [Found], stack: &mut Vec<Waiting>) {
    if bvh.drifts.is_empty() {
        traverse_body::<false>(bvh, (rays, times), found, stack, enter_beam, enter_rays);
    } else {
        traverse_body::<true>(bvh, (rays, times), found, stack, enter_beam, enter_rays);
    }
}

/// Intersects the ideal sphere about the model's origin. A hit has the kernel's peak as weight. The sphere is seen from
/// outside and, if it is two-sided, also from inside.
pub(super) fn intersect_sphere(sphere: &Sphere, ray: &ModelRay, found: &mut Found) {
    let d2 = ray.direction.length_squared();
    let middle = -ray.origin.dot(ray.direction) / d2;
    let closest = ray.origin + ray.direction * middle;
    let half2 = (sphere.radius * sphere.radius - closest.length_squared()) / d2;
    if !(0.0..f64::INFINITY).contains(&half2) {
        return;
    }
    let half = half2.sqrt();
    for (depth, back) in [(middle - half, false), (middle + half, true)] {
        if depth >= ray.near && depth <= found.limit && (!back || ray.two_sided) {
            found.hits.push(Hit { object: ray.object, element: SPHERE, depth, u: 0.0, v: 0.0, back, is_even: true });
            found.limit = found.limit.min(depth + ray.epsilon.max(LEAST_EPSILON * depth));
        }
    }
}

/// A child that still has to be visited.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    node: u32,
    slot: u32,
    /// Parameter before which no ray enters it.
    entry: f32,
}

#[inline(always)]
fn traverse_body<const MOVING: bool>(
    bvh: &Bvh,
    (rays, times): (&[ModelRay], [f64; 2]),
    found: &mut [Found],
    stack: &mut Vec<Waiting>,
    enter_beam: impl Fn(&Sides, &Beam) -> ([f32; WIDTH], u32),
    enter_rays: impl Fn([[f32; 3]; 2], &BoxRays) -> u32,
) {
    if bvh.nodes.is_empty() {
        return;
    }
    let mut starts = [0.0; PACKET];
    let Some((mut boxes, mut beam, shares)) = approach::<MOVING>(bvh, (rays, times), found, &mut starts) else {
        return;
    };
    stack.clear();
    let mut at = Waiting { node: 0, slot: 0, entry: 0.0 };
    let mut number = 0;
    loop {
        if number & LEAF == 0 {
            let node = &bvh.nodes[number as usize];
            let (entries, mut mask) = if MOVING {
                enter_beam(&moved(&node.sides, &bvh.drifts[number as usize], shares), &beam)
            } else {
                enter_beam(&node.sides, &beam)
            };
            if mask != 0 {
                // The nearest child is next; the others wait on the stack in any order.
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
            let (sides, slot) = (&bvh.nodes[at.node as usize].sides, at.slot as usize);
            let corners = if MOVING {
                moved_corners(sides, &bvh.drifts[at.node as usize], slot, shares)
            } else {
                corners(sides, slot)
            };
            let lanes = enter_rays(corners, &boxes);
            let number = (number & !LEAF) as usize;
            let elements = (&bvh.leaves[number], bvh.rates.get(number), bvh.surface.as_ref(), bvh.spheres);
            if lanes != 0 && leaf(elements, rays, lanes, found, &mut boxes, &starts) {
                beam.limit = boxes.limit.into_iter().fold(f32::NEG_INFINITY, |a, b| if a > b { a } else { b });
            }
        }
        // Children beyond the limit, which may have fallen since, are skipped.
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

/// Moves the rays to the model's sphere, and bounds them by a beam and by two shares of the span of moving boxes.
/// `None` if all miss the sphere.
#[inline(always)]
fn approach<const MOVING: bool>(
    bvh: &Bvh,
    (rays, times): (&[ModelRay], [f64; 2]),
    found: &[Found],
    starts: &mut [f64; PACKET],
) -> Option<(BoxRays, Beam, [f32; 2])> {
    let length = bvh.span[1] - bvh.span[0];
    let per_time = if length > 0.0 { 1.0 / length } else { 0.0 };
    let mut shares = [1.0_f32, 0.0];
    // A ray that misses the sphere enters no box.
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
        if MOVING && !(times[0]..times[1]).contains(&ray.elapsed[0]) {
            continue;
        }
        let d2 = ray.direction.length_squared();
        let from = ray.origin - bvh.centre;
        let middle = -from.dot(ray.direction) / d2;
        let closest = from + ray.direction * middle;
        let half2 = (bvh.radius * bvh.radius - closest.length_squared()) / d2;
        // The test also fails for a direction that is 0 or not finite.
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
        if MOVING {
            // A time beyond the span is so by rounding alone.
            let share = ((ray.elapsed[0] - bvh.span[0]) * per_time).clamp(0.0, 1.0) as f32;
            shares = [shares[0].min(share), shares[1].max(share)];
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
            // The rays go both ways along this axis. Inside the sphere they lie between these planes, so no ray enters
            // a box beside them.
            (beam.late[axis], beam.early[axis]) = (below(ends[axis][0]), above(ends[axis][1]));
            beam.inverse[axis] = [f32::INFINITY; 2];
        }
    }
    Some((boxes, beam, shares))
}

/// Intersects the rays `lanes` (bit mask) with the elements of a leaf. Returns true if a limit fell.
#[inline(always)]
fn leaf(
    (leaf, rates, surface, spheres): (&Leaf, Option<&Rates>, Option<&MeshSurface<'_>>, bool),
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
        // Each sum in the same order and without `map`, which compilers call where they inline this.
        let [first, second, third] = ray.elapsed;
        let along = |columns: &[[[f32; LANES]; 3]; 3], axis: usize, l: usize| {
            let rate = |column: usize| f64::from(columns[column][axis][l]);
            rate(0) * first + rate(1) * second + rate(2) * third
        };
        let shift = |l: usize| match rates {
            Some(Rates(columns)) => [along(columns, 0, l), along(columns, 1, l), along(columns, 2, l)],
            None => [0.0; 3],
        };
        let fell_now = match (surface, rates) {
            _ if spheres => intersect_spheres(leaf, ray, found, shift),
            (Some(surface), _) => intersect::<true>(
                leaf,
                ray,
                found,
                |_| [0.0; 3],
                |triangle, weight| !surface.is_cut_out(triangle, weight),
            ),
            (None, None) => intersect::<false>(leaf, ray, found, |_| [0.0; 3], |_, _| true),
            (None, Some(_)) => intersect::<false>(leaf, ray, found, shift, |_, _| true),
        };
        if fell_now {
            boxes.limit[l] = above(found.limit - starts[l]);
            fell = true;
        }
    }
    fell
}

/// Intersects a ray with the spheres of a leaf, each shifted, where it enters them: nobody sees one from inside.
/// Returns true if the limit fell.
fn intersect_spheres(leaf: &Leaf, ray: &ModelRay, found: &mut Found, shift: impl Fn(usize) -> [f64; 3]) -> bool {
    let before = found.limit;
    let d2 = ray.direction.length_squared();
    for l in 0..LANES {
        let at = |v: &[[f32; LANES]; 3]| DVec3::new(v[0][l].into(), v[1][l].into(), v[2][l].into());
        let centre = at(&leaf.centre) + DVec3::from(shift(l)) - ray.origin;
        let middle = centre.dot(ray.direction) / d2;
        let beside2 = (ray.direction * middle - centre).length_squared();
        // Not a number where there is none.
        let half2 = (at(&leaf.u).length_squared() - beside2) / d2;
        let depth = middle - half2.sqrt();
        if depth >= ray.near && depth <= found.limit {
            let (object, element) = (ray.object, leaf.element[l]);
            found.hits.push(Hit { object, element, depth, u: 0.0, v: 0.0, back: false, is_even: true });
            found.limit = found.limit.min(depth + ray.epsilon.max(LEAST_EPSILON * depth));
        }
    }
    found.limit < before
}

/// Intersects a ray with the elements of a leaf, each shifted. A hit counts where `is_there` says so of the element and
/// the coordinates. Returns true if the limit fell.
///
/// The ray meets the plane of an element at c + a u + b v, where s d - a u - b v = c - o. By Cramer's rule, with n =
/// u x v and w = (c - o) x d: s = n.(c - o) / n.d, a = v.w / n.d and b = -u.w / n.d, also where u and v are not
/// orthogonal.
#[inline(always)]
fn intersect<const TRIANGLES: bool>(
    leaf: &Leaf,
    ray: &ModelRay,
    found: &mut Found,
    shift: impl Fn(usize) -> [f64; 3],
    is_there: impl Fn(u32, [f64; 2]) -> bool,
) -> bool {
    let before = found.limit;
    let ([ox, oy, oz], [dx, dy, dz]) = (ray.origin.to_array(), ray.direction.to_array());
    let (near, limit) = (ray.near, found.limit);
    let mut facing = [0.0; LANES];
    let mut depth = [0.0; LANES];
    let mut a = [0.0; LANES];
    let mut b = [0.0; LANES];
    let mut bits = [0_u64; LANES];
    // Each lane has scalars of its own from beginning to end, which compilers turn into vector code without shuffles.
    for l in 0..LANES {
        let at = |v: &[[f32; LANES]; 3]| (f64::from(v[0][l]), f64::from(v[1][l]), f64::from(v[2][l]));
        let ((cx, cy, cz), (ux, uy, uz), (vx, vy, vz)) = (at(&leaf.centre), at(&leaf.u), at(&leaf.v));
        let [sx, sy, sz] = shift(l);
        let (cx, cy, cz) = (cx - ox + sx, cy - oy + sy, cz - oz + sz);
        let (nx, ny, nz) = (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
        let (wx, wy, wz) = (cy * dz - cz * dy, cz * dx - cx * dz, cx * dy - cy * dx);
        let nd = nx * dx + ny * dy + nz * dz;
        let over = 1.0 / nd;
        let s = (nx * cx + ny * cy + nz * cz) * over;
        let pv = (vx * wx + vy * wy + vz * wz) * over;
        let up = (ux * wx + uy * wy + uz * wz) * -over;
        // What is edge-on, missing or overflows has NaN or infinite coordinates.
        let inside = if TRIANGLES {
            (pv >= -BEYOND) & (up >= -BEYOND) & (pv + up <= 1.0 + BEYOND)
        } else {
            pv * pv + up * up <= 1.0
        };
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
        let (u, v, element, back) = (a[l], b[l], leaf.element[l], facing[l] > 0.0);
        if !is_there(element, [u, v]) {
            continue;
        }
        found.hits.push(Hit { object: ray.object, element, depth: depth[l], u, v, back, is_even: TRIANGLES });
        found.limit = found.limit.min(depth[l] + ray.epsilon.max(LEAST_EPSILON * depth[l]));
    }
    found.limit < before
}
