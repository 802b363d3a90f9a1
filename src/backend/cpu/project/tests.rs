//! Clusters that are left out, against the projection of all surfels.

use std::sync::Arc;

use glam::{Mat3, Quat};

use super::*;
use crate::backend::clusters::ClusterStore;
use crate::math::random::Random;

/// A sphere of round surfels.
fn ball(n: u32) -> Surfels {
    let mut surfels = Surfels::default();
    for i in 0..n {
        let z = 1.0 - 2.0 * (i as f32 + 0.5) / n as f32;
        let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
        let normal = Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
        let (u, v) = normal.any_orthonormal_pair();
        surfels.position.push(normal);
        surfels.axis_u.push(u * 4.0 / (n as f32).sqrt());
        surfels.axis_v.push(v * 4.0 / (n as f32).sqrt());
        surfels.normal.push(normal);
        surfels.colour.push(Vec3::ONE);
    }
    surfels.spatially_ordered()
}

/// An object at rest.
fn posed(
    screen_from_model: Mat3,
    screen_origin: Vec3,
    world_from_model: Mat3,
    world_origin: Vec3,
    handedness: f32,
) -> PosedObject {
    PosedObject {
        visible: true,
        near: 0.01,
        screen_from_model,
        screen_origin,
        centre_from_model: screen_from_model,
        centre_origin: screen_origin,
        motion_from_model: Mat3::ZERO,
        motion_origin: Vec3::ZERO,
        elapsed: [0.0; 3],
        advance: [0.0; 3],
        pace: 0.0,
        moves: false,
        eye: -(screen_from_model.inverse() * screen_origin),
        screen_rate: Mat3::ZERO,
        screen_origin_rate: Vec3::ZERO,
        normal_matrix: Mat3::IDENTITY,
        normal_motion: Mat3::ZERO,
        world_from_model,
        world_origin,
        handedness,
        epsilon: 0.0,
        spheres: 0.0,
        world_from_view: Mat3::IDENTITY,
    }
}

/// A raster of 64 x 64 pixels.
fn raster() -> Raster {
    Raster {
        size: [64; 2],
        origin: [0; 2],
        first: [0; 2],
        readout: None,
        axis: [32.0; 2],
        focal: 90.0,
        low_pass: std::f32::consts::SQRT_2,
        sigma: 0.0,
        pixel: 0.0,
        offset: [0.3, -0.4],
    }
}

/// All of the raster.
fn view_of(object: &PosedObject) -> SurfelView<'_> {
    SurfelView {
        object,
        eyes: object.eyes(),
        raster: raster(),
        pixels: PixelRect::of_image([64; 2]),
        corner: [0; 2],
        wanted: None,
        near: 0.1,
        centre_disc: 0.0,
        margin: 0.0,
        two_sided: false,
        paths: Paths::default(),
        clusters: None,
    }
}

/// Clusters that are left out hold no splat: near and far, partly off the image, mirrored, seen from within, and with
/// surfels that are not finite.
#[test]
fn clusters_that_are_left_out_hold_nothing() {
    let mut random = Random(5);
    let mut ball = ball(20_000);
    for wild in [f32::NAN, f32::INFINITY, 1e30] {
        let at = (random.next() * ball.len() as f32) as usize;
        ball.position[at].x = wild;
        let other = ball.len() - 1 - at;
        ball.axis_u[other].y = wild;
    }
    let ball = Arc::new(ball);
    let clusters = ClusterStore::default().of(&ball);
    let (mut left_out, mut all, mut splats) = (0, 0, 0);
    for case in 0..200 {
        let mut linear = Mat3::from_quat(Quat::from_vec4(random.vector().extend(random.next()).normalize()));
        let handedness = if case % 3 == 0 { -1.0 } else { 1.0 };
        linear.x_axis *= handedness * (0.5 + random.next());
        let origin = random.vector() * Vec3::new(1.5, 1.5, 3.0) - 2.5 * Vec3::Z;
        let k = Mat3::from_diagonal(Vec3::new(90.0, -90.0, -1.0));
        let (screen_from_model, screen_origin) = (k * linear, k * origin);
        let object = posed(screen_from_model, screen_origin, linear, origin, handedness);
        let centre_disc = if case % 2 == 0 { raster().low_pass } else { 0.0 };
        let whole = SurfelView { centre_disc, two_sided: case % 5 == 0, ..view_of(&object) };
        let view = SurfelView { clusters: Some(&clusters), ..whole };
        let (mut want, mut got) = (Vec::new(), Vec::new());
        project(&whole, &ball, 0..ball.len(), &mut want);
        project(&view, &ball, 0..ball.len(), &mut got);
        assert!(got == want, "case {case}: {} of {} splats", got.len(), want.len());
        let count = ball.len().div_ceil(RUN);
        all += count;
        left_out += (0..count).filter(|&cluster| !view.may_show(cluster)).count();
        splats += want.len();
    }
    println!("{left_out} of {all} clusters left out, {splats} splats");
    assert!(left_out * 3 > all && splats > 100_000);
}

