//! Flow against closed forms: the ray of a pixel, its meeting with a plane or a ball, the motion, and the projection,
//! all written down here once more.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use glam::{DMat3, DVec3, Quat, Vec3};
use splatblur::model::{Gaussians, VelocityUnit};
use splatblur::reference::{Flow, ReferenceOptions, flows};
use splatblur::scene::{Motion, Object, PointMotion, Scene, Sphere};

use crate::support::{UNLIT, object, round_surfels, scene};

const SIZE: [u32; 2] = [64, 48];
/// 24 / tan(20 degrees), pixels.
const FOCAL: f64 = 65.939_458_066_911_9;
const DEPTH: f64 = 4.0;
/// The bound, pixels. Seen: at most 3.6e-6, where a motion of 74 pixels is rounded to f32.
const CLOSE: f64 = 1e-3;

/// Direction of depth 1 through the middle of a pixel, before a camera that looks along -z.
fn direction(x: u32, y: u32) -> DVec3 {
    DVec3::new((f64::from(x) + 0.5 - 32.0) / FOCAL, (24.0 - f64::from(y) - 0.5) / FOCAL, -1.0)
}

/// Film point of a place in the space of such a camera.
fn film(p: DVec3) -> [f64; 2] {
    [32.0 - FOCAL * p.x / p.z, 24.0 + FOCAL * p.y / p.z]
}

/// A plane of one disc, far larger than the image.
fn plane(depth: f64) -> Object {
    let mut plane = object(round_surfels([(DVec3::ZERO, DVec3::Z, 500.0, Vec3::splat(0.5))]));
    plane.transform.translate = DVec3::new(0.0, 0.0, -depth);
    plane.shape.surface_mut().unwrap().material = Some(UNLIT);
    plane.epsilon = Some(1e-3);
    plane
}

fn moving(mut object: Object, motions: Vec<Motion>) -> Scene {
    object.motions = motions;
    scene(vec![object], SIZE, DVec3::ZERO, 40.0)
}

fn of(scene: &Scene, pair: [f64; 2]) -> Flow {
    flows(scene, 0, &[pair], &ReferenceOptions::default()).unwrap().remove(0)
}

/// Holds the flow of a scene between two times against the film point at the second time of what a pixel shows at the
/// first; `None`: nothing.
fn check(what: &str, scene: &Scene, pair: [f64; 2], landed: impl Fn(u32, u32) -> Option<[f64; 2]>) {
    let flow = of(scene, pair);
    let (mut worst, mut longest, mut seen) = (0.0_f64, 0.0_f64, 0);
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let at = (y * SIZE[0] + x) as usize;
            let motion = [f64::from(flow.x[at]), f64::from(flow.y[at])];
            let Some(wanted) = landed(x, y) else {
                assert_eq!((flow.valid[at], flow.visible[at], motion), (0.0, 0.0, [0.0; 2]), "{what}: {x}, {y}");
                continue;
            };
            assert_eq!(flow.valid[at], 1.0, "{what}: {x}, {y}");
            let wanted = [wanted[0] - f64::from(x) - 0.5, wanted[1] - f64::from(y) - 0.5];
            worst = worst.max((motion[0] - wanted[0]).hypot(motion[1] - wanted[1]));
            longest = longest.max(wanted[0].hypot(wanted[1]));
            seen += 1;
        }
    }
    println!("{what}: {seen} pixels, motion up to {longest:.2} px, worst error {worst:.2e} px");
    assert!(seen > 100 && worst < CLOSE, "{what}: {seen} pixels, {worst} px");
}

