//! Swept splats against their definition, in f64 and by sampling time: a disc that moves in camera space, met by rays.

use std::sync::LazyLock;

use glam::{DMat2, DMat3, DVec2, DVec3, Mat3, Vec3};

use super::filter::Filter;
use super::hull::Hull;
use super::posed::Posed;
use super::project::sweep;
use crate::backend::cpu::paint::share::Share;
use crate::backend::cpu::project::SurfelView;
use crate::backend::cpu::published::ray as published;
use crate::frame::{PixelRect, PosedObject, Raster};
use crate::layout::{SweptFilter, SweptSplat};
use crate::math::sweep::{Path, Sweep, tube_weight};
use crate::model::paths::Paths;

const SIZE: u32 = 64;
const FOCAL: f64 = 60.0;
const NEAR: f64 = 0.5;
const STEPS: u32 = 400;

/// A disc with axes u, v about centre + tau motion; camera space, -z forward.
#[derive(Clone, Copy, Debug)]
struct Disc {
    centre: DVec3,
    motion: DVec3,
    u: DVec3,
    v: DVec3,
}

impl Disc {
    /// The splat, and the pixels that it may touch.
    fn splat(&self, ellipsoid: bool) -> Option<SweptSplat> {
        self.filtered(ellipsoid, 0.0).map(|(splat, _)| splat)
    }

    /// The splat and its kernel, filtered with a standard deviation of `sigma` pixels.
    fn filtered(&self, ellipsoid: bool, sigma: f32) -> Option<(SweptSplat, SweptFilter)> {
        let screen = |p: DVec3| (DVec3::new(FOCAL, -FOCAL, -1.0) * p).as_vec3();
        let posed =
            Posed { centre: screen(self.centre), motion: screen(self.motion), u: screen(self.u), v: screen(self.v) };
        let object = PosedObject {
            visible: true,
            near: 0.01,
            screen_from_model: Mat3::IDENTITY,
            screen_origin: Vec3::ZERO,
            centre_from_model: Mat3::IDENTITY,
            centre_origin: Vec3::ZERO,
            motion_from_model: Mat3::ZERO,
            motion_origin: Vec3::ZERO,
            elapsed: [0.0; 3],
            advance: [0.0; 3],
            pace: 0.0,
            moves: true,
            eye: Vec3::ZERO,
            screen_rate: Mat3::ZERO,
            screen_origin_rate: Vec3::ZERO,
            normal_matrix: Mat3::IDENTITY,
            normal_motion: Mat3::ZERO,
            world_from_model: Mat3::IDENTITY,
            world_origin: Vec3::ZERO,
            handedness: 1.0,
            epsilon: 0.0,
            spheres: 0.0,
            world_from_view: Mat3::IDENTITY,
        };
        let raster = Raster {
            size: [SIZE; 2],
            origin: [0; 2],
            first: [0; 2],
            readout: None,
            axis: [SIZE as f32 / 2.0; 2],
            focal: FOCAL as f32,
            low_pass: 0.0,
            sigma: 0.0,
            pixel: 0.0,
            offset: [0.0; 2],
        };
        let view = SurfelView {
            object: &object,
            eyes: object.eyes(),
            raster,
            pixels: PixelRect::of_image([SIZE; 2]),
            corner: [0; 2],
            wanted: None,
            near: NEAR as f32,
            centre_disc: 0.0,
            margin: 0.0,
            two_sided: true,
            paths: Paths::default(),
            clusters: None,
        };
        sweep(&view, ellipsoid, &posed, 0, Filter { sigma, share: Share::ONE })
    }

    /// Makes (u, v, depth), where the ray through pixel (x, y) meets the disc's plane, of minus the disc's centre.
    fn met_by(&self, x: u32, y: u32) -> DMat3 {
        let half = f64::from(SIZE) / 2.0;
        let ray = DVec3::new((f64::from(x) + 0.5 - half) / FOCAL, (half - f64::from(y) - 0.5) / FOCAL, -1.0);
        // centre + tau motion + u a0 + v a1 = depth ray
        DMat3::from_cols(self.u, self.v, -ray).inverse()
    }

