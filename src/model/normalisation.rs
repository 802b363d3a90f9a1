//! Normalisation of kernels: what a surfel counts where others overlap it.
//!
//! ```text
//! s_k = integral of (r_k / sum over j of r_j) / integral of r_k      over the disc of surfel k
//! r = exp(-2 (u^2 + v^2)) inside a disc, 0 outside                    (docs/math.md, eq. 4)
//! ```
//!
//! Ren et al. (2002, section 7.1) take 1 / sum of `r_j` at the centre of k. On random points that misses by 30 %, so
//! this is the mean over the kernel. The sum of `s_k` times the integral of `r_k` is the area of the union of the
//! discs: each place of it is shared by the discs over it. A lone disc has the factor [`LARGEST`], and two equal ones
//! have half of it.
//!
//! The mean is taken at [`POINTS`] points of equal mass. On random points a single factor is then about 7 % off, and
//! the sum of all areas about 0.1 %. Equal areas instead of masses halve the one, and make the other 2 % on lattices.
//!
//! A neighbour j counts at a point x of k's plane where its disc contains the orthogonal projection of x onto its
//! plane, and
//! - x is at most the radius of the smaller disc away from that plane: sheets that lie farther apart do not share. The
//!   renderer blends over as much where discs make a surface;
//! - the outward sides of both discs agree within 60 degrees. So the two sides of a thin sheet do not share, nor the
//!   walls of a sharp edge, of which one shows only its edge where the other faces the eye.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::disc_tree::{self, DiscTree, Extent};
use super::surfels::Surfels;
use crate::math::{fast, simd};

/// Points of a disc at which the overlap is taken, of equal mass of the kernel.
const POINTS: usize = 16;
/// Cosine of the greatest angle between surfels of one surface.
const AGREE: f32 = 0.5;
/// Distance of a point from the plane of a disc that still covers it, in radii of the smaller disc.
const DEPTH: f32 = 1.0;
/// The factor of a lone disc: its area, pi, over the integral of its kernel, pi (1 - exp(-2)) / 2.
pub(super) const LARGEST: f32 = 2.313_035_2;
/// Boxes and discs that are touched to find all neighbours of a disc. About 160 are where 4 discs lie over each point.
const DISC_BUDGET: usize = 2048;
/// Boxes and discs that are touched to find the discs over a point, where a disc has too many neighbours.
const POINT_BUDGET: usize = 256;
/// Discs of one task.
const CHUNK: usize = 512;

impl Surfels {
    /// The factor `s_k` of each kernel, 0 < `s_k` <= 2 / (1 - exp(-2)) = 2.313: the share of its disc's area that
    /// belongs to surfel k, over the integral of its kernel. The sum of all `s_k` `r_k` is about 1 on a covered
    /// surface.
    ///
    /// It is a property of the model, in model space: rotations, translations and equal scales do not change it, and
    /// others little. It is computed when it is first asked for. That takes 1.7 s of processor time, on all cores, for
    /// a million surfels four deep, and 80 bytes for each surfel meanwhile. The result depends neither on the number of
    /// threads nor on [`Surfels::spatially_ordered`].
    ///
    /// The work for a surfel is limited. Where more than about fifty discs lie over a point, every 8th of them (or
    /// 64th, ...) stands for all. Factors are estimates then, most of them within 20 %, and their sum within 2 %. Where
    /// one disc covers very many that hardly overlap, its factor is as good as any.
    pub fn normalisation(&self) -> &[f32] {
        self.normalisation.known_or(|| if self.spheres { vec![1.0; self.len()] } else { factors(self) })
    }

    /// The mean of all factors, weighted by the areas of the discs: with it for all the sum of areas is the same. 1 for
    /// a model without surfels. It is computed when it is first asked for.
    pub fn mean_normalisation(&self) -> f32 {
        let factors = self.normalisation();
        self.normalisation.mean_or(|| {
            let area = |i: usize| self.axis_u[i].as_dvec3().cross(self.axis_v[i].as_dvec3()).length();
            let (sum, total) = factors
                .iter()
                .enumerate()
                .fold((0.0, 0.0), |(sum, total), (i, &factor)| (sum + area(i) * f64::from(factor), total + area(i)));
            let mean = (sum / total) as f32;
            // Not a number where all discs are points, or none is there.
            if mean > 0.0 && mean <= LARGEST { mean } else { 1.0 }
        })
    }
}