#[test]
fn of_planes_that_move_and_turn() {
    let go = |velocity: DVec3| vec![Motion::Linear { velocity }];
    let on_plane = |x: u32, y: u32| direction(x, y) * DEPTH;
    let sideways = DVec3::new(0.31, -0.17, 0.0);
    let scene = moving(plane(DEPTH), go(sideways));
    check("translation", &scene, [0.0, 1.0], |x, y| Some(film(on_plane(x, y) + sideways)));
    // The plane is its own translation: what it shows in the middle is where it was.
    check("from the middle", &scene, [0.5, 1.0], |x, y| Some(film(on_plane(x, y) + sideways * 0.5)));
    check("backwards", &scene, [1.0, 0.25], |x, y| Some(film(on_plane(x, y) - sideways * 0.75)));
    let nearer = DVec3::new(0.05, 0.02, 1.7);
    check("approaching", &moving(plane(DEPTH), go(nearer)), [0.0, 1.0], |x, y| Some(film(on_plane(x, y) + nearer)));
    // What ends behind the near plane does not land.
    check("past the camera", &moving(plane(DEPTH), go(DVec3::Z * 3.5)), [0.0, 1.0], |x, y| {
        Some(film(on_plane(x, y) + DVec3::Z * 3.5))
    });
    assert!(of(&moving(plane(DEPTH), go(DVec3::Z * 4.5)), [0.0, 1.0]).valid.iter().all(|&valid| valid == 0.0));
    for (what, degrees) in [("a small turn in the image plane", 7.0_f64), ("a large one", 140.0)] {
        let turn = DMat3::from_rotation_z(degrees.to_radians());
        let motion = Motion::Rotation { axis: DVec3::Z, per_frame: degrees.to_radians(), centre: DVec3::ZERO };
        check(what, &moving(plane(DEPTH), vec![motion]), [0.0, 1.0], |x, y| Some(film(turn * on_plane(x, y))));
    }
    let centre = DVec3::new(0.2, 0.1, -DEPTH);
    let motion = Motion::Rotation { axis: DVec3::Y, per_frame: 0.6, centre };
    let turn = DMat3::from_rotation_y(0.6);
    check("a turn about the vertical", &moving(plane(DEPTH), vec![motion]), [0.0, 1.0], |x, y| {
        Some(film(turn * (on_plane(x, y) - centre) + centre))
    });
}

/// With a read-out a point that moves by v pixels a frame is at y0 + v t, and the row y is read out R y / H later. It
/// lands where both are the same: (y - y0) (1 - v R / H) = v.
#[test]
fn of_a_rolling_shutter() {
    let velocity = DVec3::new(0.31, -0.4, 0.0);
    let mut scene = moving(plane(DEPTH), vec![Motion::Linear { velocity }]);
    let pixels = [velocity.x, -velocity.y].map(|v| v * FOCAL / DEPTH);
    for (text, axis, sign) in [("0.6", 1, 1.0), ("0.6,up,first", 1, -1.0), ("0.5,right", 0, 1.0)] {
        scene.shutter.readout = text.parse().unwrap();
        let a_pixel = sign * scene.shutter.readout.duration / f64::from(SIZE[axis]);
        let along = pixels[axis] / (1.0 - pixels[axis] * a_pixel);
        let time = 1.0 + along * a_pixel;
        let motion = if axis == 1 { [pixels[0] * time, along] } else { [along, pixels[1] * time] };
        check(text, &scene, [0.0, 1.0], |x, y| {
            let at = film(direction(x, y) * DEPTH);
            Some([at[0] + motion[0], at[1] + motion[1]])
        });
    }
}

#[test]
fn of_a_camera_that_moves() {
    let mut scene = moving(plane(DEPTH), Vec::new());
    let velocity = DVec3::new(0.3, 0.1, -0.8);
    let turn = DMat3::from_rotation_x(0.2);
    scene.camera.motions =
        vec![Motion::Rotation { axis: DVec3::X, per_frame: 0.2, centre: DVec3::ZERO }, Motion::Linear { velocity }];
    check("camera", &scene, [0.0, 1.0], |x, y| Some(film(turn.transpose() * (direction(x, y) * DEPTH - velocity))));
    // An object that does not blur is seen by the camera of the frame's number, at all times.
    scene.objects[0].blur = false;
    check("without blur", &scene, [0.0, 1.0], |x, y| Some(film(direction(x, y))));
}

