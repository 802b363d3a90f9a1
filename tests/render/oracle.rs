//! The renderer against a brute-force evaluation of the visibility rule (docs/math.md) in `f64`, pixel by pixel
//! over all surfels. The oracle shares no code with the passes: it intersects rays with planes and solves for u and v.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use crate::support::{UNLIT, object, posed, scene};
use glam::{DMat3, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use splatblur::backend::Backend;
use splatblur::backend::cpu::Cpu;
use splatblur::film::Aov;
use splatblur::model::Surfels;
use splatblur::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions};

const SIZE: [u32; 2] = [97, 61];
const FOVY: f64 = 50.0;
const NEAR: f64 = 0.05;
const EPSILON: f64 = 0.08;

/// What a pixel should be.
struct Expected {
    rgba: [f64; 4],
    depth: f64,
    /// A decision (inside or outside, hidden or not) hangs on rounding.
    fragile: bool,
}

struct Oracle {
    surfels: Surfels,
    eye: DVec3,
    low_pass: bool,
    two_sided: bool,
    /// Offset of the sample position from the pixel's centre.
    offset: [f32; 2],
}

struct Candidate {
    depth: f64,
    r2: f64,
    colour: DVec3,
    /// Counts for visibility: the plane is hit within the disc.
    solid: bool,
}

impl Oracle {
    fn pixel(&self, x: u32, y: u32) -> Expected {
        let [w, h] = SIZE.map(f64::from);
        let f = 0.5 * h / (0.5 * FOVY.to_radians()).tan();
        let [dx, dy] = self.offset.map(f64::from);
        let p = [f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy];
        let ray = DVec3::new((p[0] - 0.5 * w) / f, (0.5 * h - p[1]) / f, -1.0);
        let mut fragile = false;
        let near_one = |r2: f64| (r2 - 1.0).abs() < 2e-4;
        let mut candidates = Vec::new();
        for i in 0..self.surfels.len() {
            let c = self.surfels.position[i].as_dvec3() - self.eye;
            let (u, v) = (self.surfels.axis_u[i].as_dvec3(), self.surfels.axis_v[i].as_dvec3());
            let n = u.cross(v);
            if n.dot(c).abs() < 1e-6 * n.length() * c.length() {
                fragile = true;
            }
            if n.dot(c) >= 0.0 && !self.two_sided {
                continue;
            }
            // s ray = c + a u + b v
            let m = DMat3::from_cols(ray, -u, -v);
            let mut solid = None;
            if m.determinant() != 0.0 {
                let [s, a, b] = (m.inverse() * c).to_array();
                let r2 = a * a + b * b;
                fragile |= s > 0.5 * NEAR && near_one(r2);
                fragile |= (s / NEAR - 1.0).abs() < 1e-4 && r2 < 1.1;
                if s >= NEAR && r2 <= 1.0 {
                    solid = Some((s, r2));
                }
            }
            let depth = -c.z;
            let mut disc = None;
            if self.low_pass && depth >= NEAR {
                let (cx, cy) = (0.5 * w + f * c.x / depth, 0.5 * h - f * c.y / depth);
                let d2 = 0.5 * ((cx - p[0]).powi(2) + (cy - p[1]).powi(2));
                fragile |= near_one(d2);
                disc = (d2 <= 1.0).then_some(d2);
            }
            let colour = self.surfels.colour[i].as_dvec3();
            if let Some((depth, r2)) = solid {
                let r2 = disc.map_or(r2, |d2| d2.min(r2));
                candidates.push(Candidate { depth, r2, colour, solid: true });
            } else if let Some(r2) = disc {
                candidates.push(Candidate { depth, r2, colour, solid: false });
            }
        }
        let threshold = candidates.iter().filter(|c| c.solid).map(|c| c.depth + EPSILON).fold(f64::INFINITY, f64::min);
        let (mut sum, mut colour, mut depth) = (0.0, DVec3::ZERO, 0.0);
        for c in &candidates {
            fragile |= (c.depth / threshold - 1.0).abs() < 1e-5;
            if c.depth <= threshold {
                let weight = (-2.0 * c.r2).exp();
                sum += weight;
                colour += weight * c.colour;
                depth += weight * c.depth;
            }
        }
        let coverage = if threshold.is_finite() { 1.0 } else { sum.min(1.0) };
        if sum == 0.0 {
            return Expected { rgba: [0.0; 4], depth: f64::INFINITY, fragile };
        }
        let c = colour / sum * coverage;
        Expected { rgba: [c.x, c.y, c.z, coverage], depth: depth / sum, fragile }
    }
}

