//! The sphere that a moving object stays in: what the reference leaves out by it must be beside the object at every
//! time.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "a test may stop and report")]

use crate::support;
use std::path::PathBuf;

use glam::{DVec3, Vec3};
use splatblur::anim::{self, Interpolation};
use splatblur::math::Trs;
use splatblur::model::Surfels;
use splatblur::scene::pose::ObjectPoser;
use splatblur::scene::{AnimationBinding, Motion};

/// All shipped animations in all modes, alone and with motions before and after them, over long, short and empty times,
/// inside and outside the keys. The bound must hold, and be known and not much too large where nothing jumps and the
/// time is short.
#[test]
fn holds_the_object_at_every_time() {
    let mut files: Vec<PathBuf> = std::fs::read_dir("animations")
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "anim"))
        .collect();
    files.sort();
    assert!(files.len() >= 5);
    let (centre, radius) = (DVec3::new(0.3, -0.5, 0.2), 0.4);
    let (mut known, mut tight, mut all) = (0, 0, 0);
    for animation in std::iter::once(None).chain(files.iter().map(Some)) {
        for mode in [Interpolation::Maya, Interpolation::Linear, Interpolation::Spline] {
            for moving in [false, true] {
                let mut object = support::object(Surfels::default());
                object.animation = animation.map(|path| AnimationBinding {
                    path: path.clone(),
                    node: anim::load(path).unwrap().node(None).unwrap().clone().into(),
                    interpolation: mode,
                });
                object.transform.scale = DVec3::new(1.5, 0.7, -1.1);
                if moving {
                    let axis = DVec3::new(1.0, 2.0, -2.0) / 3.0;
                    object.motions = vec![
                        Motion::Linear { velocity: DVec3::new(0.1, -0.3, 0.2) },
                        Motion::Rotation { axis, per_frame: 0.7, centre: DVec3::new(2.0, 0.0, 1.0) },
                        Motion::Linear { velocity: DVec3::X },
                    ];
                    object.place = Trs { scale: DVec3::new(0.5, 2.0, 1.0), ..Trs::default() };
                }
                let scene = support::scene(vec![object], [8, 8], DVec3::ZERO, 40.0);
                let poser = ObjectPoser::new(&scene, &scene.objects[0]);
                for i in 0..400 {
                    let from = -20.0 + 0.37 * f64::from(i);
                    let to = from + [0.0, 1e-3, 0.02, 0.5, 8.0][i as usize % 5];
                    all += 1;
                    let Some((x, r)) = poser.swept_sphere(centre, radius, from, to) else { continue };
                    known += 1;
                    let mut farthest: f64 = 0.0;
                    for k in 0..=32 {
                        let Some(pose) = poser.at(from + (to - from) * f64::from(k) / 32.0) else { continue };
                        for e in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z, Vec3::splat(0.577)] {
                            let p = pose.transform_point3(centre + radius * e.as_dvec3());
                            farthest = farthest.max((p - x).length());
                        }
                    }
                    assert!(
                        farthest <= r * (1.0 + 1e-9),
                        "{animation:?} {mode:?} {moving} {from}..{to}: {farthest} > {r}"
                    );
                    tight += u32::from(farthest > 0.5 * r);
                }
            }
        }
    }
    println!("known {known}, tight {tight} of {all}");
    assert!(known > all * 9 / 10 && tight > all / 2, "known {known}, tight {tight} of {all}");
}
