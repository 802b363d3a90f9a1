//! Clusters that are left out, against the projection of all surfels.

use std::sync::Arc;

use glam::Quat;

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
        let object = PosedObject {
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
            world_from_model: linear,
            world_origin: origin,
            handedness,
            epsilon: 0.0,
        };
        let raster = Raster {
            size: [64; 2],
            origin: [0; 2],
            first: [0; 2],
            readout: None,
            axis: [32.0; 2],
            focal: 90.0,
            low_pass: std::f32::consts::SQRT_2,
            sigma: 0.0,
            footprint: 0.0,
            pixel: 0.0,
            offset: [0.3, -0.4],
        };
        let whole = View {
            object: &object,
            eyes: object.eyes(),
            raster,
            pixels: PixelRect::of_image([64; 2]),
            corner: [0; 2],
            wanted: None,
            near: 0.1,
            low_pass: case % 2 == 0,
            margin: 0.0,
            two_sided: case % 5 == 0,
            paths: Paths::default(),
            clusters: None,
        };
        let view = View { clusters: Some(&clusters), ..whole };
        let (mut want, mut got) = (Vec::new(), Vec::new());
        project(&whole, &ball, 0..ball.len(), &mut want);
        project(&view, &ball, 0..ball.len(), &mut got);
        assert!(got == want, "case {case}: {} of {} splats", got.len(), want.len());
        let count = ball.len().div_ceil(CLUSTER_SURFELS);
        all += count;
        left_out += (0..count).filter(|&cluster| !view.may_show(cluster)).count();
        splats += want.len();
    }
    println!("{left_out} of {all} clusters left out, {splats} splats");
    assert!(left_out * 3 > all && splats > 100_000);
}
