//! What a point of a mesh looks like: its normal, and its colour under a filter as wide as its surfel.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Vec3, Vec4};

use super::facets::{Facets, Hit, TriangleShape};
use super::pyramid::{Footprint, Pyramid};
use super::{AlphaMode, Mesh, Texture};

/// Standard deviation of the filter of a texture, in cut-off radii: that of a box of one radius, which is the spacing
/// of the surfels (docs/math.md, section 13).
const SIGMA: f64 = 0.288_675;

/// Greatest factor on a colour. Products of two are finite.
const BRIGHTEST: f32 = 65_504.0;

/// The textures of a mesh, ready to be filtered.
pub(super) struct Palette<'a> {
    facets: &'a Facets<'a>,
    pyramids: Vec<Pyramid<'a>>,
    /// Which one each material uses.
    of_material: Vec<Option<usize>>,
    /// Cut-off radius of the surfels' shadows along the rays, model units: of coarse ones, and of fine ones, on each
    /// level.
    radius: Vec<[f64; 2]>,
}

/// What the corners of a triangle say of it.
pub(super) struct Corners {
    /// The unit normal of the triangle, by its winding.
    face: Vec3,
    normal: [Vec3; 3],
    colour: [Vec4; 3],
    alpha: AlphaMode,
}

impl Corners {
    /// Reads the corners of a triangle whose unit normal is `face`.
    pub(super) fn new(mesh: &Mesh, triangle: u32, face: Vec3) -> Self {
        let of_file = mesh.triangles[triangle as usize];
        let corners = of_file.corners.map(|v| v as usize);
        let material = &mesh.materials[of_file.material as usize];
        let sane = |c: Vec4| if c.is_finite() { c.clamp(Vec4::ZERO, Vec4::splat(BRIGHTEST)) } else { Vec4::ONE };
        Self {
            face,
            normal: corners.map(|v| mesh.normal.get(v).copied().unwrap_or_default().try_normalize().unwrap_or(face)),
            colour: corners.map(|v| sane(material.colour) * sane(mesh.colour.get(v).copied().unwrap_or(Vec4::ONE))),
            alpha: material.alpha,
        }
    }

    /// The unit normal where the second and third corner have these weights.
    pub(super) fn normal(&self, [b, c]: [f32; 2]) -> Vec3 {
        let normal = (1.0 - b - c) * self.normal[0] + b * self.normal[1] + c * self.normal[2];
        normal.try_normalize().unwrap_or(self.face)
    }

    /// Colour and opacity there, without the texture.
    pub(super) fn colour(&self, [b, c]: [f32; 2]) -> Vec4 {
        (1.0 - b - c) * self.colour[0] + b * self.colour[1] + c * self.colour[2]
    }

    /// What an opacity means; `None`: cut out.
    pub(super) fn opacity(&self, alpha: f32) -> Option<f32> {
        match self.alpha {
            AlphaMode::Opaque => Some(1.0),
            AlphaMode::Mask(least) => (alpha >= least).then_some(1.0),
            AlphaMode::Blend => Some(alpha.clamp(0.0, 1.0)),
        }
    }

    /// True if the normals of the corners point away from that of the winding.
    pub(super) fn face_away(&self) -> bool {
        self.normal.iter().sum::<Vec3>().dot(self.face) < 0.0
    }
}

/// The colour that a premultiplied texel has by itself; `None` where all is transparent.
pub(super) fn straight(texel: Vec4) -> Option<Vec3> {
    (texel.w > 1e-6).then(|| texel.truncate() / texel.w)
}

/// One triangle, ready to be painted.
pub(super) struct Brush<'a> {
    corners: Corners,
    /// Semi-axes of the surfels, in radii of their shadows; their cross product points as the triangle's normal does.
    axes: [Vec3; 2],
    texture: Option<Stencil<'a>>,
}

/// The texture of a triangle.
struct Stencil<'a> {
    pyramid: &'a Pyramid<'a>,
    /// Texture coordinates of the corners, texels.
    uv: [DVec2; 3],
    footprint: Footprint,
}

/// A painted point.
pub(super) struct Dab {
    pub(super) normal: Vec3,
    pub(super) axes: [Vec3; 2],
    pub(super) colour: Vec3,
    /// `None`: cut out.
    pub(super) opacity: Option<f32>,
}