/// Discs around the eye: what reaches the camera plane is bounded by what it shows before `near`, and left out where it
/// lies outside a side plane of the view. The truth meets each ray with the disc's plane, in f64.
#[test]
fn discs_at_the_camera_plane_are_bounded_by_what_they_show() {
    const NEAR: f64 = 0.1;
    const DISCS: usize = 12_000;
    let mut random = Random(23);
    let mut surfels = Surfels::default();
    for i in 0..DISCS {
        let reach = [0.03, 0.3, 3.0][i % 3];
        let (u, v) = random.vector().normalize().any_orthonormal_pair();
        surfels.position.push(random.vector() * (0.2 + reach));
        surfels.axis_u.push(u * reach * (0.2 + random.next()));
        surfels.axis_v.push(v * reach * (0.2 + random.next()));
        surfels.normal.push(Vec3::Z);
        surfels.colour.push(Vec3::ONE);
    }
    let k = Mat3::from_diagonal(Vec3::new(90.0, -90.0, -1.0));
    let object = posed(k, Vec3::ZERO, Mat3::IDENTITY, Vec3::ZERO, 1.0);
    let raster = raster();
    for margin in [0.0, 2.0] {
        let view = SurfelView { near: NEAR as f32, margin, two_sided: true, ..view_of(&object) };
        let mut splats = Vec::new();
        project(&view, &surfels, 0..DISCS, &mut splats);
        let mut bounds = vec![None; DISCS];
        for splat in &splats {
            bounds[splat.surfel as usize] = Some(splat.bounds);
        }
        let (mut crossing, mut pixels, mut outside) = (0, [0_u64; 2], 0);
        for (i, of_disc) in bounds.iter().enumerate() {
            let column = |p: Vec3| (k * p).as_dvec3();
            let (c, u, v) = (column(surfels.position[i]), column(surfels.axis_u[i]), column(surfels.axis_v[i]));
            let is_crossing = c.z <= 0.0 || u.z * u.z + v.z * v.z > 0.999 * c.z * c.z;
            // Each disc is inside the plane of its own side of the image, or it is left out.
            let slope = |axis: usize, pixel: f64| pixel - f64::from(raster.axis[axis] - raster.offset[axis]);
            for (axis, pixel, side) in [(0, 0.5, -1.0), (0, 63.5, 1.0), (1, 0.5, -1.0), (1, 63.5, 1.0)] {
                let slope = slope(axis, pixel) + side * (f64::from(margin) + 0.01);
                let along = |p: glam::DVec3| side * (slope * p.z - p[axis]);
                let beyond = along(c) + along(u).hypot(along(v)) < -1e-3;
                assert!(!(beyond && of_disc.is_some()), "disc {i} is outside on axis {axis}: {of_disc:?}");
                outside += u32::from(beyond);
            }
            crossing += u32::from(is_crossing && of_disc.is_some());
            let inverse = glam::DMat3::from_cols(u, v, c).inverse();
            for (x, y) in (0..64_u16).flat_map(|y| (0..64_u16).map(move |x| (x, y))) {
                let ray = glam::DVec3::new(slope(0, f64::from(x) + 0.5), slope(1, f64::from(y) + 0.5), 1.0);
                // ray * depth = a u + b v + c
                let met = inverse * ray;
                let (depth, a, b) = (1.0 / met.z, met.x / met.z, met.y / met.z);
                let covers = depth >= NEAR && a * a + b * b <= 1.0;
                let within =
                    of_disc.is_some_and(|[x0, x1, y0, y1]: [u16; 4]| (x0..=x1).contains(&x) && (y0..=y1).contains(&y));
                // A disc seen edge-on is lost in rounding.
                let edge_on = met.z.abs() * c.length() > 1e4;
                assert!(within || !covers || edge_on, "disc {i} covers {x} {y}, at depth {depth}: {of_disc:?}");
                pixels[0] += u64::from(is_crossing && within && margin == 0.0);
            }
            if is_crossing && of_disc.is_some() && margin == 0.0 {
                // The box about what shows, on the image or beside it.
                let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
                let rim = |k: u32| c + u * (f64::from(k) * 1e-3).cos() + v * (f64::from(k) * 1e-3).sin();
                for k in 0..6284 {
                    let (p, q) = (rim(k), rim(k + 1));
                    let cut = p + (q - p) * ((NEAR - p.z) / (q.z - p.z));
                    let at = if (p.z < NEAR) == (q.z < NEAR) { p } else { cut };
                    if at.z > NEAR - 1e-9 {
                        for axis in 0..2 {
                            ends[axis] = [ends[axis][0].min(at[axis] / at.z), ends[axis][1].max(at[axis] / at.z)];
                        }
                    }
                }
                let size = |axis: usize| {
                    let pixel = |place: f64| place - slope(axis, 0.5);
                    (pixel(ends[axis][1]).floor().min(63.0) - pixel(ends[axis][0]).ceil().max(0.0) + 1.0).max(0.0)
                };
                pixels[1] += (size(0) * size(1)) as u64;
            }
        }
        println!(
            "{crossing} discs at the camera plane, {outside} planes that leave one out, pixels of boxes {pixels:?}"
        );
        assert!(crossing > 500 && outside > 1_000);
        // The octagon is a little wider than the disc.
        assert!(pixels[0] as f64 <= 1.1 * pixels[1] as f64);
    }
}
