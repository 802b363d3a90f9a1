//! The scenes of the thesis' figures, as its captions tell them: motions, and numbers of surfels.

use glam::DVec3;

use super::models;
use crate::math::Trs;
use crate::model::{Cloud, ModelError};
use crate::scene::{Camera, Light, Motion, Object, Scene};
use crate::time::{Shutter, Weight};

/// A figure with five pictures, (a) to (e), and a column of table 5.1.
pub(super) struct Figure {
    /// Its number.
    pub(super) name: &'static str,
    /// What moves how.
    pub(super) about: &'static str,
    /// Frames a second of (a) to (e) in Wolf (2008), table 5.1.
    pub(super) published: [f64; 5],
    pub(super) scene: Scene,
}

/// The three figures, with 1 of `fewer` of their surfels.
pub(super) fn figures(size: [u32; 2], fewer: usize) -> Result<Vec<Figure>, ModelError> {
    let (ammonite, shell) = (models::ammonite(277_269 / fewer), models::shell(168_120 / fewer));
    let turn = |axis: DVec3, degrees: f64, centre| Motion::Rotation { axis, per_frame: degrees.to_radians(), centre };
    let across = |velocity| Motion::Linear { velocity };
    let place = DVec3::new(-0.25, 0.35, -0.2);
    Ok(vec![
        Figure {
            name: "5.1",
            about: "an insect moves from the upper right to the lower left",
            published: [39.6, 7.9, 2.3, 3.5, 1.7],
            scene: scene(
                vec![object(
                    "insect",
                    models::wasp(49_604 / fewer),
                    DVec3::ZERO,
                    vec![across(DVec3::new(-1.1, -0.8, 0.0))],
                )?],
                size,
            ),
        },
        Figure {
            name: "5.2",
            about: "an octopus turns by 50 degrees about its centre",
            published: [29.9, 4.7, 1.1, 7.0, 3.8],
            scene: scene(
                vec![object("octopus", models::octopus(465_878 / fewer).cloud, DVec3::ZERO, vec![octopus_turns()])?],
                size,
            ),
        },
        Figure {
            name: "5.3",
            about: "an ammonite comes nearer and turns; a shell passes from left to right",
            published: [37.9, 10.3, 4.4, 0.8, 0.4],
            scene: scene(
                vec![
                    object(
                        "ammonite",
                        ammonite,
                        place,
                        vec![turn(DVec3::Z, 25.0, place), across(DVec3::new(0.0, 0.0, 1.0))],
                    )?,
                    object("shell", shell, DVec3::new(0.0, -0.75, 0.3), vec![across(DVec3::X)])?,
                ],
                size,
            ),
        },
    ])
}

/// The thin end of a tentacle of figure 5.2 alone, in the same place and motion: the last tenth of its surfels.
pub(super) fn thin_part(size: [u32; 2], fewer: usize) -> Result<Scene, ModelError> {
    let models::Parts { cloud, ranges } = models::octopus(465_878 / fewer);
    let tentacle = ranges[5].clone();
    let alone = models::part(&cloud, tentacle.end - tentacle.len() / 10..tentacle.end);
    Ok(scene(vec![object("thin end", alone, DVec3::ZERO, vec![octopus_turns()])?], size))
}

/// The shell of figure 5.3 alone, with so many discs over each point of its surface.
pub(super) fn shell(size: [u32; 2], fewer: usize, discs: f64) -> Result<Scene, ModelError> {
    let cloud = models::with_discs(models::shell(168_120 / fewer), discs);
    Ok(scene(vec![object("shell", cloud, DVec3::ZERO, vec![Motion::Linear { velocity: DVec3::X }])?], size))
}

/// The octopus of figure 5.2, at rest.
pub(super) fn octopus_at_rest(size: [u32; 2], fewer: usize) -> Result<Scene, ModelError> {
    Ok(scene(vec![object("octopus", models::octopus(465_878 / fewer).cloud, DVec3::ZERO, Vec::new())?], size))
}

/// Travel of the ball of figure 3.1, and its radius, scene units.
pub(super) const FALL: [f64; 2] = [2.0, 0.2];

/// Figure 3.1: a ball falls at constant speed, exposed with a weight.
pub(super) fn fall(size: [u32; 2], weight: Weight) -> Result<Scene, ModelError> {
    let mut ball = object("ball", crate::model::generate::sphere(20_000), DVec3::ZERO, Vec::new())?;
    ball.transform.scale = DVec3::splat(FALL[1]);
    ball.motions = vec![Motion::Linear { velocity: DVec3::NEG_Y * FALL[0] }];
    let mut scene = scene(vec![ball], size);
    scene.shutter.weight = weight;
    Ok(scene)
}

fn octopus_turns() -> Motion {
    Motion::Rotation { axis: DVec3::Z, per_frame: 50_f64.to_radians(), centre: DVec3::ZERO }
}

fn object(name: &str, cloud: Cloud, place: DVec3, motions: Vec<Motion>) -> Result<Object, ModelError> {
    let transform = Trs { translate: place, ..Trs::default() };
    Ok(Object { name: name.to_owned(), transform, motions, ..Object::from_cloud(cloud)? })
}

/// Frame 0 in the middle of the exposure, before black, seen from (0, 0, 4).
pub(super) fn scene(objects: Vec<Object>, size: [u32; 2]) -> Scene {
    let mut scene = Scene::new(objects);
    scene.camera = Camera::new(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO);
    (scene.image.width, scene.image.height) = (size[0], size[1]);
    scene.shutter = Shutter { open: -0.5, close: 0.5, weight: Weight::Box, ..Shutter::default() };
    scene.lights = vec![
        Light::directional(DVec3::new(-0.5, -0.8, -1.0).normalize(), DVec3::splat(0.9)).without_shadows(),
        Light::Ambient { colour: DVec3::splat(0.3) },
    ];
    scene
}