impl<'a> Palette<'a> {
    /// `radius` as [`Self::radius`], of each level.
    pub(super) fn new(facets: &'a Facets<'a>, textures: &'a [Texture], radius: Vec<[f64; 2]>) -> Self {
        let mesh: &'a Mesh = facets.mesh;
        let mut used = vec![false; mesh.materials.len()];
        facets.kept.iter().for_each(|&i| used[mesh.triangles[i as usize].material as usize] = true);
        let (mut pyramids, mut known) = (Vec::new(), BTreeMap::new());
        let mut of_material = Vec::with_capacity(used.len());
        for (material, used) in mesh.materials.iter().zip(used) {
            let texture = material.texture.filter(|_| used && !mesh.uv.is_empty());
            let texture = texture.and_then(|index| textures.get(index as usize).map(|texture| (index, texture)));
            of_material.push(texture.map(|(index, texture)| {
                let opaque = material.alpha == AlphaMode::Opaque;
                *known.entry((index, opaque)).or_insert_with(|| {
                    pyramids.push(Pyramid::new(texture, opaque));
                    pyramids.len() - 1
                })
            }));
        }
        Self { facets, pyramids, of_material, radius }
    }

    /// Cut-off radius of the shadow of a surfel of a triangle, model units.
    pub(super) fn radius(&self, triangle: u32, fine: bool) -> f64 {
        self.radius[usize::from(self.facets.level(triangle))][usize::from(fine)]
    }

    pub(super) fn brush(&self, triangle: u32, fine: bool) -> Brush<'_> {
        let mesh = self.facets.mesh;
        let shape = self.facets.shape(triangle);
        let face = shape.across.normalize();
        let of_file = mesh.triangles[triangle as usize];
        let corners = of_file.corners.map(|v| v as usize);
        Brush {
            corners: Corners::new(mesh, triangle, face.as_vec3()),
            axes: shadow_axes(face, shape.axis()).map(DVec3::as_vec3),
            texture: self.of_material[of_file.material as usize]
                .map(|index| self.stencil(index, corners, &shape, self.radius(triangle, fine))),
        }
    }

    /// The affine map from the triangle's shadow to its texture makes an ellipse of a circle. With the edges
    /// E = (e1, e2) of the shadow and their texture coordinates F = (f1, f2), a Gaussian of variance s^2 gets the
    /// covariance s^2 F (E^T E)^-1 F^T.
    fn stencil(&self, index: usize, corners: [usize; 3], shape: &TriangleShape, radius: f64) -> Stencil<'_> {
        let pyramid = &self.pyramids[index];
        let size = pyramid.texels();
        let uv = corners.map(|v| {
            let uv = self.facets.mesh.uv.get(v).copied().unwrap_or_default().as_dvec2() * size;
            if uv.is_finite() { uv } else { DVec2::ZERO }
        });
        let corner = shape.corner.map(|p| p - DVec3::AXES[shape.axis()] * p[shape.axis()]);
        let (e, g) = (corner[1] - corner[0], corner[2] - corner[0]);
        let (f, h) = (uv[1] - uv[0], uv[2] - uv[0]);
        let determinant = e.cross(g).length_squared();
        let (ee, eg, gg) = (g.dot(g) / determinant, -e.dot(g) / determinant, e.dot(e) / determinant);
        let form = |a: f64, b: f64, c: f64, d: f64| ee * a * c + eg * (a * d + b * c) + gg * b * d;
        let unit = [form(f.x, h.x, f.x, h.x), form(f.x, h.x, f.y, h.y), form(f.y, h.y, f.y, h.y)];
        let sigma = SIGMA * radius;
        let footprint = pyramid.footprint(unit.map(|x| x * sigma * sigma));
        Stencil { pyramid, uv, footprint }
    }
}

impl Brush<'_> {
    /// The unit normal of the triangle, by its winding.
    pub(super) fn face(&self) -> Vec3 {
        self.corners.face
    }

    pub(super) fn dab(&self, hit: &Hit) -> Dab {
        let normal = self.corners.normal(hit.weight);
        let factor = self.corners.colour(hit.weight);
        let mut colour = factor.truncate();
        let mut alpha = factor.w;
        if let Some(Stencil { pyramid, uv, footprint }) = &self.texture {
            let [b, c] = hit.weight.map(f64::from);
            let at = uv[0] + b * (uv[1] - uv[0]) + c * (uv[2] - uv[0]);
            let texel = pyramid.filter(footprint, at);
            // Where all is transparent there is no colour.
            colour *= straight(texel).unwrap_or(Vec3::ONE);
            alpha *= texel.w;
        }
        let opacity = self.corners.opacity(alpha);
        let [u, v] = self.axes;
        let axes = if u.cross(v).dot(normal) < 0.0 { [v, u] } else { [u, v] };
        Dab { normal, axes, colour, opacity }
    }
}

/// The semi-axes of the ellipse in the plane with the unit normal `face` whose shadow along `axis` is a unit circle:
/// 1 across the slope, and 1 / cos of the slope down it.
fn shadow_axes(face: DVec3, axis: usize) -> [DVec3; 2] {
    let (level, slope) = (face.cross(DVec3::AXES[axis]), face[axis].abs());
    let u = level.try_normalize().filter(|_| slope < 1.0).unwrap_or(DVec3::AXES[(axis + 1) % 3]);
    let v = face.cross(u).normalize_or(DVec3::AXES[(axis + 2) % 3]);
    [u, v / slope]
}