/// Surfels before, around and behind the camera, tiny to huge, facing anywhere, some elliptical, some nearly edge-on.
fn random_surfels(rng: &mut Pcg32, eye: DVec3) -> Surfels {
    let mut surfels = Surfels::default();
    for _ in 0..160 {
        let mut range = |low: f64, high: f64| rng.random_range(low..high);
        let depth = if range(0.0, 1.0) < 0.15 { range(-0.5, 0.5) } else { range(0.5, 6.0) };
        let spread = depth.abs() + 0.3;
        let c = eye + DVec3::new(range(-1.0, 1.0) * spread, range(-0.7, 0.7) * spread, -depth);
        let radius = range(-7.0, -0.5).exp2();
        let u = DVec3::new(range(-1.0, 1.0), range(-1.0, 1.0), range(-1.0, 1.0)).normalize() * radius;
        let helper = DVec3::new(range(-1.0, 1.0), range(-1.0, 1.0), range(-1.0, 1.0));
        let v = u.cross(helper).normalize() * radius * range(0.2, 1.0);
        surfels.position.push(c.as_vec3());
        surfels.axis_u.push(u.as_vec3());
        surfels.axis_v.push(v.as_vec3());
        surfels.normal.push(u.cross(v).normalize().as_vec3());
        surfels.colour.push(Vec3::new(range(0.0, 1.0) as f32, range(0.0, 1.0) as f32, range(0.0, 1.0) as f32));
    }
    surfels
}

/// Pixels that were compared, and how many were too fragile to be.
fn compare(seed: u64, prefilter: Prefilter, two_sided: bool, offset: [f32; 2]) -> (u32, u32) {
    let eye = DVec3::new(0.4, -0.3, 2.0);
    let surfels = random_surfels(&mut Pcg32::seed_from_u64(seed), eye);
    let mut cloud = object(surfels.clone());
    cloud.shape.surface_mut().unwrap().material = Some(UNLIT);
    cloud.epsilon = Some(EPSILON);
    let mut scene = scene(vec![cloud], SIZE, eye, FOVY);
    scene.camera.near = NEAR;
    scene.image.transparent = true;
    let options = RenderOptions {
        quality: BlurMode::Still { pixel_samples: 1 }.into(),
        prefilter,
        look: Look { filter: PixelFilter::Point, two_sided, aovs: vec![Aov::Depth], ..Look::default() },
        ..RenderOptions::default()
    };
    let mut frame = posed(&scene, 0, &options);
    frame.rasters[0].positions[0].raster.offset = offset;
    let picture = Cpu::default().render(frame).expect("the frame fits").picture;
    let oracle = Oracle { surfels, eye, low_pass: prefilter == Prefilter::Approx, two_sided, offset };
    let (mut compared, mut skipped) = (0, 0);
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let i = (y * SIZE[0] + x) as usize;
            let want = oracle.pixel(x, y);
            if want.fragile {
                skipped += 1;
                continue;
            }
            compared += 1;
            for channel in 0..4 {
                let (got, want) = (f64::from(picture.rgba[i][channel]), want.rgba[channel]);
                assert!(
                    (got - want).abs() < 2e-4,
                    "seed {seed}, pixel {x} {y}, channel {channel}: {got}, oracle {want}"
                );
            }
            let depth = f64::from(picture.layers[0].planes[0][i]);
            assert!(
                depth == want.depth || (depth / want.depth - 1.0).abs() < 1e-4,
                "seed {seed}, pixel {x} {y}: depth {depth}, oracle {}",
                want.depth
            );
        }
    }
    (compared, skipped)
}

#[test]
fn random_scenes_match_brute_force() {
    let (mut compared, mut skipped) = (0, 0);
    for seed in 0..12 {
        for prefilter in [Prefilter::None, Prefilter::Approx] {
            for two_sided in [false, true] {
                let offset = if seed % 2 == 0 { [0.0, 0.0] } else { [0.31, -0.17] };
                let (c, s) = compare(seed, prefilter, two_sided, offset);
                compared += c;
                skipped += s;
            }
        }
    }
    println!("{compared} pixels compared, {skipped} left out because a decision hangs on rounding");
    assert!(f64::from(skipped) < 0.03 * f64::from(compared), "{skipped} of {compared}");
}
