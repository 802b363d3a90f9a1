//! The lights between the page, which turns them, and the scene.

use glam::{DQuat, DVec3};
use serde::Deserialize;

use super::camera::middle;
use crate::scene::{Light, Scene};

/// All lights, turned about the middle of the objects.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LightsAt {
    /// A quaternion: x, y, z, w. Its length does not matter.
    turn: [f64; 4],
}

impl LightsAt {
    /// The fault of this turn; `None`: lights can be turned by it.
    pub(super) fn fault(&self) -> Option<String> {
        let length = self.turn.iter().map(|part| part * part).sum::<f64>();
        let sound = (1e-6..1e6).contains(&length);
        (!sound).then(|| format!("the lights' turn {:?} is no quaternion", self.turn))
    }

    /// Turns the lights of a scene. Of its surroundings the part about +y counts, because a picture of them turns about
    /// no other axis.
    pub(super) fn turn(&self, scene: &mut Scene) {
        let turn = DQuat::from_array(self.turn).normalize();
        let middle = middle(scene);
        for light in &mut scene.lights {
            match light {
                Light::Directional { direction, .. } => *direction = (turn * *direction).normalize_or(DVec3::NEG_Y),
                Light::Point { position, .. } => *position = middle + turn * (*position - middle),
                Light::Ambient { .. } => {}
            }
        }
        let is_lit_by_it = scene.sky().is_some();
        if let Some(environment) = scene.environment.as_mut().filter(|_| is_lit_by_it) {
            environment.rotation += 2.0 * libm::atan2(turn.y, turn.w);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_1_SQRT_2;

    use super::*;

    /// A quarter about +y takes -z to -x, and points about the middle of the objects.
    #[test]
    fn lights_turn_about_the_middle_of_the_objects() {
        let mut scene = Scene::new([]);
        let position = DVec3::new(0.0, 2.0, -3.0);
        scene.lights = vec![Light::directional(DVec3::NEG_Z, DVec3::ONE), Light::point(position, DVec3::ONE)];
        scene.lights.push(Light::Ambient { colour: DVec3::ONE });
        let lights = LightsAt { turn: [0.0, 3.0 * FRAC_1_SQRT_2, 0.0, 3.0 * FRAC_1_SQRT_2] };
        assert_eq!(lights.fault(), None);
        lights.turn(&mut scene);
        let [Light::Directional { direction, .. }, Light::Point { position, .. }, _] = scene.lights[..] else {
            panic!("{:?}", scene.lights)
        };
        assert!(direction.distance(DVec3::NEG_X) < 1e-12, "{direction}");
        assert!(position.distance(DVec3::new(-3.0, 2.0, 0.0)) < 1e-12, "{position}");
    }

    #[test]
    fn what_is_no_turn_is_refused() {
        for turn in [[0.0; 4], [f64::NAN, 0.0, 0.0, 1.0], [1e200, 0.0, 0.0, 1.0], [f64::INFINITY; 4]] {
            assert!(LightsAt { turn }.fault().is_some(), "{turn:?}");
        }
    }
}
