//! Rays against a model: boxes in f32, padded so that nothing is missed; surfels in f64.
//!
//! A ray's direction is scaled so that its parameter is camera depth. Transforms are affine, so this holds in model space too:
//! depths from different objects compare without any conversion.

use glam::DVec3;

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

/// What one thread needs for its rays; kept so that no memory is taken per ray.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Surfels hit so far; those beyond the final limit are still among them.
    pub hits: Vec<Hit>,
    /// T of the visibility rule so far: the least depth + epsilon.
    pub limit: f64,
    stack: Vec<(u32, f32)>,
}

impl Found {
    /// Before the first object.
    pub(super) fn clear(&mut self) {
        self.hits.clear();
        self.limit = f64::INFINITY;
    }
}

/// Adds the surfels that `ray` hits at depths up to the limit, and lowers the limit.
///
/// Compiled for the baseline and for AVX2, where the boxes are tested with intrinsics (compilers make shuffles of it). Boxes only
/// decide what is looked at, and the intersection's operations are the same: so are the hits, to the bit.
pub(super) fn traverse(bvh: &Bvh, ray: &ModelRay, found: &mut Found) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn avx2(bvh: &Bvh, ray: &ModelRay, found: &mut Found) {
            traverse_body(bvh, ray, found, |node, ray, near, limit| enter_avx(node, ray, near, limit));
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            #[allow(unsafe_code, reason = "AVX2 was detected on the line before")]
            // SAFETY: the CPU has the only feature that the function enables.
            return unsafe { avx2(bvh, ray, found) };
        }
    }
    traverse_body(bvh, ray, found, enter);
}

/// The ray as boxes see it: from `start` (a depth) on, where it enters the model's sphere.
struct BoxRay {
    origin: [f32; 3],
    inverse: [f32; 3],
    /// 1 where the direction is negative: the side that the ray meets first.
    first: [usize; 3],
}

#[inline(always)]
fn traverse_body(
    bvh: &Bvh,
    ray: &ModelRay,
    found: &mut Found,
    enter: impl Fn(&Node, &BoxRay, f32, f32) -> ([f32; WIDTH], u32),
) {
    let d2 = ray.direction.length_squared();
    let from = ray.origin - bvh.centre;
    let middle = -from.dot(ray.direction) / d2;
    let closest = from + ray.direction * middle;
    let half2 = (bvh.radius * bvh.radius - closest.length_squared()) / d2;
    // Also false for a direction that is 0 or not finite.
    if bvh.nodes.is_empty() || !(0.0..f64::INFINITY).contains(&half2) {
        return;
    }
    let half = half2.sqrt();
    let start = middle - half;
    if middle + half < ray.near || start > found.limit {
        return;
    }
    let origin = ray.origin + ray.direction * start;
    // A component near 0 is replaced by one that moves the ray by less than the padding.
    let least = 1e-9 * d2.sqrt();
    let direction = ray.direction.to_array().map(|d| if d.abs() < least { least.copysign(d) } else { d });
    let boxes = BoxRay {
        origin: origin.as_vec3().to_array(),
        inverse: direction.map(|d| (1.0 / d) as f32),
        first: direction.map(|d| usize::from(d < 0.0)),
    };
    let mut limit = above(found.limit - start);
    let near = below(ray.near - start);
    // Taken out of `found`, so that its length and place stay in registers.
    let mut stack = std::mem::take(&mut found.stack);
    let mut number = 0;
    loop {
        if number & LEAF == 0 {
            let node = &bvh.nodes[number as usize];
            let (entries, mut mask) = enter(node, &boxes, near, limit);
            if mask != 0 {
                // The nearest child is next; the others wait in any order.
                let mut nearest = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                while mask != 0 {
                    let slot = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    let later = if entries[slot] < entries[nearest] { nearest } else { slot };
                    nearest = nearest + slot - later;
                    stack.push((node.children[later], entries[later]));
                }
                number = node.children[nearest];
                continue;
            }
        } else if leaf(&bvh.leaves[(number & !LEAF) as usize], ray, found) {
            limit = above(found.limit - start);
        }
        // What lies beyond the limit by now is passed over.
        loop {
            let Some((waiting, entry)) = stack.pop() else {
                found.stack = stack;
                return;
            };
            if entry <= limit {
                number = waiting;
                break;
            }
        }
    }
}

