//! A kernel in linear motion on one ray: when it covers the ray, and with what weight (docs/math.md, section 7, eq. 11
//! to 16; Wolf 2008, 4.2.2 and appendix C, without its axes).
//!
//! Along a ray, the tangent-plane coordinates of the kernel are linear in the time tau in [-1, 1]:
//! (u, v)(tau) = (`at` + tau `rate`) / w. All functions take the numerator and w, so they are regular without motion.

use std::f32::consts::SQRT_2;

use super::fast;

/// Squared motion in radii below which a kernel counts as unmoved. Its ends would differ by less than rounding.
pub const UNMOVED: f32 = 1e-12;

/// 1 / integral of exp(-2 tau^2) over [-1, 1], = sqrt(2/pi) / erf(sqrt 2).
pub const ELLIPSOID_PEAK: f32 = 0.835_918_96;

/// Integral of exp(-2 r^2) over the unit disc over its integral over the unit ball: (1 - e^-2)/2 over
/// sqrt(pi/8) erf(sqrt 2) - e^-2.
pub const LINE_PEAK: f32 = 0.934_149_1;

/// sqrt(pi)/2.
pub const HALF_SQRT_PI: f32 = 0.886_226_9;

/// sqrt(pi/2).
pub const SQRT_HALF_PI: f32 = 1.253_314_1;

/// Tangent-plane coordinates, times w, along one ray (docs/math.md, eq. 11).
#[derive(Clone, Copy, Debug)]
pub struct Path {
    /// (u w, v w) at tau = 0.
    pub at: [f32; 2],
    /// Change of (u w, v w) from tau = 0 to tau = 1.
    pub rate: [f32; 2],
    /// The divisor. The ray meets the kernel only where it is > 0.
    pub w: f32,
}

impl Path {
    /// The path times the power of two that brings w into [1, 2). Coordinates keep their bits, and the fourth power of
    /// w, which [`Sweep`] divides by, is a number at any depth.
    #[inline(always)]
    fn in_range(self) -> Self {
        /// The bits of the exponent, and those of 2^127.
        const EXPONENT: u32 = 0xff << 23;
        const LARGEST: u32 = 0xfe << 23;
        let scale = f32::from_bits(LARGEST.wrapping_sub(self.w.to_bits() & EXPONENT));
        let [u, v] = self.at;
        let [du, dv] = self.rate;
        Self { at: [u * scale, v * scale], rate: [du * scale, dv * scale], w: self.w * scale }
    }
}

/// The quadratic of a path, |at + tau rate|^2 + e (tau w)^2 = w^2 (docs/math.md, eq. 12). e is 0 for the tube that the
/// kernel's rim sweeps, and 1 for the ellipsoid.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    w2: f32,
    /// Coefficient of tau^2.
    a: f32,
    /// Half the coefficient of tau.
    b: f32,
    /// at|^2: the constant term plus w^2.
    r2: f32,
    /// Squared distance of the line from the origin, times `a`. It is the square of a cross product, so nothing
    /// cancels.
    across: f32,
    /// 1 / (w^2 a), or 1 / w^4 without motion.
    inverse: f32,
    /// True if the motion is below [`UNMOVED`].
    unmoved: bool,
}

impl Sweep {
    /// The quadratic of the tube.
    #[inline(always)]
    pub fn tube(path: Path) -> Self {
        Self::new(path, 0.0)
    }

    /// The quadratic of the ellipsoid.
    #[inline(always)]
    pub fn ellipsoid(path: Path) -> Self {
        Self::new(path, 1.0)
    }

    #[inline(always)]
    fn new(path: Path, e: f32) -> Self {
        let Path { at: [u, v], rate: [du, dv], w } = path.in_range();
        let w2 = w * w;
        let r2 = u * u + v * v;
        let cross = u * dv - v * du;
        let a = du * du + dv * dv + e * w2;
        let unmoved = a <= UNMOVED * w2;
        let inverse = 1.0 / (w2 * if unmoved { w2 } else { a });
        Self { w2, a, b: u * du + v * dv, r2, across: cross * cross + e * (w2 * r2), inverse, unmoved }
    }

