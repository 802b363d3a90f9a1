//! Surfels that are elsewhere at their own time than in the middle of their group, for which shadow maps are drawn.

use glam::{Mat3, Vec3};

use super::view::LightView;
use crate::backend::cpu::tiles::{LANES, Lanes};
use crate::frame::PosedObject;
use crate::model::Surfels;
use crate::model::paths::Paths;

/// `LANES` surfels of an object in the middle of a group, relative to the eye of the middle, world axes.
///
/// A map shows what the light meets in the middle. At their own times surfels may be behind that, or before it, though
/// nothing throws a shadow on them. So each asks at the place that it has in the middle. But a surfel that the light
/// meets on the one side now and on the other side in the middle is then in the shadow of its own object: it asks where
/// the object is in the middle, turned as now. On a ball that is another place of the same ball.
pub(in crate::backend) struct Moved {
    pub place: [Lanes; 3],
    /// Normals of discs, of any length and side.
    normal: [Lanes; 3],
    /// The same, turned as now.
    turned_place: [Lanes; 3],
    turned_normal: [Lanes; 3],
}

impl Moved {
    /// Surfels of an object that is posed so now, and so in the middle, where its model has this origin.
    pub(in crate::backend) fn of(
        now: &PosedObject,
        (middle, origin): (&PosedObject, Vec3),
        surfels: &Surfels,
        paths: &Paths<'_>,
        numbers: &[u32; LANES],
    ) -> Self {
        let zero = [[0.0; LANES]; 3];
        let mut out = Self { place: zero, normal: zero, turned_place: zero, turned_normal: zero };
        for (l, &number) in numbers.iter().enumerate() {
            let i = number as usize;
            let centre = paths.place(surfels.position[i], i, middle.elapsed);
            let axes = [surfels.axis_u[i], surfels.axis_v[i]];
            let posed = |linear: Mat3| {
                let [u, v] = axes.map(|axis| linear * axis);
                [linear * centre + origin, u.cross(v)]
            };
            let ([place, normal], [turned_place, turned_normal]) =
                (posed(middle.world_from_model), posed(now.world_from_model));
            for c in 0..3 {
                (out.place[c][l], out.normal[c][l]) = (place[c], normal[c]);
                (out.turned_place[c][l], out.turned_normal[c][l]) = (turned_place[c], turned_normal[c]);
            }
        }
        out
    }

    /// Where they ask the maps of a light with this view, or with this first one of several.
    #[inline(always)]
    pub(super) fn asked(&self, view: &LightView) -> [Lanes; 3] {
        let mut out = self.place;
        for l in 0..LANES {
            let at = |vectors: &[Lanes; 3]| Vec3::new(vectors[0][l], vectors[1][l], vectors[2][l]);
            let (place, turned) = (at(&self.place), at(&self.turned_place));
            let is_before = |normal: Vec3, place: Vec3| normal.dot(view.towards_light(place)) > 0.0;
            if is_before(at(&self.normal), place) != is_before(at(&self.turned_normal), turned) {
                (out[0][l], out[1][l], out[2][l]) = turned.into();
            }
        }
        out
    }
}