#[test]
fn of_points_that_move_by_themselves() {
    let (velocity, acceleration) = (Vec3::new(0.25, -0.125, 0.5), Vec3::new(-0.125, 0.25, 1.0));
    let mut model = round_surfels([(DVec3::ZERO, DVec3::Z, 500.0, Vec3::splat(0.5))]);
    (model.velocity, model.acceleration) = (vec![velocity], vec![acceleration]);
    model.velocity_unit = VelocityUnit::Frame;
    let mut points = object(model);
    points.transform.translate = DVec3::new(0.0, 0.0, -DEPTH);
    *points.shape.points_mut().unwrap() = PointMotion { unit: None, at: Some(0.0) };
    let place = |t: f64| velocity.as_dvec3() * t + acceleration.as_dvec3() * (t * t / 2.0);
    for (pair, depth) in [([0.0, 1.0], DEPTH), ([0.5, 1.0], DEPTH - place(0.5).z)] {
        check("velocity and acceleration", &moving(points.clone(), Vec::new()), pair, |x, y| {
            Some(film(direction(x, y) * depth + place(pair[1]) - place(pair[0])))
        });
    }
}

/// An ideal ball: the meeting of ray and ball is exact, and what turns away is not seen any more.
#[test]
fn of_a_ball_that_turns() {
    const RADIUS: f64 = 1.0;
    let mut ball = plane(DEPTH);
    ball.shape = Sphere { radius: RADIUS, colour: Vec3::splat(0.5) }.into();
    let centre = DVec3::new(0.0, 0.0, -DEPTH);
    let scene = moving(ball, vec![Motion::Rotation { axis: DVec3::Y, per_frame: 0.8, centre }]);
    let met = |x: u32, y: u32| {
        let d = direction(x, y);
        let (a, b, c) = (d.length_squared(), d.dot(centre), centre.length_squared() - RADIUS * RADIUS);
        let root = b * b - a * c;
        (root >= 0.0).then(|| d * ((b - root.sqrt()) / a))
    };
    let turned = |p: DVec3| DMat3::from_rotation_y(0.8) * (p - centre) + centre;
    check("a ball", &scene, [0.0, 1.0], |x, y| Some(film(turned(met(x, y)?))));
    let flow = of(&scene, [0.0, 1.0]);
    let (mut seen, mut hidden) = (0, 0);
    for at in 0..flow.x.len() as u32 {
        let Some(p) = met(at % SIZE[0], at / SIZE[0]) else { continue };
        let faces = (turned(p) - centre).dot(-turned(p));
        // At the limb a rounding decides.
        if faces.abs() > 1e-9 {
            assert_eq!(flow.visible[at as usize], if faces > 0.0 { 1.0 } else { 0.0 }, "{at}: {faces}");
            *(if faces > 0.0 { &mut seen } else { &mut hidden }) += 1;
        }
    }
    assert!(seen > 300 && hidden > 100, "{seen} {hidden}");
}

/// A plate moves behind another one, which hides what it reaches; its other end leaves the image.
#[test]
fn what_is_hidden_or_outside_is_valid_and_not_visible() {
    let velocity = DVec3::new(1.0, 0.0, 0.0);
    let mut scene = moving(plane(DEPTH), vec![Motion::Linear { velocity }]);
    // Its edge is a straight line at x = 40, as good as.
    let radius = 5e4;
    let edge = (40.0 - 32.0) * 2.0 / FOCAL;
    let mut before = object(round_surfels([(DVec3::ZERO, DVec3::Z, radius, Vec3::ONE)]));
    before.transform.translate = DVec3::new(edge + radius, 0.0, -2.0);
    before.epsilon = Some(1e-3);
    scene.objects.push(before);
    scene.objects[1].name = "before".into();
    let flow = of(&scene, [0.0, 1.0]);
    let way = FOCAL / DEPTH;
    for x in 0..64_u32 {
        let at = (20 * SIZE[0] + x) as usize;
        let (front, landed) = (x >= 40, f64::from(x) + 0.5 + way);
        let wanted = if front { 0.0 } else { way };
        assert!((f64::from(flow.x[at]) - wanted).abs() < CLOSE && flow.valid[at] == 1.0, "{x}: {}", flow.x[at]);
        let seen = front || landed < 40.0;
        assert_eq!(flow.visible[at] == 1.0, seen, "{x}");
    }
    // Without the other plate the end of the image alone matters.
    scene.objects.pop();
    let flow = of(&scene, [0.0, 1.0]);
    for x in 0..64_u32 {
        assert_eq!(flow.visible[x as usize] == 1.0, f64::from(x) + 0.5 + way < 64.0, "{x}");
    }
}