/// The f32 not below x.
#[inline(always)]
fn above(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) < x { rounded.next_up() } else { rounded }
}

/// The f32 not above x.
#[inline(always)]
fn below(x: f64) -> f32 {
    -above(-x)
}

/// Parameters at which the ray enters the boxes, and which it enters between `near` and `limit` (bit mask).
#[inline(always)]
fn enter(node: &Node, ray: &BoxRay, near: f32, limit: f32) -> ([f32; WIDTH], u32) {
    let [first_x, first_y, first_z] = [0, 1, 2].map(|axis| &node.sides[ray.first[axis]][axis]);
    let [last_x, last_y, last_z] = [0, 1, 2].map(|axis| &node.sides[1 - ray.first[axis]][axis]);
    let [ox, oy, oz] = ray.origin;
    let [ix, iy, iz] = ray.inverse;
    let mut entry = [0.0; WIDTH];
    let mut bits = [0; WIDTH];
    for l in 0..WIDTH {
        let later = |a: f32, b: f32| if a > b { a } else { b };
        let sooner = |a: f32, b: f32| if a < b { a } else { b };
        let (x, y, z) = ((first_x[l] - ox) * ix, (first_y[l] - oy) * iy, (first_z[l] - oz) * iz);
        entry[l] = later(later(x, y), later(z, near));
        let (x, y, z) = ((last_x[l] - ox) * ix, (last_y[l] - oy) * iy, (last_z[l] - oz) * iz);
        let exit = sooner(sooner(x, y), sooner(z, limit));
        bits[l] = if entry[l] <= exit { 1_u32 << l } else { 0 };
    }
    (entry, bits.iter().fold(0, |mask, bit| mask | bit))
}

/// As [`enter`], with AVX.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx")]
#[inline]
fn enter_avx(node: &Node, ray: &BoxRay, near: f32, limit: f32) -> ([f32; WIDTH], u32) {
    use std::arch::x86_64::{
        __m256, _CMP_LE_OQ, _mm256_cmp_ps, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps,
        _mm256_set1_ps, _mm256_sub_ps,
    };
    let mut entry = _mm256_set1_ps(near);
    let mut exit = _mm256_set1_ps(limit);
    for axis in 0..3 {
        let first: __m256 = bytemuck::cast(node.sides[ray.first[axis]][axis]);
        let last: __m256 = bytemuck::cast(node.sides[1 - ray.first[axis]][axis]);
        let (o, inverse) = (_mm256_set1_ps(ray.origin[axis]), _mm256_set1_ps(ray.inverse[axis]));
        entry = _mm256_max_ps(_mm256_mul_ps(_mm256_sub_ps(first, o), inverse), entry);
        exit = _mm256_min_ps(_mm256_mul_ps(_mm256_sub_ps(last, o), inverse), exit);
    }
    let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(entry, exit));
    (bytemuck::cast(entry), mask as u32)
}

/// Intersects the surfels of a leaf; true if the limit fell.
///
/// With n = u x v, the plane is met at s = n.(c - o) / n.d; the point p relative to c has the coordinates
/// (p x v).n / n^2 and (u x p).n / n^2, also where u and v are not orthogonal.
#[inline(always)]
fn leaf(leaf: &Leaf, ray: &ModelRay, found: &mut Found) -> bool {
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
        let nd = nx * dx + ny * dy + nz * dz;
        let s = (nx * cx + ny * cy + nz * cz) / nd;
        let (px, py, pz) = (dx * s - cx, dy * s - cy, dz * s - cz);
        let over = 1.0 / (nx * nx + ny * ny + nz * nz);
        let pv = (py * vz - pz * vy) * nx + (pz * vx - px * vz) * ny + (px * vy - py * vx) * nz;
        let up = (uy * pz - uz * py) * nx + (uz * px - ux * pz) * ny + (ux * py - uy * px) * nz;
        let (pv, up) = (pv * over, up * over);
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
