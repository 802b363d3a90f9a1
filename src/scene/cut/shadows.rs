//! How fine surfels must be for the shadows that they cast.
//!
//! A shadow may lie nearer to the eye than what casts it, so it may show what is too small to be seen where it is.

use glam::{DMat4, DVec2, DVec3};

use super::{ImagePlane, PARTS};
use crate::math::Bounds;
use crate::scene::pose::{camera_from_world, object_pose};
use crate::scene::values::{Light, Object, Scene};

/// Directions of an environment that are looked at.
const OF_SKY: u32 = 16;

/// A light with shadows, world space.
#[derive(Clone, Copy, Debug)]
enum Lamp {
    /// The direction of travel, and the widening of a penumbra along it.
    Far { travel: DVec3, widening: f64 },
    /// A ball.
    Near { place: DVec3, radius: f64 },
}

/// The lights with shadows of a scene, and where shadows may fall.
#[derive(Debug)]
pub(super) struct Lamps {
    lamps: Vec<Lamp>,
    /// The box of all objects during the exposure, world space.
    bounds: Bounds,
}

impl Lamps {
    /// The lights of a scene, at the exposure of frame `number`.
    pub(super) fn of(scene: &Scene, number: f64) -> Self {
        let of_light = |light: &Light| match *light {
            Light::Directional { direction, angle, shadows: true, .. } => {
                // Wider ones have no edges that would show.
                Some(Lamp::Far { travel: direction, widening: libm::tan(0.5 * angle.min(1.0)) })
            }
            Light::Point { position, radius, shadows: true, .. } => Some(Lamp::Near { place: position, radius }),
            Light::Directional { .. } | Light::Point { .. } | Light::Ambient { .. } => None,
        };
        let mut lamps: Vec<Lamp> = scene.lights.iter().filter_map(of_light).collect();
        if let Some(sky) = scene.sky().filter(|sky| sky.shadows) {
            let drawn = |i: u32| {
                let across = f64::from(i.reverse_bits()) / 2.0_f64.powi(32);
                let (towards, _) = sky.drawn([(f64::from(i) + 0.5) / f64::from(OF_SKY), across]);
                Lamp::Far { travel: -towards, widening: 0.0 }
            };
            lamps.extend((0..OF_SKY).map(drawn));
        }
        let mut bounds = Bounds::default();
        if !lamps.is_empty() {
            for object in &scene.objects {
                let [early, late] = scene.shutter.readout.delays();
                for part in 0..=PARTS {
                    let share = part as f64 / PARTS as f64;
                    let open = scene.shutter.frame_time(number, scene.shutter.weight.time_of(share));
                    add(&mut bounds, scene, object, open + early + (late - early) * share);
                }
                if !object.blur {
                    add(&mut bounds, scene, object, number);
                }
            }
        }
        Self { lamps, bounds }
    }
}

/// Adds an object at a scene time.
fn add(bounds: &mut Bounds, scene: &Scene, object: &Object, time: f64) {
    let pose = object_pose(scene, object, time);
    let own = object.bounds_at(scene.frames.rate, time);
    if pose.visible && !own.is_empty() {
        own.corners().iter().for_each(|corner| bounds.add(pose.world_from_model.transform_point3(*corner)));
    }
}

/// The half space `normal . p + offset >= 0`, camera space.
#[derive(Clone, Copy, Debug)]
struct HalfSpace {
    normal: DVec3,
    offset: f64,
}

/// What the camera sees of the lights' shadows at an instant, camera space.
#[derive(Debug, Default)]
pub(super) struct ShadowView {
    lamps: Vec<Lamp>,
    /// Shadows that show lie in all of them.
    half_spaces: Vec<HalfSpace>,
    near: f64,
}

impl ShadowView {
    pub(super) fn of(lamps: &Lamps, scene: &Scene, image: ImagePlane, focal: f64, time: f64) -> Self {
        if lamps.lamps.is_empty() || lamps.bounds.is_empty() {
            return Self::default();
        }
        let camera = camera_from_world(scene, time);
        let seen = |lamp: &Lamp| match *lamp {
            Lamp::Far { travel, widening } => Lamp::Far { travel: camera.transform_vector3(travel), widening },
            Lamp::Near { place, radius } => Lamp::Near { place: camera.transform_point3(place), radius },
        };
        let near = scene.camera.near;
        let mut half_spaces = sides_of(image, focal);
        half_spaces.push(HalfSpace { normal: DVec3::NEG_Z, offset: -near });
        half_spaces.extend(sides_of_box(&lamps.bounds, &camera));
        Self { lamps: lamps.lamps.iter().map(seen).collect(), half_spaces, near }
    }

    /// How much larger a length is in the shadows of a ball than at a distance of 1 from the eye, at most; 0 where they
    /// do not show, or nowhere larger than at the ball. `centre` is in camera space.
    pub(super) fn magnification(&self, centre: DVec3, radius: f64) -> f64 {
        self.lamps.iter().map(|lamp| self.of_lamp(lamp, centre, radius)).fold(0.0, f64::max)
    }