/// The surface is where transmittance falls to a half: of layers the one that does it, of Gaussians the centre's depth.
#[test]
fn light_that_passes_through_meets_a_surface_at_one_half() {
    let [near, far] = [DVec3::new(0.1, 0.0, 0.0), DVec3::new(0.0, 0.3, 0.0)];
    for (opacity, behind) in [(0.3, true), (0.45, true), (0.55, false), (1.0, false)] {
        let mut pane = plane(2.0);
        pane.opacity = opacity;
        pane.motions = vec![Motion::Linear { velocity: near }];
        let mut wall = plane(DEPTH);
        wall.name = "wall".into();
        wall.motions = vec![Motion::Linear { velocity: far }];
        let scene = scene(vec![pane, wall], SIZE, DVec3::ZERO, 40.0);
        check(&format!("a pane of opacity {opacity}"), &scene, [0.0, 1.0], |x, y| {
            let d = direction(x, y);
            Some(film(if behind { d * DEPTH + far } else { d * 2.0 + near }))
        });
    }
    // Nothing but a thin pane: no surface.
    let mut pane = plane(2.0);
    pane.opacity = 0.4;
    let flow = of(&scene(vec![pane], SIZE, DVec3::ZERO, 40.0), [0.0, 1.0]);
    assert!(flow.valid.iter().all(|&valid| valid == 0.0));

    let gaussians = Gaussians {
        position: vec![Vec3::ZERO],
        rotation: vec![Quat::IDENTITY],
        sigma: vec![Vec3::splat(0.6)],
        opacity: vec![0.99],
        base: vec![Vec3::splat(0.5)],
        ..Gaussians::default()
    };
    let mut capture = Object::new(gaussians);
    capture.name = "capture".into();
    capture.transform.translate = DVec3::new(0.0, 0.0, -DEPTH);
    let motion = Motion::Rotation { axis: DVec3::Z, per_frame: 0.5, centre: DVec3::new(0.0, 0.0, -DEPTH) };
    let scene = moving(capture, vec![motion]);
    let flow = of(&scene, [0.0, 1.0]);
    // One half is where q < 2 ln(2 * 0.99); the variance has what is added to it on the screen.
    let variance = (0.6 * FOCAL / DEPTH).powi(2) + 0.3;
    let radius = (2.0 * (2.0_f64 * 0.99).ln() * variance).sqrt();
    let mut seen = 0;
    for at in 0..flow.x.len() as u32 {
        let (x, y) = (at % SIZE[0], at / SIZE[0]);
        let r = (f64::from(x) + 0.5 - 32.0).hypot(f64::from(y) + 0.5 - 24.0);
        let at = at as usize;
        if (r - radius).abs() > 0.1 {
            assert_eq!(flow.valid[at] == 1.0, r < radius, "{x}, {y}");
        }
        if flow.valid[at] == 1.0 {
            let wanted = film(DMat3::from_rotation_z(0.5) * direction(x, y) * DEPTH);
            let motion = [wanted[0] - f64::from(x) - 0.5, wanted[1] - f64::from(y) - 0.5];
            let error = (f64::from(flow.x[at]) - motion[0]).hypot(f64::from(flow.y[at]) - motion[1]);
            assert!(error < CLOSE, "{x}, {y}: {error}");
            assert_eq!(flow.visible[at], 1.0, "{x}, {y}");
            seen += 1;
        }
    }
    assert!(seen > 300, "{seen}");
}