    /// (u, v, depth) where the ray through pixel (x, y) meets the disc's plane at `tau`.
    fn met(&self, x: u32, y: u32, tau: f64) -> DVec3 {
        self.met_by(x, y) * -(self.centre + tau * self.motion)
    }

    /// Share of the time for which pixel (x, y) is covered, and tube weight. Only times at which the kernel shows the
    /// same side as at mid-interval count.
    fn by_sampling(&self, x: u32, y: u32, ellipsoid: bool) -> [f64; 2] {
        let (met_by, normal) = (self.met_by(x, y), self.u.cross(self.v));
        let facing = |tau: f64| normal.dot(self.centre + tau * self.motion) > 0.0;
        let mut sums = [0.0; 2];
        for i in 0..STEPS {
            let tau = -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(STEPS);
            let met = met_by * -(self.centre + tau * self.motion);
            let r2 = met.x * met.x + met.y * met.y;
            let limit = if ellipsoid { 1.0 - tau * tau } else { 1.0 };
            if met.z >= NEAR && r2 <= limit && facing(tau) == facing(0.0) {
                sums[0] += 1.0 / f64::from(STEPS);
                sums[1] += (-2.0 * r2).exp() / f64::from(STEPS);
            }
        }
        sums
    }
}

/// Share of the time and tube weight by the splat's linear forms, as the attribute pass has them.
fn by_splat(splat: &SweptSplat, x: u32, y: u32) -> [f64; 2] {
    let (x, y) = (x as f32 + 0.5 - splat.reference[0], y as f32 + 0.5 - splat.reference[1]);
    let form = |c: [f32; 3]| c[0] * x + (c[1] * y + c[2]);
    let w = form(splat.inverse_depth);
    let path = Path { at: [form(splat.u), form(splat.v)], rate: [form(splat.u_rate), form(splat.v_rate)], w };
    let tube = Sweep::tube(path);
    let [mut first, mut last] = tube.covered();
    let k: f32 = (0..3).map(|i| splat.inverse_depth[i] * splat.motion[i]).sum();
    let bound = (NEAR as f32 * w - 1.0) / k;
    if k > 0.0 {
        first = first.max(bound);
    } else if k < 0.0 {
        last = last.min(bound);
    }
    if w > 0.0 && first < last {
        [f64::from(last - first) / 2.0, f64::from(tube_weight(tube.mean([first, last]), [first, last]))]
    } else {
        [0.0, 0.0]
    }
}

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(2.0 * self.next() - 1.0, 2.0 * self.next() - 1.0, 2.0 * self.next() - 1.0)
    }
}

fn random_disc(random: &mut Random) -> Disc {
    let depth = 1.0 + 6.0 * random.next();
    Disc {
        centre: DVec3::new(0.5 * depth, 0.5 * depth, 1.0) * random.vector() * DVec3::new(1.0, 1.0, 0.0)
            - depth * DVec3::Z,
        motion: random.vector() * 10_f64.powf(3.0 * random.next() - 2.5),
        u: random.vector() * 0.6 * random.next(),
        v: random.vector() * 0.6 * random.next(),
    }
}

