//! How a light sees: onto a plane across parallel rays, or onto the faces of a cube.

use glam::{Mat3, Vec3};

use crate::backend::cpu::columns::turn;
use crate::backend::cpu::tiles::{LANES, Lanes};
use crate::shading::ShadingLight;

/// Distance of a point light, in those of the farthest surfel, beyond which its rays count as parallel.
const PARALLEL: f32 = 3000.0;

/// Places on a face reach to 1 from its middle, and a texel or two farther.
pub(in crate::backend) const BEYOND_FACE: f32 = 0.99;

/// A view of a light.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend) struct LightView {
    /// From axes of the world to those of the view: x and y on its plane, and away from the light.
    axes: Mat3,
    /// Where rays start, relative to the eye, world axes; 0 where they are parallel.
    origin: Vec3,
    /// Do rays start at one point?
    pub is_point: bool,
}

impl LightView {
    /// The views of a light; `None` where it has no shadows. `right`: that of the camera. `extent`: distance of the
    /// farthest surfel from the eye.
    pub(in crate::backend) fn of(light: &ShadingLight, right: Vec3, extent: f32) -> Option<Vec<Self>> {
        match *light {
            ShadingLight::Directional { towards, shadows: true, .. } => Some(vec![Self::directional(towards, right)]),
            // So far away rays are as good as parallel, and rounding would hide what they meet.
            ShadingLight::Point { position, shadows: true, .. } if position.length() > PARALLEL * extent => {
                Some(vec![Self::directional(position.normalize_or(Vec3::Y), right)])
            }
            ShadingLight::Point { position, shadows: true, .. } => Some(Self::faces(position).to_vec()),
            _ => None,
        }
    }

    /// The rotation from axes of the world, and where rays start; see the fields.
    #[cfg(feature = "gpu")]
    pub(in crate::backend) const fn pose(&self) -> (Mat3, Vec3) {
        (self.axes, self.origin)
    }

    /// The view of a light infinitely far in the unit direction `towards`. Its x lies as near as can be to the unit
    /// vector `right` of the camera: then slices of the camera's depth lie along an axis of the plane.
    fn directional(towards: Vec3, right: Vec3) -> Self {
        let across = right - towards * towards.dot(right);
        // What is left of a parallel vector is rounding.
        let is_across = across.length_squared() > 1e-4;
        let x = if is_across { across.normalize() } else { towards.any_orthonormal_vector() };
        let x = (x - towards * towards.dot(x)).normalize();
        let axes = Mat3::from_cols(x, x.cross(towards), -towards).transpose();
        Self { axes, origin: Vec3::ZERO, is_point: false }
    }

    /// The six of a light at `position`: along +x, -x, +y, -y, +z, -z.
    fn faces(position: Vec3) -> [Self; 6] {
        let along = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z];
        along.map(|along| Self { axes: axes(along), origin: position, is_point: true })
    }

    /// The number of the view of `views` that `place` is in.
    pub(super) fn facing(views: &[Self], place: Vec3) -> usize {
        if views.len() == 1 {
            return 0;
        }
        let p = place - views[0].origin;
        let size = p.abs();
        let axis = match (size.x >= size.y && size.x >= size.z, size.y >= size.z) {
            (true, _) => 0,
            (false, true) => 1,
            (false, false) => 2,
        };
        2 * axis + usize::from(p[axis] < 0.0)
    }

    /// The unit direction in which light reaches a place.
    pub(super) fn rays_at(&self, place: Vec3) -> Vec3 {
        let along = self.axes.row(2);
        if self.is_point { (place - self.origin).normalize_or(along) } else { along }
    }

    /// A direction in the view's axes.
    pub(super) fn turned(&self, v: Vec3) -> Vec3 {
        self.axes * v
    }

    /// A direction of the view in the axes of the world.
    pub(super) fn turned_back(&self, v: Vec3) -> Vec3 {
        self.axes.transpose() * v
    }

    /// A map into the world, turned into the view's axes.
    pub(super) fn turn(&self, map: Mat3) -> Mat3 {
        self.axes * map
    }

    /// Half the size of a box of the world, in the view's axes.
    pub(super) fn extent(&self, half: Vec3) -> Vec3 {
        self.axes.abs() * half
    }

    /// The direction from a place to the light, of any length.
    pub(super) fn towards_light(&self, place: Vec3) -> Vec3 {
        if self.is_point { self.origin - place } else { -self.axes.row(2) }
    }

    /// A place in the view's axes.
    pub(super) fn place(&self, p: Vec3) -> Vec3 {
        self.axes * (p - self.origin)
    }

    /// Places in the view's axes.
    #[inline(always)]
    pub(super) fn places(&self, p: &[Lanes; 3]) -> [Lanes; 3] {
        let mut relative = *p;
        for c in 0..3 {
            for l in 0..LANES {
                relative[c][l] -= self.origin[c];
            }
        }
        turn(&self.axes, &relative)
    }

    /// `LANES` places on the plane of a view whose rays are parallel, and the distances along them.
    #[inline(always)]
    pub(super) fn lanes_on_plane(&self, p: &[Lanes; 3]) -> [Lanes; 3] {
        turn(&self.axes, p)
    }

    /// Is a ball around a place of the view beside what the face of a point light shows?
    pub(super) fn is_beside(&self, place: Vec3, radius: f32) -> bool {
        let beside = |x: f32| x.abs() * BEYOND_FACE - place.z > std::f32::consts::SQRT_2 * radius;
        self.is_point && (beside(place.x) || beside(place.y) || place.z <= -radius)
    }

    /// A place on the plane of the view, and what grows with its distance: the distance along parallel rays, or
    /// -1 / the distance along the axis. A plane in space is linear in it over the view's plane.
    pub(super) fn on_plane(&self, p: Vec3) -> [f32; 3] {
        let p = self.place(p);
        if !self.is_point {
            return p.to_array();
        }
        let inverse = 1.0 / p.z;
        [p.x * inverse, p.y * inverse, -inverse]
    }
}

/// A rotation whose third row is the unit vector `along`.
fn axes(along: Vec3) -> Mat3 {
    let (x, y) = along.any_orthonormal_pair();
    Mat3::from_cols(x, y, along).transpose()
}