    /// First and last tau in [-1, 1] at which the kernel covers the ray. It never does if the first is not less than
    /// the last.
    #[inline(always)]
    pub fn covered(&self) -> [f32; 2] {
        let squared = self.w2 * self.a - self.across;
        let root = (if squared > 0.0 { squared } else { 0.0 }).sqrt();
        // The root of greater magnitude comes from a sum without cancellation, the other one from Vieta's formula.
        let sum = self.b + if self.b < 0.0 { -root } else { root };
        let one = -sum / self.a;
        let other = (self.w2 - self.r2) / sum;
        let first = if one < other { one } else { other };
        let last = if one < other { other } else { one };
        let first = if first > -1.0 { first } else { -1.0 };
        let last = if last < 1.0 { last } else { 1.0 };
        let inside = self.r2 <= self.w2;
        let meets = if self.unmoved { inside } else { squared > 0.0 };
        let first = if self.unmoved { -1.0 } else { first };
        let last = if self.unmoved { 1.0 } else { last };
        [if meets { first } else { 1.0 }, if meets { last } else { -1.0 }]
    }

    /// Squared distance of the path from the kernel's centre, in kernel radii.
    #[inline(always)]
    pub fn nearest(&self) -> f32 {
        (if self.unmoved { self.r2 * self.w2 } else { self.across }) * self.inverse
    }

    /// Mean of exp(-2 (u^2 + v^2 + e tau^2)) over [first, last], which lies within `covered` (docs/math.md, eq. 13).
    #[inline(always)]
    pub fn mean(&self, [first, last]: [f32; 2]) -> f32 {
        let scale = if self.unmoved { 0.0 } else { SQRT_2 * self.inverse.sqrt() };
        let x = |tau: f32| scale * (self.b + self.a * tau);
        fast::kernel(self.nearest()) * (HALF_SQRT_PI * fast::erf_slope(x(first), x(last)))
    }

    /// Weight of the ellipsoid by its chord: exp(-2 (1 - l^2)), where l is half the chord's length after the ellipsoid
    /// is mapped to the unit ball (docs/math.md, eq. 16; Wolf 2008, eq. 4.12).
    #[inline(always)]
    pub fn chord(&self) -> f32 {
        fast::kernel(self.nearest())
    }

    /// Squared length of the motion over half the interval, in kernel radii, plus e.
    #[inline(always)]
    pub fn speed2(&self) -> f32 {
        self.a / self.w2
    }
}

/// Weight of a tube: half the integral of exp(-2 (u^2 + v^2)) over `covered`, from its mean (docs/math.md, eq. 14).
/// Without motion it is the kernel itself.
#[inline(always)]
pub fn tube_weight(mean: f32, [first, last]: [f32; 2]) -> f32 {
    mean * (0.5 * (last - first))
}

/// Weight of an ellipsoid: the integral of exp(-2 (u^2 + v^2 + tau^2)) over `covered`, from its mean, divided by the
/// integral of exp(-2 tau^2) over [-1, 1] (docs/math.md, eq. 15).
#[inline(always)]
pub fn ellipsoid_weight(mean: f32, [first, last]: [f32; 2]) -> f32 {
    mean * (ELLIPSOID_PEAK * (last - first))
}

/// Weight of an ellipsoid by its line integral: that of G = D exp(-2 (u^2 + v^2 + tau^2)) along the part of the ray
/// that `covered` stands for, from its mean (Wolf 2008, eq. C.16 and C.38). D gives the kernel the integral over space
/// that the unmoved kernel has over its plane. `slant`: 1 / |cos| of the angle between the ray and the kernel's
/// normal, which is what lengths along the ray are over the time (docs/math.md, eq. 16b).
#[inline(always)]
pub fn line_weight(mean: f32, [first, last]: [f32; 2], slant: f32) -> f32 {
    mean * (LINE_PEAK * (last - first)) * slant
}