/// Kernels of all shapes and motions, also through the camera plane: linear forms, bounds and hulls.
#[test]
fn splats_are_the_moving_discs() {
    let mut random = Random(11);
    let (mut touched, mut crossing, mut wasted) = (0, 0, [0_u64; 2]);
    for case in 0..400 {
        let disc = random_disc(&mut random);
        let splats = [disc.splat(false), disc.splat(true)];
        let hulls = splats.map(|splat| splat.map(|splat| (splat.bounds.map(u32::from), Hull::of(&splat))));
        for y in 0..SIZE {
            let columns = hulls.map(|hull| {
                let ([_, _, y0, y1], hull) = hull.filter(|([_, _, y0, y1], _)| (*y0..=*y1).contains(&y))?;
                let _ = (y0, y1);
                Some(hull.columns(y as f32, y as f32))
            });
            for x in 0..SIZE {
                let wanted = [false, true].map(|ellipsoid| disc.by_sampling(x, y, ellipsoid));
                for (kind, (columns, want)) in columns.iter().zip(wanted).enumerate() {
                    let bounded = columns.is_some_and(|[x0, x1]| (x0..=x1).contains(&(x as i32)));
                    assert!(bounded || want[0] == 0.0, "case {case}, kind {kind}, pixel {x} {y}: {want:?}, {disc:?}");
                    wasted[usize::from(want[0] > 0.0)] += u64::from(bounded && kind == 0);
                }
                let Some(splat) = &splats[0] else { continue };
                let (want, got) = (wanted[0], by_splat(splat, x, y));
                touched += u64::from(want[0] > 0.0);
                crossing += u64::from(want[0] > 0.0 && splat.reference == [SIZE as f32 / 2.0; 2]);
                for i in 0..2 {
                    // Half a step at each end, and rounding in a grazing splat.
                    let tolerance = 1.0 / f64::from(STEPS) + 1e-3;
                    assert!(
                        (want[i] - got[i]).abs() < tolerance,
                        "case {case} [{i}] {x} {y}: {got:?} {want:?} {disc:?}"
                    );
                }
            }
        }
    }
    println!("{touched} pixels covered, {crossing} by kernels at the camera plane; tested in vain and not: {wasted:?}");
    assert!(touched > 20_000 && crossing > 500);
    // 49,873 are tested in vain; without boxes for kernels at the camera plane they are far more.
    assert!(wasted[0] < wasted[1], "{wasted:?}");
}

impl Disc {
    /// The kernel filtered at `tau`, as full EWA filters one at an instant (docs/math.md, eq. 4a and 4b, with all of
    /// q in perspective): the share of the squared radius, q / 4, at pixel (x, y), and the peak.
    fn filtered_by_instants(&self, x: u32, y: u32, tau: f64, sigma: f64) -> [f64; 2] {
        let at = self.centre + tau * self.motion;
        let depth = -at.z;
        let pixel = |p: DVec3| DVec2::new(p.x, -p.y) * (FOCAL / -p.z);
        let half = f64::from(SIZE) / 2.0;
        let d = DVec2::new(f64::from(x) + 0.5 - half, f64::from(y) + 0.5 - half) - pixel(at);
        let column = |a: DVec3| DVec2::new(a.x - at.x / depth * -a.z, -a.y + at.y / depth * -a.z) * (FOCAL / depth);
        let j = DMat2::from_cols(column(self.u), column(self.v));
        let unfiltered = (j * j.transpose()) * 0.25;
        let variance = unfiltered + DMat2::from_diagonal(DVec2::splat(sigma * sigma));
        let p = variance.inverse() * d;
        let met = (j.transpose() * p) * 0.25;
        let nearer = 1.0 - DVec2::new(-self.u.z, -self.v.z).dot(met) / depth;
        let q = (4.0 * met.length_squared() + sigma * sigma * p.length_squared()) / (nearer * nearer);
        [q / 4.0, (unfiltered.determinant() / variance.determinant()).sqrt()]
    }
}