    fn of_lamp(&self, lamp: &Lamp, centre: DVec3, radius: f64) -> f64 {
        // The shadow's middle after a way, how it widens, and how it grows; both per unit of the way.
        let (travel, widening, growth) = match *lamp {
            Lamp::Far { travel, widening } => (travel, widening, 0.0),
            Lamp::Near { place, radius: of_lamp } => {
                let from = centre - place;
                let distance = from.length() - radius;
                if distance <= of_lamp {
                    return f64::INFINITY;
                }
                (from.normalize(), (radius + of_lamp) / distance, distance.recip())
            }
        };
        let [mut first, mut last] = [0.0, f64::INFINITY];
        for HalfSpace { normal, offset } in &self.half_spaces {
            let at = normal.dot(centre) + offset + radius;
            let rate = normal.dot(travel) + widening;
            if rate > 0.0 {
                first = f64::max(first, -at / rate);
            } else if rate < 0.0 {
                last = f64::min(last, -at / rate);
            } else if at < 0.0 {
                return 0.0;
            }
        }
        if first > last {
            return 0.0;
        }
        // Where (1 + growth s) / |centre + s travel| is largest.
        let (b, square) = (centre.dot(travel), centre.length_squared());
        let slope = growth * b - 1.0;
        let turn = if slope < 0.0 { (growth * square - b) / -slope } else { f64::INFINITY };
        let turn = turn.clamp(first, last);
        if !turn.is_finite() {
            return growth;
        }
        if turn <= 0.0 {
            return 0.0;
        }
        let way = (centre + travel * turn).length() - radius - widening * turn;
        (1.0 + growth * turn) / way.max(self.near)
    }
}

/// The four sides of what a camera sees.
fn sides_of(image: ImagePlane, focal: f64) -> Vec<HalfSpace> {
    let ImagePlane { size: DVec2 { x: width, y: height }, axis: DVec2 { x, y } } = image;
    let normals = [
        DVec3::new(focal, 0.0, -x),
        DVec3::new(-focal, 0.0, x - width),
        DVec3::new(0.0, -focal, -y),
        DVec3::new(0.0, focal, y - height),
    ];
    normals.map(|normal| HalfSpace { normal: normal.normalize(), offset: 0.0 }).to_vec()
}

/// The six sides of a box of the world.
fn sides_of_box(bounds: &Bounds, camera_from_world: &DMat4) -> impl Iterator<Item = HalfSpace> {
    [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(move |axis| {
        [(axis, bounds.min), (-axis, bounds.max)].map(|(inward, corner)| {
            let normal = camera_from_world.transform_vector3(inward);
            HalfSpace { normal, offset: -normal.dot(camera_from_world.transform_point3(corner)) }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest is that of the place on the ray, within the half spaces, that shows a length largest.
    #[test]
    fn the_magnification_is_that_of_the_place_that_shows_it_largest() {
        let image = ImagePlane { size: DVec2::new(160.0, 90.0), axis: DVec2::new(80.0, 45.0) };
        let bounds = Bounds { min: DVec3::splat(-20.0), max: DVec3::splat(20.0) };
        let mut half_spaces = sides_of(image, 100.0);
        half_spaces.extend(sides_of_box(&bounds, &DMat4::IDENTITY));
        half_spaces.push(HalfSpace { normal: DVec3::NEG_Z, offset: -0.5 });
        let mut seed = 1_u64;
        let mut number = |low: f64, high: f64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            low + (high - low) * (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut shown = [0; 2];
        for case in 0..400 {
            let mut place = || DVec3::new(number(-15.0, 15.0), number(-15.0, 15.0), number(-19.0, 5.0));
            let (centre, other) = (place(), place());
            let is_far = case % 2 == 0;
            let lamp = if is_far {
                Lamp::Far { travel: (centre - other).normalize(), widening: 0.0 }
            } else {
                Lamp::Near { place: other, radius: 0.0 }
            };
            let view = ShadowView { lamps: vec![lamp], half_spaces: half_spaces.clone(), near: 0.5 };
            let found = view.magnification(centre, 0.0);
            let (travel, distance) = ((centre - other).normalize(), centre.distance(other));
            let at = |step: u32| {
                let way = f64::from(step) * 2e-3;
                let p = centre + travel * way;
                let shows = half_spaces.iter().all(|side| side.normal.dot(p) + side.offset >= -1e-9);
                let growth = if is_far { 1.0 } else { 1.0 + way / distance };
                if shows { growth / p.length().max(0.5) } else { 0.0 }
            };
            let largest = (0..30_000).map(at).fold(0.0, f64::max);
            if found == 0.0 {
                assert!(largest <= at(0) + 1e-3, "{case}: {largest}");
            } else {
                assert!((found - largest).abs() <= 0.01 * found.max(largest) + 1e-3, "{case}: {found}, {largest}");
            }
            shown[usize::from(found > 0.0)] += 1;
        }
        assert!(shown.iter().all(|&cases| cases > 30), "{shown:?}");
    }

    /// A ball shows no less than its middle, and a lamp within it needs all that there is.
    #[test]
    fn balls_show_more_than_their_middles() {
        let half_spaces = vec![HalfSpace { normal: DVec3::NEG_Z, offset: -0.5 }];
        let of = |lamp: Lamp, radius: f64| {
            let view = ShadowView { lamps: vec![lamp], half_spaces: half_spaces.clone(), near: 0.5 };
            view.magnification(DVec3::new(3.0, 0.0, -20.0), radius)
        };
        let far = Lamp::Far { travel: DVec3::Z, widening: 0.0 };
        assert!(of(far, 1.0) > of(far, 0.0) && of(far, 1.0) > 0.45);
        assert_eq!(of(Lamp::Far { travel: DVec3::Z, widening: 0.0 }, 0.0), 1.0 / DVec3::new(3.0, 0.0, -0.5).length());
        assert_eq!(of(Lamp::Near { place: DVec3::new(3.0, 0.5, -20.0), radius: 0.0 }, 1.0), f64::INFINITY);
        let soft = Lamp::Far { travel: DVec3::Z, widening: 0.1 };
        assert!(of(soft, 0.0) > of(far, 0.0));
    }
}
