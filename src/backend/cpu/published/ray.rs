//! A published kernel in motion on the rays through neighbouring pixels (Wolf 2008, 4.2.2 and eq. C.38; docs/math.md,
//! section 7, eq. 16).

use crate::backend::cpu::swept::ray::{beyond_near, reciprocal};
use crate::backend::cpu::tiles::LANES;
use crate::layout::{FLAG_LOW_PASS, SweptSplat};
use crate::math::fast;
use crate::math::sweep::{Path, Sweep, chord_intensity, line_weight, moments};

/// How kernels are met.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend::cpu) struct RaySettings {
    /// Places of a kernel on one ray whose sources are looked up.
    pub source_samples: u32,
    /// Change of the time weight from the middle of the interval to its end, over its mean.
    pub slope: f32,
    /// Write the sum of weights instead of the times at which kernels cover.
    pub sum: bool,
    /// Where the camera's axis meets the raster, counted as sample positions are: raster pixels.
    pub axis: [f32; 2],
    /// Focal length, raster pixels.
    pub focal: f32,
}

impl RaySettings {
    /// 1 / |cos| of the angle between the kernel's normal and the ray at offset `x`, `y` from the splat's reference,
    /// where the inverse depth is `w` (docs/math.md, eq. 16b).
    #[inline(always)]
    fn slant(&self, splat: &SweptSplat, [x, y]: [f32; 2], w: f32) -> f32 {
        let i = splat.inverse_depth;
        let (from_x, from_y) = (splat.reference[0] - self.axis[0], splat.reference[1] - self.axis[1]);
        let (normal_x, normal_y) = (i[0] * self.focal, i[1] * self.focal);
        let normal_z = i[2] - i[0] * from_x - i[1] * from_y;
        let over = 1.0 / self.focal;
        let (ray_x, ray_y) = ((x + from_x) * over, (y + from_y) * over);
        let normal = (normal_x * normal_x + normal_y * normal_y + normal_z * normal_z).sqrt();
        let ray = (ray_x * ray_x + ray_y * ray_y + 1.0).sqrt();
        normal * ray / w
    }
}

/// A kernel on the rays through neighbouring pixels. A lane whose ray does not meet it has weight 0 and covers nothing.
#[derive(Default)]
pub(in crate::backend::cpu) struct Lanes {
    /// Weight over the interval.
    pub weight: [f32; LANES],
    /// What the low-pass disc adds to the coverage, or for sums the whole weight.
    pub loose: [f32; LANES],
    /// Mean depth on the ray.
    pub depth: [f32; LANES],
    /// The pixel nearest the source point, and the depth there that is compared.
    pub source: [[i32; LANES]; 2],
    pub source_depth: [f32; LANES],
    /// When the kernel covers, and when its low-pass disc does.
    pub surface: [u32; LANES],
    pub low_pass: [u32; LANES],
    /// 1 where anything is met.
    pub covers: [u32; LANES],
}

/// The numbers that all rays of a splat share.
pub(in crate::backend::cpu) struct Ray {
    near: f32,
    /// (1 + k tau) / w is the depth at tau.
    k: f32,
    /// 1 / k, or as good as infinite.
    inverse_k: f32,
    /// Radius of the low-pass disc.
    disc: f32,
    /// Motion of its centre over the centre's depth (x, y, depth).
    drift: [f32; 3],
    /// Times at which the disc is beyond `near`.
    disc_span: [f32; 2],
}

impl Ray {
    #[inline(always)]
    pub(in crate::backend::cpu) fn of(splat: &SweptSplat, near: f32, low_pass: f32) -> Self {
        let i = splat.inverse_depth;
        let m = splat.motion;
        let k = i[0] * m[0] + i[1] * m[1] + i[2] * m[2];
        let inverse_k = reciprocal(k);
        let drift = [m[0] * i[2], m[1] * i[2], m[2] * i[2]];
        let disc = if splat.flags & FLAG_LOW_PASS != 0 { low_pass } else { 0.0 };
        let disc_span = beyond_near(near * i[2] - 1.0, drift[2], reciprocal(drift[2]), [-1.0, 1.0]);
        Self { near, k, inverse_k, disc, drift, disc_span }
    }

