//! The surface of a mesh as rays meet it: its triangles, and what a point of one looks like under no filter.

use glam::{DVec2, DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::facets::Facets;
use super::paint::{Corners, straight};
use super::{AlphaMode, Mesh, Texture};
use crate::math::srgb;

/// Farthest texel that is looked at. Beyond it neighbours are the same number.
const FARTHEST: f64 = 1e15;

/// The triangles of a mesh that have an area, each once.
#[derive(Clone, Debug)]
pub(crate) struct MeshSurface<'a> {
    mesh: &'a Mesh,
    /// Indices of the triangles, rising.
    triangles: Vec<u32>,
    /// Some of them may be cut out.
    has_masks: bool,
    /// Linear light of the 256 values of a byte.
    linear: [f32; 256],
}

/// What a point looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SurfacePoint {
    /// Linear Rec.709.
    pub(crate) colour: Vec3,
    /// In [0, 1].
    pub(crate) opacity: f32,
    /// Unit normal, model space.
    pub(crate) normal: Vec3,
}

impl<'a> MeshSurface<'a> {
    pub(crate) fn new(mesh: &'a Mesh) -> Self {
        Self {
            mesh,
            triangles: Facets::new(mesh).kept,
            has_masks: mesh.materials.iter().any(|material| matches!(material.alpha, AlphaMode::Mask(_))),
            linear: std::array::from_fn(|byte| srgb::to_linear(byte as f32 / 255.0)),
        }
    }

    /// Indices of the triangles in the mesh, rising.
    pub(crate) fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// Corners of [`Self::triangles`], relative to `origin`. They turn counter-clockwise seen from the side that the
    /// normals of the mesh point to, as the axes of its surfels do.
    pub(crate) fn corners(&self, origin: DVec3) -> Vec<[Vec3; 3]> {
        let place = |v: usize| (self.mesh.position[v] - origin).as_vec3();
        self.triangles.par_iter().map(|&triangle| self.turned(triangle).0.map(place)).collect()
    }

    /// True where the mesh has no surface: the second and third corner of a triangle, as [`Self::corners`] has them,
    /// have these weights.
    pub(crate) fn is_cut_out(&self, triangle: u32, weight: [f64; 2]) -> bool {
        self.has_masks && self.seen(triangle, weight).is_none()
    }

    /// What the point with these weights looks like; what is cut out is transparent.
    pub(crate) fn point(&self, triangle: u32, weight: [f64; 2]) -> SurfacePoint {
        self.seen(triangle, weight).unwrap_or(SurfacePoint { colour: Vec3::ZERO, opacity: 0.0, normal: Vec3::ZERO })
    }

    fn seen(&self, triangle: u32, weight: [f64; 2]) -> Option<SurfacePoint> {
        let (vertex, corners) = self.turned(triangle);
        let narrow = weight.map(|w| w as f32);
        // The corners are those of the file, of which the last two may have changed places.
        let of_file = self.mesh.triangles[triangle as usize].corners[1] as usize == vertex[1];
        let in_file = if of_file { narrow } else { [narrow[1], narrow[0]] };
        let factor = corners.colour(in_file);
        let (mut colour, mut alpha) = (factor.truncate(), factor.w);
        let material = &self.mesh.materials[self.mesh.triangles[triangle as usize].material as usize];
        let texture = material.texture.filter(|_| !self.mesh.uv.is_empty());
        if let Some(texture) = texture.and_then(|index| self.mesh.textures.get(index as usize)) {
            let size = DVec2::new(texture.size[0].into(), texture.size[1].into());
            let [p, q, r] = vertex.map(|v| {
                let uv = self.mesh.uv.get(v).copied().unwrap_or_default().as_dvec2() * size;
                if uv.is_finite() { uv } else { DVec2::ZERO }
            });
            let at = p + (q - p) * weight[0] + (r - p) * weight[1];
            let texel = self.between_texels(texture, material.alpha == AlphaMode::Opaque, at);
            colour *= straight(texel).unwrap_or(Vec3::ONE);
            alpha *= texel.w;
        }
        Some(SurfacePoint { colour, opacity: corners.opacity(alpha)?, normal: corners.normal(in_file) })
    }

    /// Vertices of a triangle in the order of [`Self::corners`], and what they look like in that of the file.
    fn turned(&self, triangle: u32) -> ([usize; 3], Corners) {
        let [a, b, c] = self.mesh.triangles[triangle as usize].corners.map(|v| v as usize);
        let [p, q, r] = [a, b, c].map(|v| self.mesh.position[v]);
        let corners = Corners::new(self.mesh, triangle, (q - p).cross(r - p).normalize().as_vec3());
        (if corners.face_away() { [a, c, b] } else { [a, b, c] }, corners)
    }