/// A disc as its neighbours see it.
#[derive(Clone, Copy)]
struct Disc {
    centre: Vec3,
    /// u of a point x is (x - centre) . `dual_u`; a distance from the plane does not change it.
    dual_u: Vec3,
    dual_v: Vec3,
    /// Unit normal of the plane, towards the outside.
    normal: Vec3,
    /// Greatest distance of a point of the disc from its centre.
    reach: f32,
    index: u32,
}

impl Disc {
    fn new(s: &Surfels, index: u32) -> Self {
        let i = index as usize;
        // In `f64`, because lengths from 1e-18 to 1e18 are squared twice.
        let (u, v) = (s.axis_u[i].as_dvec3(), s.axis_v[i].as_dvec3());
        let across = u.cross(v);
        let area2 = across.length_squared();
        Self {
            centre: s.position[i],
            dual_u: (v.cross(across) / area2).as_vec3(),
            dual_v: (across.cross(u) / area2).as_vec3(),
            normal: (across / area2.sqrt()).as_vec3(),
            reach: reach(u, v),
            index,
        }
    }

    /// True if the other disc may cover points of this one.
    fn is_near(&self, other: &Self) -> bool {
        let far = self.reach + other.reach + self.tolerance(other);
        self.normal.dot(other.normal) >= AGREE && (self.centre - other.centre).length_squared() <= far * far
    }

    fn tolerance(&self, other: &Self) -> f32 {
        DEPTH * if self.reach < other.reach { self.reach } else { other.reach }
    }
}

/// Greatest distance of a u + b v from 0, a^2 + b^2 <= 1: the greater singular value, which for axes at
/// right angles is the length of the longer one.
fn reach(u: DVec3, v: DVec3) -> f32 {
    let (uu, vv, uv) = (u.length_squared(), v.length_squared(), u.dot(v));
    ((uu + vv + ((uu - vv) * (uu - vv) + 4.0 * uv * uv).sqrt()) / 2.0).sqrt() as f32
}

/// Half the sides of the box of a disc.
fn half_box(u: Vec3, v: Vec3) -> Vec3 {
    let (u, v) = (u.as_dvec3(), v.as_dvec3());
    (u * u + v * v).map(f64::sqrt).as_vec3()
}

/// Places in a disc, in units of its axes, and the kernel there.
struct Points {
    x: [f32; POINTS],
    y: [f32; POINTS],
    kernel: [f32; POINTS],
}

impl Points {
    /// One point for each ring of equal mass, turned by the golden angle from one to the next. In its ring a point lies
    /// where 1/r has the mean of the ring, so that the mean of 1/r over all points, the factor of a lone disc, is
    /// exact.
    fn new() -> Self {
        let mut points = Self { x: [0.0; POINTS], y: [0.0; POINTS], kernel: [0.0; POINTS] };
        let lost = 1.0 - libm::exp(-2.0);
        let golden = PI * (3.0 - libm::sqrt(5.0));
        for i in 0..POINTS {
            // The kernel is 1 - lost m where the share m of the mass lies farther in.
            let at = |m: usize| 1.0 - lost * m as f64 / POINTS as f64;
            let inverse = libm::log(at(i) / at(i + 1)) * POINTS as f64 / lost;
            let r2 = 0.5 * libm::log(inverse);
            let (sin, cos) = libm::sincos(golden * i as f64);
            points.x[i] = (libm::sqrt(r2) * cos) as f32;
            points.y[i] = (libm::sqrt(r2) * sin) as f32;
            points.kernel[i] = fast::kernel(r2 as f32);
        }
        points
    }
}

/// Another disc in the coordinates of a disc: u, v and distance from the plane are linear in the place (x, y).
struct Seen {
    u: [f32; 3],
    v: [f32; 3],
    depth: [f32; 3],
    tolerance: f32,
}

impl Seen {
    fn new(from: &Disc, axes: [Vec3; 2], other: &Disc) -> Self {
        let rows = [from.centre - other.centre, axes[0], axes[1]];
        Self {
            u: rows.map(|row| row.dot(other.dual_u)),
            v: rows.map(|row| row.dot(other.dual_v)),
            depth: rows.map(|row| row.dot(other.normal)),
            tolerance: from.tolerance(other),
        }
    }

