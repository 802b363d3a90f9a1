//! Light of environments against integrals over the sphere.

use super::super::Environment;
use super::*;
use crate::sampling::light_point;
use crate::shading::smooth_light;

/// A picture of `of`, the mean of 8 x 8 places in each pixel.
fn map(width: usize, of: impl Fn(DVec3) -> DVec3) -> LatLong {
    let pixel = |i: usize| {
        let mut sum = DVec3::ZERO;
        for j in 0..64_usize {
            let [x, y] = [(i % width, j % 8), (i / width, j / 8)].map(|(k, j)| k as f64 + (j as f64 + 0.5) / 8.0);
            let (ring, height) = libm::sincos(y / (width / 2) as f64 * PI);
            let (sin, cos) = libm::sincos((x / width as f64 - 0.5) * TAU);
            sum += of(DVec3::new(ring * sin, height, -ring * cos));
        }
        (sum / 64.0).as_vec3().to_array()
    };
    LatLong::new(width, (0..width * width / 2).map(pixel).collect()).unwrap()
}

/// Radiance 10 in the cap of `degrees` around an axis, over `ground`.
fn cap(degrees: f64, ground: f64) -> impl Fn(DVec3) -> DVec3 {
    let (axis, least) = (axis(), degrees.to_radians().cos());
    move |d| DVec3::splat(if d.dot(axis) >= least { 10.0 } else { ground })
}

fn axis() -> DVec3 {
    DVec3::new(0.3, 0.8, -0.5).normalize()
}

/// What a white surface shows whose normal is `angle` away from the axis of [`cap`]: an integral over rings.
fn shown(degrees: f64, ground: f64, angle: f64) -> f64 {
    let half = degrees.to_radians();
    let (sin, cos) = angle.sin_cos();
    let (rings, parts) = (200, 720);
    let mut sum = 0.0;
    for ring in 0..rings {
        let polar = half * (f64::from(ring) + 0.5) / f64::from(rings);
        let height = polar.cos() * cos;
        let cosines = (0..parts).map(|part| {
            let turn = (f64::from(part) + 0.5) / f64::from(parts) * TAU;
            (height + polar.sin() * sin * turn.cos()).max(0.0)
        });
        sum += cosines.sum::<f64>() * polar.sin();
    }
    ground + (10.0 - ground) * sum * half / f64::from(rings) * TAU / f64::from(parts) / PI
}

/// Normals at all angles to the axis, in several planes.
fn normals() -> impl Iterator<Item = (DVec3, f64)> {
    (0..=36).flat_map(|step| {
        let angle = f64::from(step) * PI / 36.0;
        (0..3).map(move |turn| {
            let (u, v) = axis().any_orthonormal_pair();
            let turn = f64::from(turn) * 2.1;
            (axis() * angle.cos() + (u * turn.cos() + v * turn.sin()) * angle.sin(), angle)
        })
    })
}

/// What a white surface shows of `count` directions.
fn drawn(environment: &Environment, normal: DVec3, count: u32) -> DVec3 {
    let light = |number: u32| {
        let [down, across, _] = light_point(number, 1, 0);
        let (towards, light) = environment.drawn([down, across]);
        light * normal.dot(towards).max(0.0)
    };
    (0..count).map(light).sum::<DVec3>() / f64::from(count)
}

#[test]
fn directions_light_as_caps_do() {
    for (degrees, ground) in [(5.0, 0.0), (5.0, 1.0), (30.0, 0.0), (30.0, 1.0), (1.0, 10.0)] {
        let environment = Environment::new(map(512, cap(degrees, ground)));
        let largest = shown(degrees, ground, 0.0);
        let mut worst = 0.0_f64;
        for (normal, angle) in normals() {
            let got = drawn(&environment, normal, 1024);
            worst = worst.max((got.x - shown(degrees, ground, angle)).abs() / largest);
        }
        eprintln!("cap of {degrees} over {ground}: {worst:.5} of the largest");
        assert!(worst < 1e-2, "cap of {degrees} over {ground}: {worst}");
    }
}

/// Environments without higher harmonics are exact: of degree n they keep 1, 2/3 and 1/4.
#[test]
fn smooth_environments_have_nine_harmonics() {
    let [a, b] = [DVec3::new(0.4, -0.2, 0.3), DVec3::new(0.2, 0.3, -0.4)];
    let second = |d: DVec3| {
        let pole = 2.0 * d.y * d.y - d.x * d.x - d.z * d.z;
        DVec3::new(d.x * d.y - 0.3 * d.y * d.z, d.x * d.x - d.z * d.z + 0.5 * d.x * d.z, 0.4 * pole)
    };
    let mut environment = Environment::new(map(256, |d| DVec3::splat(2.0) + a * d.x + b * (d.y - d.z) + second(d)));
    for rotation in [0.0_f64, 0.7, -2.0] {
        (environment.rotation, environment.intensity) = (rotation, 1.5);
        let terms = environment.harmonics();
        for (normal, _) in normals() {
            // The environment turns about +y, so the normal turns back.
            let n = glam::DQuat::from_rotation_y(-rotation) * normal;
            let first = a * n.x + b * (n.y - n.z);
            let want = (DVec3::splat(2.0) + first * (2.0 / 3.0) + second(n) * 0.25) * 1.5;
            let got = Vec3::from(smooth_light(&terms, normal.as_vec3().to_array())).as_dvec3();
            assert!(got.abs_diff_eq(want, 2e-4), "turned by {rotation}, {normal}: {got}, not {want}");
        }
    }
}