/// Filtered kernels at mid-interval are those of full EWA at an instant, also nearly edge-on. Over the interval they
/// move as discs do, within the bounds.
#[test]
fn filtered_kernels_are_those_of_instants() {
    let mut random = Random(17);
    let (mut met, mut worst, mut nearly_edge_on) = (0, [0.0_f64; 2], 0);
    for case in 0..600 {
        let disc = Disc { motion: 0.2 * random.vector(), ..random_disc(&mut random) };
        let sigma = 0.1 + random.next();
        let Some((splat, filter)) = disc.filtered(false, sigma as f32) else { continue };
        if filter.is_unfiltered() {
            continue;
        }
        let normal = disc.u.cross(disc.v).normalize();
        nearly_edge_on += u32::from(normal.dot(disc.centre.normalize()).abs() < 0.1);
        let bounds = splat.bounds.map(u32::from);
        let hull = Hull::of(&splat);
        for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
            let (dx, dy) = (
                f64::from(x) + 0.5 - f64::from(splat.reference[0]),
                f64::from(y) + 0.5 - f64::from(splat.reference[1]),
            );
            let plain = |c: [f32; 2]| f64::from(c[0]) * dx + f64::from(c[1]) * dy;
            let form = |c: [f32; 3]| plain([c[0], c[1]]) + f64::from(c[2]);
            let w = plain(filter.inverse_depth) + f64::from(splat.inverse_depth[2]);
            let r2 = |tau: f64| {
                let at = DVec2::new(
                    plain(filter.u) + tau * form(filter.u_rate),
                    plain(filter.v) + tau * form(filter.v_rate),
                );
                at.length_squared() / (w * w)
            };
            let [columns, rows] = [[bounds[0], bounds[1]], [bounds[2], bounds[3]]];
            let [left, right] = hull.columns(y as f32, y as f32);
            let bounded = (columns[0]..=columns[1]).contains(&x)
                && (rows[0]..=rows[1]).contains(&y)
                && (left..=right).contains(&(x as i32));
            for tau in [-1.0, -0.4, 0.3, 1.0] {
                assert!(bounded || w <= 0.0 || r2(tau) > 1.0, "case {case} at {tau}: {x} {y}, {disc:?}");
            }
            let [want, peak] = disc.filtered_by_instants(x, y, 0.0, sigma);
            if w <= 0.0 || want > 1.2 {
                continue;
            }
            met += 1;
            worst[0] = worst[0].max((r2(0.0) - want).abs());
            worst[1] = worst[1].max((f64::from(filter.peak) - peak).abs());
        }
    }
    println!("{met} rays, {nearly_edge_on} nearly edge-on: worst {worst:?}");
    assert!(met > 20_000 && nearly_edge_on > 20);
    assert!(worst[0] < 1e-3 && worst[1] < 1e-4, "{worst:?}");
}

/// The integral of exp(-2 r^2) over the unit ball (`power` 2) or disc (1), by the midpoint rule over the radius.
fn of_ball(power: i32) -> f64 {
    let size = if power == 2 { 2.0 * std::f64::consts::TAU } else { std::f64::consts::TAU };
    let radius = |i: u32| (f64::from(i) + 0.5) / 1e4;
    (0..10_000).map(|i| size * radius(i).powi(power) * (-2.0 * radius(i).powi(2)).exp() / 1e4).sum()
}

/// Both, made once: each takes ten thousand exponentials.
static OF_DISC_AND_BALL: LazyLock<[f64; 2]> = LazyLock::new(|| [1, 2].map(of_ball));

impl Disc {
    /// Wolf 2008, C.38, by its definition: the midpoint rule over the length of the ray, in camera space, of the
    /// Gaussian C.16 within the ellipsoid C.17. D makes the integral over space that of the unmoved kernel of peak 1
    /// over its plane.
    fn line_integral(&self, x: u32, y: u32) -> f64 {
        let half = f64::from(SIZE) / 2.0;
        let ray = DVec3::new((f64::from(x) + 0.5 - half) / FOCAL, (half - f64::from(y) - 0.5) / FOCAL, -1.0);
        let axes = DMat3::from_cols(self.u, self.v, self.motion);
        let into_ball = axes.inverse();
        let (from, along) = (into_ball * -self.centre, into_ball * ray);
        // The part of the ray, in depth, within the unit ball.
        let middle = -from.dot(along) / along.length_squared();
        let off = 1.0 - (from + along * middle).length_squared();
        if off <= 0.0 {
            return 0.0;
        }
        let reach = off.sqrt() / along.length();
        let steps = 2000;
        let depth = |i: u32| middle + reach * (2.0 * (f64::from(i) + 0.5) / f64::from(steps) - 1.0);
        let density = |depth: f64| {
            let far = depth >= NEAR;
            if far { (-2.0 * (from + along * depth).length_squared()).exp() } else { 0.0 }
        };
        let sum: f64 = (0..steps).map(|i| density(depth(i))).sum();
        let [of_disc, of_ball] = *OF_DISC_AND_BALL;
        let d = of_disc * self.u.cross(self.v).length() / (of_ball * axes.determinant().abs());
        d * sum * 2.0 * reach * ray.length() / f64::from(steps)
    }
}

