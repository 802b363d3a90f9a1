//! What an object is made of, with what is derived from it once.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::model::{GaussianModel, NO_SURFELS, SurfelModel};
use super::sequence::Sequence;
use crate::limits::Invalid;
use crate::math::Bounds;
use crate::model::paths::Paths;
use crate::model::{Gaussians, LoadedModel, LoadedShape, Material, Optics, Surfels, VelocityUnit};

/// What an object is made of: exactly one of these.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Discs and ellipses that cover a surface.
    Surfels {
        /// The surfels.
        model: SurfelModel,
        /// How they move by themselves.
        points: PointMotion,
        /// How their surface looks.
        surface: Surface,
    },
    /// A capture: Gaussians with opacities and colours.
    Gaussians {
        /// The Gaussians.
        model: GaussianModel,
        /// How they are drawn.
        capture: Capture,
    },
    /// A volume, as kernels that absorb and emit.
    Volume {
        /// The kernels.
        model: GaussianModel,
        /// Material of all kernels that lights shade; `None`: the default.
        material: Option<Material>,
    },
    /// Point files of many frames.
    Sequence {
        /// The files.
        files: Arc<Sequence>,
        /// Unit of time of the files' velocities; `None`: as each file says.
        unit: Option<VelocityUnit>,
        /// How the surface of all files looks.
        surface: Surface,
    },
    /// A sphere about the model's origin.
    Sphere {
        /// Its size and colour.
        sphere: Sphere,
        /// The same as a model of one sphere, as `From<Sphere>` makes it.
        model: SurfelModel,
        /// How its surface looks.
        surface: Surface,
    },
}

impl Shape {
    /// The surfels; `None` for other shapes.
    pub fn surfels(&self) -> Option<&SurfelModel> {
        match self {
            Self::Surfels { model, .. } | Self::Sphere { model, .. } => Some(model),
            Self::Gaussians { .. } | Self::Volume { .. } | Self::Sequence { .. } => None,
        }
    }

    /// The surfels; empty ones for other shapes.
    pub(crate) fn surfels_or_none(&self) -> &Arc<Surfels> {
        self.surfels().map_or(&NO_SURFELS, |model| &model.surfels)
    }

    /// The Gaussians of a capture or the kernels of a volume; `None` for other shapes.
    pub fn gaussians(&self) -> Option<&GaussianModel> {
        match self {
            Self::Gaussians { model, .. } | Self::Volume { model, .. } => Some(model),
            Self::Surfels { .. } | Self::Sequence { .. } | Self::Sphere { .. } => None,
        }
    }

    /// The same, to be changed.
    pub fn gaussians_mut(&mut self) -> Option<&mut GaussianModel> {
        match self {
            Self::Gaussians { model, .. } | Self::Volume { model, .. } => Some(model),
            Self::Surfels { .. } | Self::Sequence { .. } | Self::Sphere { .. } => None,
        }
    }

    /// Is it a capture or a volume? Gaussians have no sides. They are sorted by depth and composited.
    pub(crate) fn is_composited(&self) -> bool {
        match self {
            Self::Gaussians { .. } | Self::Volume { .. } => true,
            Self::Surfels { .. } | Self::Sequence { .. } | Self::Sphere { .. } => false,
        }
    }

    /// The files of a sequence; `None` for other shapes.
    pub fn sequence(&self) -> Option<&Arc<Sequence>> {
        match self {
            Self::Sequence { files, .. } => Some(files),
            Self::Surfels { .. } | Self::Gaussians { .. } | Self::Volume { .. } | Self::Sphere { .. } => None,
        }
    }

    /// How surfels move by themselves; `None` for other shapes.
    pub fn points_mut(&mut self) -> Option<&mut PointMotion> {
        match self {
            Self::Surfels { points, .. } => Some(points),
            Self::Gaussians { .. } | Self::Volume { .. } | Self::Sequence { .. } | Self::Sphere { .. } => None,
        }
    }

    /// Number of surfels, Gaussians or kernels; 0 for a sequence, 1 for a sphere.
    pub fn elements(&self) -> usize {
        self.positions().len()
    }

    /// Centres of surfels, Gaussians or kernels, relative to [`Self::origin`]; none for other shapes.
    pub(crate) fn positions(&self) -> &[Vec3] {
        match self {
            Self::Surfels { model, .. } | Self::Sphere { model, .. } => &model.surfels.position,
            Self::Gaussians { model, .. } | Self::Volume { model, .. } => &model.gaussians.position,
            Self::Sequence { .. } => &[],
        }
    }

    /// The point of model space that positions are relative to.
    pub(crate) fn origin(&self) -> DVec3 {
        self.surfels_or_none().origin
    }