/// Nine harmonics of a small light are wrong by up to .094 of the largest value (a right angle away); they are not
/// below 0.
#[test]
fn harmonics_are_never_negative() {
    for (degrees, ground, most) in [(5.0, 0.0, 0.095), (5.0, 1.0, 0.095), (30.0, 0.0, 0.08), (30.0, 1.0, 0.08)] {
        let environment = Environment::new(map(512, cap(degrees, ground)));
        let terms = environment.harmonics();
        let largest = shown(degrees, ground, 0.0);
        let (mut worst, mut least) = (0.0_f64, f64::INFINITY);
        for (normal, angle) in normals() {
            let got = f64::from(smooth_light(&terms, normal.as_vec3().to_array())[0]);
            worst = worst.max((got - shown(degrees, ground, angle)).abs() / largest);
            least = least.min(got);
        }
        eprintln!("cap of {degrees} over {ground}: {worst:.4} of the largest, least {least:.4}");
        assert!(worst < most && least >= 0.0, "cap of {degrees} over {ground}: {worst}, least {least}");
    }
}

#[test]
fn light_turns_with_the_environment() {
    let mut environment = Environment::new(map(256, cap(10.0, 0.0)));
    for rotation in [0.0, 0.5, 2.0] {
        environment.rotation = rotation;
        for number in 0..64 {
            let [down, across, _] = light_point(number, 3, 1);
            let (towards, _) = environment.drawn([down, across]);
            assert!((towards.length() - 1.0).abs() < 1e-12);
            let seen = environment.radiance(towards).x;
            assert!(seen > 1.0, "turned by {rotation}: {towards} shows {seen}");
        }
        // The brightest normal is the axis of the cap, turned.
        let turned = glam::DQuat::from_rotation_y(rotation) * axis();
        let terms = environment.harmonics();
        let at = |n: DVec3| smooth_light(&terms, n.as_vec3().to_array())[0];
        for (normal, _) in normals() {
            assert!(at(normal) <= 1.001 * at(turned), "{normal} is brighter than {turned}");
        }
    }
}

/// One pixel a million times brighter than all others, and coloured: no direction brings more than three times the
/// mean of the whole.
#[test]
fn one_bright_pixel() {
    let mut pixels = vec![[1.0, 1.0, 1.0]; 64 * 32];
    pixels[10 * 64 + 20] = [1e6, 0.0, 0.0];
    let environment = Environment::new(LatLong::new(64, pixels).unwrap());
    let solid = |y: f64| ((PI * y / 32.0).cos() - (PI * (y + 1.0) / 32.0).cos()) * TAU / 64.0;
    let own = solid(10.0);
    let all = 1e6 / 3.0 * own + 2.0 * TAU - own;
    let mut sum = DVec3::ZERO;
    for number in 0..1 << 16 {
        let [down, across, _] = light_point(number, 1, 0);
        let (towards, light) = environment.drawn([down, across]);
        assert!(towards.is_finite() && light.max_element() <= 3.0001 * all / PI, "{light}");
        sum += light / 65_536.0;
    }
    let want = DVec3::new(1e6 * own + 2.0 * TAU - own, 2.0 * TAU - own, 2.0 * TAU - own) / PI;
    assert!((sum.x / want.x - 1.0).abs() < 1e-3, "{sum}, not {want}");
    // Of all points in 600 one is in the dark rest.
    assert!((sum.y / want.y - 1.0).abs() < 0.2, "{sum}, not {want}");
}

#[test]
fn a_black_environment_is_no_light() {
    let dark = Environment::new(LatLong::new(4, vec![[0.0; 3]; 8]).unwrap()).lighting();
    assert!(!dark.shines());
    assert_eq!(dark.harmonics(), [Vec3::ZERO; 9]);
    let mut lit = Environment::new(LatLong::new(4, vec![[0.0, 1e-30, 0.0]; 8]).unwrap()).lighting();
    assert!(lit.shines() && lit.drawn([0.999_999_999, 0.999_999_999]).0.is_finite());
    lit.intensity = 0.0;
    assert!(!lit.shines());
}