    /// The other's kernel at (x, y). It is 0 where numbers overflow: every comparison with NaN is false.
    #[inline(always)]
    fn kernel(&self, x: f32, y: f32) -> f32 {
        let at = |row: &[f32; 3]| row[0] + row[1] * x + row[2] * y;
        let (u, v) = (at(&self.u), at(&self.v));
        let r2 = u * u + v * v;
        let counts = (r2 <= 1.0) & (at(&self.depth).abs() <= self.tolerance);
        if counts { fast::kernel(r2) } else { 0.0 }
    }
}

simd::dispatch! {
    /// Adds a kernel to the sums at all points.
    fn add(seen: &Seen, points: &Points, sums: &mut [f32; POINTS]) = add_body
}

#[inline(always)]
fn add_body(seen: &Seen, points: &Points, sums: &mut [f32; POINTS]) {
    for i in 0..POINTS {
        sums[i] += seen.kernel(points.x[i], points.y[i]);
    }
}

/// All discs of a model, in the order of their tree.
struct Model<'a> {
    surfels: &'a Surfels,
    discs: Vec<Disc>,
    tree: DiscTree,
    points: Points,
}

/// See [`Surfels::normalisation`].
fn factors(surfels: &Surfels) -> Vec<f32> {
    let s = surfels;
    let reaches: Vec<f32> =
        s.axis_u.par_iter().zip(&s.axis_v).map(|(u, v)| reach(u.as_dvec3(), v.as_dvec3())).collect();
    let order = disc_tree::order(&s.position, &reaches);
    drop(reaches);
    let discs: Vec<Disc> = order.into_par_iter().map(|index| Disc::new(s, index)).collect();
    // A disc covers what is a tolerance away from it, along its normal.
    let half = |disc: &Disc| {
        let flat = half_box(s.axis_u[disc.index as usize], s.axis_v[disc.index as usize]);
        flat + disc.normal.abs() * (DEPTH * disc.reach)
    };
    let tree = DiscTree::new(discs.len(), |k| Extent::around(discs[k].centre, half(&discs[k])));
    let model = Model { surfels, discs, tree, points: Points::new() };

    let mut in_order = vec![0.0; s.len()];
    in_order.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
        let mut near = Vec::new();
        for (k, factor) in (chunk * CHUNK..).zip(out) {
            *factor = model.factor(k, &mut near);
        }
    });
    let mut out = vec![0.0; s.len()];
    for (disc, factor) in model.discs.iter().zip(in_order) {
        out[disc.index as usize] = factor;
    }
    out
}

impl Model<'_> {
    /// The factor of disc `k`: the mean of 1 / sum of `r_j`. `near` is scratch memory.
    fn factor(&self, k: usize, near: &mut Vec<u32>) -> f32 {
        let disc = &self.discs[k];
        let i = disc.index as usize;
        let axes = [self.surfels.axis_u[i], self.surfels.axis_v[i]];
        let target = Extent::around(disc.centre, half_box(axes[0], axes[1]));
        near.clear();
        let all = self.tree.search(&target, 0, DISC_BUDGET, |run, _| {
            near.extend(run.filter(|&j| j != k && disc.is_near(&self.discs[j])).map(|j| j as u32));
        });
        let mut sums = self.points.kernel;
        if all {
            for &j in &*near {
                add(&Seen::new(disc, axes, &self.discs[j as usize]), &self.points, &mut sums);
            }
        } else {
            self.add_at_points(k, axes, &mut sums);
        }
        let mean = sums.iter().map(|sum| 1.0 / sum).sum::<f32>() / POINTS as f32;
        mean.min(LARGEST)
    }

    /// Adds the kernels of the discs over each point by a search of its own. Where there are too many, it takes some
    /// for all.
    fn add_at_points(&self, k: usize, axes: [Vec3; 2], sums: &mut [f32; POINTS]) {
        let disc = &self.discs[k];
        let mut skip = 0_usize;
        for (i, sum) in sums.iter_mut().enumerate() {
            let (x, y) = (self.points.x[i], self.points.y[i]);
            let place = disc.centre + axes[0] * x + axes[1] * y;
            let target = Extent::around(place, Vec3::ZERO);
            loop {
                let mut others = 0.0;
                let found = self.tree.search(&target, skip, POINT_BUDGET, |run, stands_for| {
                    for j in run.filter(|&j| j != k && disc.is_near(&self.discs[j])) {
                        others += stands_for * Seen::new(disc, axes, &self.discs[j]).kernel(x, y);
                    }
                });
                if found || skip >= self.tree.highest() {
                    *sum += others;
                    break;
                }
                skip += 1;
            }
        }
    }
}

#[cfg(test)]
mod tests;