    /// How surfels move by themselves; no paths for other shapes.
    pub(crate) fn paths(&self) -> Paths<'_> {
        self.surfels().map_or_else(|| NO_SURFELS.paths(), SurfelModel::paths)
    }

    /// How its surface looks; `None` for captures and volumes, which have no surface.
    pub fn surface(&self) -> Option<&Surface> {
        match self {
            Self::Surfels { surface, .. } | Self::Sequence { surface, .. } | Self::Sphere { surface, .. } => {
                Some(surface)
            }
            Self::Gaussians { .. } | Self::Volume { .. } => None,
        }
    }

    /// The same, to be changed.
    pub fn surface_mut(&mut self) -> Option<&mut Surface> {
        match self {
            Self::Surfels { surface, .. } | Self::Sequence { surface, .. } | Self::Sphere { surface, .. } => {
                Some(surface)
            }
            Self::Gaussians { .. } | Self::Volume { .. } => None,
        }
    }

    /// Material of the whole object; `None`: the model's own, else the default. Captures have none.
    pub fn material(&self) -> Option<Material> {
        match self {
            Self::Volume { material, .. } => *material,
            _ => self.surface()?.material,
        }
    }

    /// Gives the whole object a material. Nothing happens to a capture, which has none.
    pub(crate) fn set_material(&mut self, new: Material) {
        match self {
            Self::Volume { material, .. } => *material = Some(new),
            _ => {
                if let Some(surface) = self.surface_mut() {
                    surface.material = Some(new);
                }
            }
        }
    }

    /// Median of the cut-off radii, or of twice the largest standard deviations of Gaussians, model space; 0 for a
    /// shape that has none.
    pub fn median_radius(&self) -> f32 {
        match self {
            Self::Surfels { model, .. } | Self::Sphere { model, .. } => model.median_radius,
            Self::Gaussians { model, .. } | Self::Volume { model, .. } => model.median_radius,
            Self::Sequence { .. } => 0.0,
        }
    }

    /// Depth tolerance of the visibility rule where nobody chose one, model space ([`Surfels::tolerance`]); for
    /// Gaussians the distance by which they may lie behind surfels.
    pub fn tolerance(&self) -> f32 {
        match self {
            Self::Surfels { model, .. } | Self::Sphere { model, .. } => model.tolerance,
            _ => self.median_radius(),
        }
    }

    /// Box around the centres of surfels, Gaussians or kernels, or around the ideal sphere, in model space;
    /// empty for a shape without any.
    pub fn bounds(&self) -> Bounds {
        match self {
            Self::Surfels { model, .. } => model.bounds,
            Self::Gaussians { model, .. } | Self::Volume { model, .. } => model.bounds(),
            Self::Sequence { files, .. } => files.bounds(),
            Self::Sphere { sphere, .. } => sphere.bounds(),
        }
    }

    /// Box around what a viewer looks at, model space: [`Self::bounds`] without the strays of a capture.
    pub fn core(&self) -> Bounds {
        match self {
            Self::Gaussians { model, .. } | Self::Volume { model, .. } => model.core(),
            Self::Surfels { .. } | Self::Sequence { .. } | Self::Sphere { .. } => self.bounds(),
        }
    }

    /// How its Gaussians are drawn, with a factor on all opacities; `None` for other shapes.
    pub(crate) fn drawing(&self, opacity: f64) -> Option<Drawing> {
        let (GaussianModel { crop, flat, .. }, Capture { harmonics, antialias }) = match self {
            Self::Gaussians { model, capture } => (model, *capture),
            Self::Volume { model, .. } => (model, Capture::default()),
            Self::Surfels { .. } | Self::Sequence { .. } | Self::Sphere { .. } => return None,
        };
        Some(Drawing { opacity, harmonics, crop: *crop, antialias, flat: *flat })
    }

    /// Why it cannot be rendered; `None` if it can.
    pub(crate) fn flaw(&self) -> Option<&Invalid> {
        match self {
            Self::Surfels { model, .. } => model.flaw.as_deref(),
            Self::Gaussians { model, .. } | Self::Volume { model, .. } => model.flaw.as_deref(),
            Self::Sequence { .. } | Self::Sphere { .. } => None,
        }
    }
}

impl Default for Shape {
    /// No surfels.
    fn default() -> Self {
        SurfelModel::default().into()
    }
}

/// How the surface of an object looks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surface {
    /// The whole object's material; `None`: the model's own, else the default.
    pub material: Option<Material>,
    /// Share of the environment's radiance that it mirrors, in [0, 1].
    pub reflection: f64,
    /// True: back faces show, with their normals turned to the viewer. A new object does as its model says.
    pub two_sided: bool,
}