    /// Part `part` of the kernel on the ray through the sample position of `pixel`; nothing beyond column `last`.
    #[inline(always)]
    #[allow(clippy::too_many_arguments, reason = "one loop body")]
    pub(in crate::backend::cpu) fn meet<const LINE: bool, const LOW_PASS: bool>(
        &self,
        splat: &SweptSplat,
        view: &RaySettings,
        part: u32,
        pixel: [f32; 2],
        last: f32,
        lanes: &mut Lanes,
        l: usize,
    ) {
        let (x, y) = (pixel[0] + 0.5 - splat.reference[0], pixel[1] + 0.5 - splat.reference[1]);
        let form = |c: [f32; 3]| c[0] * x + (c[1] * y + c[2]);
        let w = form(splat.inverse_depth);
        let path = Path { at: [form(splat.u), form(splat.v)], rate: [form(splat.u_rate), form(splat.v_rate)], w };
        let tube = Sweep::tube(path);
        let span = beyond_near(self.near * w - 1.0, self.k, self.inverse_k, tube.covered());
        let sweep = Sweep::ellipsoid(path);
        let weighed = beyond_near(self.near * w - 1.0, self.k, self.inverse_k, sweep.covered());
        let wanted = pixel[0] <= last;
        let met = wanted & (w > 0.0) & (weighed[0] < weighed[1]);
        let weighed = cut(weighed, part, view.source_samples);
        let span = cut(span, part, view.source_samples);
        let slant = if LINE { view.slant(splat, [x, y], w) } else { 1.0 };
        let (weight, intensity) = weigh::<LINE>(&sweep, weighed, slant);
        let tau = 0.5 * (weighed[0] + weighed[1]);
        let time = 1.0 + view.slope * tau;

        // The low-pass disc: a disc of fixed size in space that faces the viewer, so that it, too, is a swept kernel.
        let d = self.drift;
        let disc = Path { at: [x, y], rate: [x * d[2] - d[0], y * d[2] - d[1]], w: self.disc };
        let disc_sweep = Sweep::ellipsoid(disc);
        let disc_span = disc_sweep.covered();
        let disc_span = [
            if disc_span[0] > self.disc_span[0] { disc_span[0] } else { self.disc_span[0] },
            if disc_span[1] < self.disc_span[1] { disc_span[1] } else { self.disc_span[1] },
        ];
        let disc_met = LOW_PASS & wanted & (self.disc > 0.0) & (disc_span[0] < disc_span[1]);
        let disc_span = cut(disc_span, part, view.source_samples);
        let (disc_weight, disc_intensity) = weigh::<LINE>(&disc_sweep, disc_span, 1.0);
        let disc_tau = 0.5 * (disc_span[0] + disc_span[1]);
        let disc_time = 1.0 + view.slope * disc_tau;

        let weight = if met { weight * time } else { 0.0 };
        let disc_weight = if disc_met { disc_weight * disc_time } else { 0.0 };
        let larger = disc_weight > weight;
        lanes.weight[l] = if larger { disc_weight } else { weight };
        lanes.loose[l] = if view.sum {
            let (all, disc_all) = (weight * intensity, disc_weight * disc_intensity);
            if larger { disc_all } else { all }
        } else if larger {
            disc_weight - weight
        } else {
            0.0
        };

        // The source point, on the splat at mid-interval; of the low-pass disc where the kernel itself is not met.
        let depth = (1.0 + self.k * tau) / w;
        let m = splat.motion;
        let source_depth = depth - m[2] * tau;
        let over = 1.0 / source_depth;
        let near_x = if met { (depth * x - m[0] * tau) * over } else { x + disc_tau * disc.rate[0] };
        let near_y = if met { (depth * y - m[1] * tau) * over } else { y + disc_tau * disc.rate[1] };
        let (column, sample_x) = nearest_sample(near_x, splat.reference[0]);
        let (row, sample_y) = nearest_sample(near_y, splat.reference[1]);
        let i = splat.inverse_depth;
        let there = i[0] * sample_x + (i[1] * sample_y + i[2]);
        let plane_depth = if there > 0.0 { 1.0 / there } else { source_depth };
        let centre_depth = 1.0 / i[2];
        lanes.source[0][l] = column;
        lanes.source[1][l] = row;
        lanes.source_depth[l] = if met { plane_depth } else { centre_depth };
        lanes.depth[l] = if met { depth } else { centre_depth * (1.0 + d[2] * disc_tau) };
        lanes.surface[l] = if met { moments(span) } else { 0 };
        lanes.low_pass[l] = if disc_met { moments(disc_span) } else { 0 };
        lanes.covers[l] = u32::from(met | disc_met);
    }
}

/// Weight over the interval, and what makes it an intensity.
#[inline(always)]
fn weigh<const LINE: bool>(sweep: &Sweep, span: [f32; 2], slant: f32) -> (f32, f32) {
    if LINE { (line_weight(sweep.mean(span), span, slant), 1.0) } else { (sweep.chord(), chord_intensity(sweep)) }
}

/// Part `part` of `parts` equal ones.
#[inline(always)]
fn cut([first, last]: [f32; 2], part: u32, parts: u32) -> [f32; 2] {
    if parts == 1 {
        return [first, last];
    }
    let step = (last - first) / parts as f32;
    [first + part as f32 * step, first + (part + 1) as f32 * step]
}

/// A pixel number that is as good as infinite.
pub(in crate::backend) const FAR: f32 = 1e6;

/// Index of the pixel whose sample is nearest `offset` from `reference`, and that sample's own offset.
#[inline(always)]
fn nearest_sample(offset: f32, reference: f32) -> (i32, f32) {
    let index = offset + reference - 0.5;
    let index = if index > -FAR { index } else { -FAR };
    let index = if index < FAR { index } else { FAR };
    let shifted = index + fast::ROUND;
    let whole = shifted - fast::ROUND;
    (shifted.to_bits().wrapping_sub(fast::ROUND.to_bits()) as i32, whole + 0.5 - reference)
}