#[test]
fn line_weights_are_integrals_along_the_ray() {
    let mut random = Random(5);
    let (mut met, mut worst) = (0, 0.0_f64);
    let sight = published::RaySettings {
        source_samples: 1,
        slope: 0.0,
        sum: true,
        axis: [SIZE as f32 / 2.0; 2],
        focal: FOCAL as f32,
    };
    for case in 0..600 {
        let disc = random_disc(&mut random);
        let Some(splat) = disc.splat(true) else { continue };
        let ray = published::Ray::of(&splat, NEAR as f32, 0.0);
        let normal = disc.u.cross(disc.v);
        for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
            let mut lanes = published::Lanes::default();
            ray.meet::<true, false>(&splat, &sight, 0, [x as f32, y as f32], SIZE as f32, &mut lanes, 0);
            // Rays that meet the other side than that of mid-interval see no kernel; rays along the plane round.
            let there = disc.met(x, y, 0.0).z;
            let half = f64::from(SIZE) / 2.0;
            let towards =
                DVec3::new((f64::from(x) + 0.5 - half) / FOCAL, (half - f64::from(y) - 0.5) / FOCAL, -1.0).normalize();
            let cosine = normal.normalize().dot(towards).abs();
            if there < 0.0 || cosine < 0.02 {
                continue;
            }
            let (got, want) = (f64::from(lanes.weight[0]), disc.line_integral(x, y));
            met += u32::from(want > 0.0);
            assert_eq!(lanes.weight[0], lanes.loose[0]);
            let error = (got - want).abs() * cosine;
            assert!(error < 2e-3, "case {case} {x} {y}: {got}, not {want}; cosine {cosine}, {disc:?}");
            worst = worst.max(error);
        }
    }
    println!("{met} rays, worst {worst:.1e}");
    assert!(met > 20_000);
}

/// Wolf 2008, C.3: the motion turns from the disc's plane to its normal, at any speed down to none; nothing jumps.
#[test]
fn no_jump_through_the_degenerate_cases() {
    let u = DVec3::new(0.5, 0.1, 0.2);
    let v = DVec3::new(-0.15, 0.45, 0.1);
    let normal = u.cross(v).normalize();
    let along = (u + 0.3 * v).normalize();
    let total = |motion: DVec3| {
        let disc = Disc { centre: DVec3::new(0.2, -0.1, -4.0), motion, u, v };
        let splat = disc.splat(false).expect("a splat in view");
        let mut sums = [0.0; 2];
        for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
            let [share, weight] = by_splat(&splat, x, y);
            sums[0] += share;
            sums[1] += weight;
        }
        sums
    };
    let at_rest = total(DVec3::ZERO);
    for speed in [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0] {
        let mut before: Option<[f64; 2]> = None;
        for step in 0..=2000 {
            let angle = std::f64::consts::TAU * f64::from(step) / 2000.0;
            let now = total((along * angle.cos() + normal * angle.sin()) * speed);
            if speed <= 1e-4 {
                // Pixels on the rim flip; of about 140 that are covered, at the most one.
                assert!((now[0] - at_rest[0]).abs() < 1.0 + 1e3 * speed, "{speed} {angle}: {now:?} {at_rest:?}");
            }
            if let Some(before) = before {
                for i in 0..2 {
                    // A step turns the motion by 0.003: less than 1 % of the rim's pixels.
                    let change = (now[i] - before[i]).abs();
                    assert!(change < 0.01 * at_rest[i], "{speed} at {angle}: {before:?} {now:?}");
                }
            }
            before = Some(now);
        }
    }
}