/// How the points of a model move by themselves: p(t) = p + v t + a t^2/2, with the model's velocities v and
/// accelerations a.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointMotion {
    /// Unit of time of velocities and accelerations; `None`: that of the model.
    pub unit: Option<VelocityUnit>,
    /// Frame at which the points are where the model has them. `None`: each frame is, so t is 0 at the frame's number.
    pub at: Option<f64>,
}

/// How the Gaussians of a capture are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capture {
    /// Highest degree of harmonics that colours have, as far as the capture has them.
    pub harmonics: u8,
    /// Whether a Gaussian that is widened by the filter loses opacity; `None`: as the file says.
    pub antialias: Option<bool>,
}

impl Capture {
    /// The highest degree of harmonics.
    pub const MOST_HARMONICS: u8 = 3;
}

impl Default for Capture {
    fn default() -> Self {
        Self { harmonics: Self::MOST_HARMONICS, antialias: None }
    }
}

/// How Gaussians of a capture or kernels of a volume are drawn: all that an object says of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawing {
    /// Factor on all opacities, in [0, 1].
    pub opacity: f64,
    /// Highest degree of harmonics that colours have, as far as the capture has them.
    pub harmonics: u8,
    /// The box of the centres that show, model space; both corners belong to it. `None`: all show.
    pub crop: Option<[DVec3; 2]>,
    /// Whether a Gaussian that is widened by the filter loses opacity; `None`: as the file says.
    pub antialias: Option<bool>,
    /// The colour of all, linear Rec.709, in place of their own.
    pub flat: Option<Vec3>,
}

impl Default for Drawing {
    fn default() -> Self {
        Self { opacity: 1.0, harmonics: Capture::MOST_HARMONICS, crop: None, antialias: None, flat: None }
    }
}

/// The thesis's ideal sphere (B.2.4), about the model's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Radius, model space, > 0.
    pub radius: f64,
    /// Colour, linear Rec.709.
    pub colour: Vec3,
}

impl Sphere {
    fn bounds(&self) -> Bounds {
        [DVec3::splat(-self.radius), DVec3::splat(self.radius)].into_iter().collect()
    }
}

impl From<SurfelModel> for Shape {
    fn from(model: SurfelModel) -> Self {
        let surface = Surface { two_sided: model.surfels.two_sided, ..Surface::default() };
        Self::Surfels { model, points: PointMotion::default(), surface }
    }
}

impl From<Arc<Surfels>> for Shape {
    fn from(surfels: Arc<Surfels>) -> Self {
        SurfelModel::from(surfels).into()
    }
}

impl From<Surfels> for Shape {
    fn from(surfels: Surfels) -> Self {
        SurfelModel::from(surfels).into()
    }
}

impl From<GaussianModel> for Shape {
    /// A capture or a volume, as the optics of the Gaussians say.
    fn from(model: GaussianModel) -> Self {
        match model.gaussians.optics {
            Optics::Alpha => Self::Gaussians { model, capture: Capture::default() },
            Optics::Extinction { .. } => Self::Volume { model, material: None },
        }
    }
}

impl From<Arc<Gaussians>> for Shape {
    fn from(gaussians: Arc<Gaussians>) -> Self {
        GaussianModel::from(gaussians).into()
    }
}

impl From<Gaussians> for Shape {
    fn from(gaussians: Gaussians) -> Self {
        GaussianModel::from(gaussians).into()
    }
}

impl From<Sphere> for Shape {
    fn from(sphere: Sphere) -> Self {
        let [u, v] = crate::model::sphere_axes(sphere.radius as f32);
        let surfels = Surfels {
            position: vec![Vec3::ZERO],
            axis_u: vec![u],
            axis_v: vec![v],
            normal: vec![Vec3::Z],
            colour: vec![sphere.colour],
            two_sided: true,
            spheres: true,
            ..Surfels::default()
        };
        Self::Sphere { sphere, model: SurfelModel::from(surfels), surface: Surface::default() }
    }
}

impl From<LoadedModel> for Shape {
    /// Surfels are sorted along a curve through space.
    fn from(loaded: LoadedModel) -> Self {
        match loaded.shape {
            LoadedShape::Surfels(surfels, mesh) => {
                let model = SurfelModel::checked(Arc::new(surfels.spatially_ordered()));
                match mesh {
                    Some(source) => model.of_mesh(source.into_mesh()).into(),
                    None => model.into(),
                }
            }
            LoadedShape::Capture(gaussians) | LoadedShape::Volume(gaussians, _) => {
                GaussianModel::checked(Arc::new(gaussians)).into()
            }
        }
    }
}