    /// The premultiplied colour between the four texels around a point, texels from the upper left corner.
    fn between_texels(&self, texture: &Texture, opaque: bool, at: DVec2) -> Vec4 {
        let at = (at - 0.5).clamp(DVec2::splat(-FARTHEST), DVec2::splat(FARTHEST));
        let (corner, [right, down]) = (at.floor(), (at - at.floor()).as_vec2().to_array());
        let texel = |beside: i64, below: i64| {
            let [x, y] = [(corner.x as i64 + beside, 0), (corner.y as i64 + below, 1)]
                .map(|(index, axis)| texture.wrap[axis].cell(index, texture.size[axis].into(), 0) as usize);
            let [r, g, b, a] = texture.texels[y * texture.size[0] as usize + x];
            let [r, g, b] = [r, g, b].map(|byte| self.linear[usize::from(byte)]);
            let colour = Vec4::new(r, g, b, 1.0);
            if opaque { colour } else { colour * (f32::from(a) / 255.0) }
        };
        texel(0, 0).lerp(texel(1, 0), right).lerp(texel(0, 1).lerp(texel(1, 1), right), down)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::mesh::{MeshMaterial, Triangle, Wrap};

    /// A triangle with a texture of two texels, of which the right one has no opacity.
    fn mesh(alpha: AlphaMode, normal: Vec3) -> Mesh {
        let texture = Texture { size: [2, 1], texels: vec![[255, 0, 0, 255], [0, 255, 0, 0]], wrap: [Wrap::Clamp; 2] };
        Mesh {
            position: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            normal: vec![normal; 3],
            uv: vec![glam::Vec2::ZERO, glam::Vec2::X, glam::Vec2::ZERO],
            triangles: vec![Triangle { corners: [0, 1, 2], material: 0 }, Triangle { corners: [0, 0, 1], material: 0 }],
            materials: vec![MeshMaterial { texture: Some(0), alpha, ..MeshMaterial::default() }],
            textures: vec![texture],
            ..Mesh::default()
        }
    }

    #[test]
    fn corners_turn_with_the_normals() {
        let [front, back] = [Vec3::Z, Vec3::NEG_Z].map(|normal| mesh(AlphaMode::Opaque, normal));
        let [front, back] = [&front, &back].map(MeshSurface::new);
        // The triangle without an area is left out.
        assert_eq!(front.triangles(), [0]);
        assert_eq!(front.corners(DVec3::Z), [[Vec3::NEG_Z, Vec3::new(1.0, 0.0, -1.0), Vec3::new(0.0, 1.0, -1.0)]]);
        assert_eq!(back.corners(DVec3::ZERO), [[Vec3::ZERO, Vec3::Y, Vec3::X]]);
        // The same point has the same colour from either side.
        assert_eq!(front.point(0, [0.3, 0.6]).colour, back.point(0, [0.6, 0.3]).colour);
        assert_eq!([front.point(0, [0.3, 0.6]).normal.z, back.point(0, [0.6, 0.3]).normal.z], [1.0, -1.0]);
    }

    #[test]
    fn colours_lie_between_texels() {
        let mesh = mesh(AlphaMode::Opaque, Vec3::Z);
        let surface = MeshSurface::new(&mesh);
        // Middles of texels are at a quarter and three quarters.
        for (b, want) in
            [(0.0, [1.0, 0.0]), (0.25, [1.0, 0.0]), (0.5, [0.5, 0.5]), (0.75, [0.0, 1.0]), (1.0, [0.0, 1.0])]
        {
            let SurfacePoint { colour, opacity, .. } = surface.point(0, [b, 0.0]);
            assert!((colour - Vec3::new(want[0], want[1], 0.0)).length() < 1e-6 && opacity == 1.0, "{b}: {colour}");
            assert!(!surface.is_cut_out(0, [b, 0.0]));
        }
    }

    #[test]
    fn opacity_is_cut_or_blended() {
        let [mask, blend] = [AlphaMode::Mask(0.25), AlphaMode::Blend].map(|alpha| mesh(alpha, Vec3::Z));
        let [mask, blend] = [&mask, &blend].map(MeshSurface::new);
        for (b, opacity) in [(0.0, 1.0), (0.5, 0.5), (0.65, 0.2), (1.0, 0.0)] {
            assert_eq!(mask.is_cut_out(0, [b, 0.0]), opacity < 0.25, "{b}");
            assert!(!blend.is_cut_out(0, [b, 0.0]));
            let point = blend.point(0, [b, 0.0]);
            assert!((f64::from(point.opacity) - opacity).abs() < 1e-6, "{b}: {point:?}");
            // What has no opacity gives no colour to its neighbours.
            assert!(opacity == 0.0 || (point.colour - Vec3::X).length() < 1e-6, "{b}: {point:?}");
        }
    }
}