/// Factor on a chord's weight that keeps a kernel's integral over the screen the same whatever its motion (Wolf 2008,
/// 4.1.2). The integral of the unbounded ellipsoid is its chord weight times sqrt(pi/2) / sqrt(a/w^2).
#[inline(always)]
pub fn chord_intensity(sweep: &Sweep) -> f32 {
    SQRT_HALF_PI * ELLIPSOID_PEAK / sweep.speed2().sqrt()
}

/// The middles of the 32nds of [-1, 1] that lie in [first, last], as bits; the earliest is the lowest bit.
#[inline(always)]
pub fn moments([first, last]: [f32; 2]) -> u32 {
    below(last) & !below(first)
}

/// Number of middles before `tau` in [-1, 1].
#[inline(always)]
fn below(tau: f32) -> u32 {
    let count = (16.0 * tau + (16.0 + fast::ROUND)).to_bits() & 63;
    let ones = (1_u32 << (count & 31)).wrapping_sub(1);
    if count < 32 { ones } else { u32::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A simple generator that gives the same cases everywhere.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }
        fn within(&mut self, low: f64, high: f64) -> f64 {
            low + (high - low) * self.next()
        }
    }

    /// Covered share, tube weight and ellipsoid weight by their definition: the midpoint rule over tau, in f64.
    fn by_sampling(at: [f64; 2], rate: [f64; 2]) -> [f64; 3] {
        let n = 20_000;
        let (mut covered, mut tube, mut ellipsoid, mut whole) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..n {
            let tau = -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(n);
            let r2 = (at[0] + tau * rate[0]).powi(2) + (at[1] + tau * rate[1]).powi(2);
            whole += (-2.0 * tau * tau).exp();
            if r2 <= 1.0 {
                covered += 1.0;
                tube += (-2.0 * r2).exp();
            }
            if r2 + tau * tau <= 1.0 {
                ellipsoid += (-2.0 * (r2 + tau * tau)).exp();
            }
        }
        [covered / f64::from(n), tube / f64::from(n), ellipsoid / whole]
    }

    fn path(at: [f64; 2], rate: [f64; 2], w: f64) -> Path {
        Path { at: at.map(|v| (v * w) as f32), rate: rate.map(|v| (v * w) as f32), w: w as f32 }
    }

    fn span([first, last]: [f32; 2]) -> f64 {
        f64::from(if first < last { last - first } else { 0.0 })
    }

    /// Covered share, tube weight and ellipsoid weight by the functions under test.
    fn by_formula(path: Path) -> [f64; 3] {
        let (tube, ellipsoid) = (Sweep::tube(path), Sweep::ellipsoid(path));
        let (t, e) = (tube.covered(), ellipsoid.covered());
        let weight = |weight: f32, at: [f32; 2]| if at[0] < at[1] { f64::from(weight) } else { 0.0 };
        [0.5 * span(t), weight(tube_weight(tube.mean(t), t), t), weight(ellipsoid_weight(ellipsoid.mean(e), e), e)]
    }

    #[test]
    fn weights_are_the_integrals() {
        let mut random = Random(7);
        let mut worst = [0.0_f64; 3];
        for case in 0..3000 {
            let speed = 10_f64.powf(random.within(-7.0, 2.5));
            let angle = random.within(0.0, 6.3);
            let rate = [speed * angle.cos(), speed * angle.sin()];
            let span = 1.2 + random.next() * speed.min(20.0);
            let at = [random.within(-span, span), random.within(-span, span)];
            let w = 10_f64.powf(random.within(-14.0, 14.0));
            let (want, got) = (by_sampling(at, rate), by_formula(path(at, rate, w)));
            // Rounding decides at the rim of a slow kernel.
            if speed < 1e-3 && (at[0].hypot(at[1]) - 1.0).abs() < 2.0 * speed + 1e-6 {
                continue;
            }
            for i in 0..3 {
                let error = (want[i] - got[i]).abs();
                assert!(
                    error < [1e-4, 5e-5, 5e-5][i],
                    "case {case} [{i}]: {got:?}, sampling {want:?}, at {at:?}, rate {rate:?}"
                );
                worst[i] = worst[i].max(error);
            }
        }
        // At each of the two ends the midpoint rule errs by up to half a step, 1/20000 of the whole. Weights are
        // exp(-2) there.
        println!("worst: covered {:.1e}, tube {:.1e}, ellipsoid {:.1e}", worst[0], worst[1], worst[2]);
    }

    #[test]
    fn an_unmoved_tube_is_the_kernel() {
        for i in 0..=1100 {
            let r = f64::from(i) / 1000.0;
            let p = path([r * 0.6, r * 0.8], [0.0, 0.0], 0.3);
            let r2 = (p.at[0] * p.at[0] + p.at[1] * p.at[1]) / (p.w * p.w);
            let [covered, tube, _] = by_formula(p);
            let inside = p.at[0] * p.at[0] + p.at[1] * p.at[1] <= p.w * p.w;
            assert_eq!(covered, if inside { 1.0 } else { 0.0 });
            let want = if inside { (-2.0 * f64::from(r2)).exp() } else { 0.0 };
            assert!((tube - want).abs() < 1e-6, "{r}: {tube} {want}");
        }
    }

    /// The speed grows from 0 to far in small steps, at places inside the rim. Neither the weight nor the span jumps.
    #[test]
    fn nothing_jumps_with_speed() {
        for angle in 0..12 {
            let angle = f64::from(angle) * 0.55;
            for at in [[0.0, 0.0], [0.5, 0.1], [-0.3, 0.8], [0.6, -0.6]] {
                let mut before: Option<[f64; 3]> = None;
                for step in 0..4000 {
                    let speed = 10_f64.powf(-9.0 + 11.0 * f64::from(step) / 4000.0);
                    let now = by_formula(path(at, [speed * angle.cos(), speed * angle.sin()], 0.2));
                    if let Some(before) = before {
                        for i in 0..3 {
                            // A step changes the speed by 0.64 %, so nothing changes by more than that, plus rounding.
                            assert!(
                                (now[i] - before[i]).abs() < 0.0064 + 2e-6,
                                "{at:?} {angle} {speed}: {before:?} {now:?}"
                            );
                        }
                    }
                    before = Some(now);
                }
            }
        }
    }

    /// At tau = 0 the path enters or leaves. One root is 0, where a sum of the wrong sign would cancel to 0/0.
    #[test]
    fn a_path_through_the_rim_is_met_on_one_side() {
        for step in 0..64 {
            let angle = std::f64::consts::TAU * (f64::from(step) + 0.5) / 64.0;
            for speed in [1e-4, 1e-2, 0.3, 1.0, 3.0, 1e2] {
                let [first, last] =
                    Sweep::tube(path([1.0, 0.0], [speed * angle.cos(), speed * angle.sin()], 4.0)).covered();
                let other = (-2.0 * angle.cos() / speed).clamp(-1.0, 1.0);
                let error = (f64::from(first) - other.min(0.0)).abs().max((f64::from(last) - other.max(0.0)).abs());
                assert!(error < 1e-5, "{speed} at {angle}: {first} to {last}, not {other}");
            }
        }
    }

    #[test]
    fn moments_are_middles() {
        assert_eq!(moments([-1.0, 1.0]), u32::MAX);
        assert_eq!(moments([-1.0, -1.0]), 0);
        assert_eq!(moments([-1.0, 0.0]), 0xffff);
        assert_eq!(moments([0.0, 1.0]), 0xffff_0000);
        let mut random = Random(3);
        for _ in 0..10_000 {
            let (a, b) = (random.within(-1.0, 1.0) as f32, random.within(-1.0, 1.0) as f32);
            let (a, b) = (a.min(b), a.max(b));
            let want = (0..32).filter(|i| {
                let middle = (i * 2 + 1) as f32 / 32.0 - 1.0;
                a < middle && middle < b
            });
            assert_eq!(moments([a, b]), want.fold(0, |bits, i| bits | 1 << i), "{a} {b}");
        }
    }
}
