//! Environments: light from all around, as a picture of the whole sphere of directions.
//!
//! `lat_long` is the picture; `cube` is what backends look it up in, filtered to several widths; `light` is what it
//! lights surfaces with; `studio` is one made by formula.

pub(crate) mod cube;
mod lat_long;
mod light;
mod studio;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};

pub use self::cube::Cube;
pub use self::lat_long::{LatLong, NotLatLong};
use self::light::Brightness;
pub use self::studio::studio;

/// What surrounds the scene, infinitely far: surfaces with a reflection coefficient mirror it (Pfister et al. 2000,
/// section 7.5), it may be the background, and it may light the scene.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Shared by copies of the environment, as its levels are.
    map: Arc<LatLong>,
    /// The file that it came from; empty for one made in code.
    pub path: PathBuf,
    /// Turns it about +y, radians, right-handed.
    pub rotation: f64,
    /// Factor on its radiance, >= 0.
    pub intensity: f64,
    /// True: it shows where no surface does.
    pub background: bool,
    /// True: it lights the scene, as one more light.
    pub light: bool,
    /// Do there are shadows in its light, on surfaces? Without them its light is smooth: nine harmonics.
    pub shadows: bool,
    cube: Arc<OnceLock<Arc<Cube>>>,
    brightness: Arc<OnceLock<Brightness>>,
}

impl Environment {
    /// An environment that is not turned, with intensity 1, and neither the background nor a light. As a light it would
    /// have shadows.
    pub fn new(map: LatLong) -> Self {
        Self {
            map: Arc::new(map),
            path: PathBuf::new(),
            rotation: 0.0,
            intensity: 1.0,
            background: false,
            light: false,
            shadows: true,
            cube: Arc::default(),
            brightness: Arc::default(),
        }
    }

    /// The same environment as a light with shadows.
    #[must_use]
    pub fn lighting(self) -> Self {
        Self { light: true, shadows: true, ..self }
    }

    /// The picture.
    pub fn map(&self) -> &LatLong {
        &self.map
    }

    /// The filtered map, not turned and with intensity 1. It is made once for all copies of the environment.
    #[doc(hidden)]
    pub fn cube(&self) -> Arc<Cube> {
        Arc::clone(self.cube.get_or_init(|| Arc::new(Cube::new(&self.map))))
    }

    /// The environment as backends look it up.
    #[doc(hidden)]
    pub fn surroundings(&self) -> Surroundings {
        let (sin, cos) = libm::sincos(self.rotation);
        Surroundings { cube: self.cube(), turn: [cos as f32, sin as f32], intensity: self.intensity as f32 }
    }

    /// The radiance from the unit direction `towards`, world space, without any filter.
    pub fn radiance(&self, towards: DVec3) -> DVec3 {
        let (sin, cos) = libm::sincos(self.rotation);
        let turned = DVec3::new(towards.x * cos - towards.z * sin, towards.y, towards.x * sin + towards.z * cos);
        self.map.radiance(turned) * self.intensity
    }

    /// The same in single precision.
    pub(crate) fn radiance_nearly(&self, towards: Vec3) -> Vec3 {
        let (sin, cos) = libm::sincosf(self.rotation as f32);
        let turned = Vec3::new(towards.x * cos - towards.z * sin, towards.y, towards.x * sin + towards.z * cos);
        self.map.radiance_nearly(turned) * self.intensity as f32
    }

    /// Does any light come from it?
    pub(crate) fn shines(&self) -> bool {
        self.light && self.intensity > 0.0 && !self.brightness().is_dark()
    }

    /// A unit direction towards it, world space, that is drawn in proportion to brightness, and the light from there:
    /// a white surface that faces it shows so much. The mean over the unit square is the light of the whole. It must
    /// not be dark.
    pub(crate) fn drawn(&self, point: [f64; 2]) -> (DVec3, DVec3) {
        let (towards, light) = self.brightness().draw(&self.map, point);
        let (sin, cos) = libm::sincos(self.rotation);
        let turned = DVec3::new(towards.x * cos + towards.z * sin, towards.y, towards.z * cos - towards.x * sin);
        (turned, light * self.intensity)
    }

    /// The light that a white surface receives without shadows, as nine harmonics of its normal:
    /// [`ShadingLight::Harmonics`](crate::shading::ShadingLight::Harmonics).
    pub(crate) fn harmonics(&self) -> [Vec3; 9] {
        let terms = light::turned(self.brightness().terms(), libm::sincos(self.rotation));
        terms.map(|term| (term * self.intensity).as_vec3())
    }

    fn brightness(&self) -> &Brightness {
        self.brightness.get_or_init(|| Brightness::new(&self.map))
    }

    /// Bytes of the picture and of the filtered map.
    pub fn bytes(&self) -> u64 {
        self.map.bytes() + Cube::bytes_of(&self.map)
    }
}

/// An environment, filtered and turned. Twin: shaders/common/environment.wgsl.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// The filtered map.
    pub cube: Arc<Cube>,
    /// Cosine and sine of the environment's rotation about +y.
    pub turn: [f32; 2],
    /// Factor on its radiance.
    pub intensity: f32,
}

impl Surroundings {
    /// The mean radiance around the direction `towards`, world space, of any length, under a kernel on the sphere with
    /// `variance` radians^2.
    #[inline]
    pub fn radiance(&self, towards: [f32; 3], variance: f32) -> Vec3 {
        let [x, y, z] = towards;
        let [cos, sin] = self.turn;
        self.cube.radiance(Vec3::new(x * cos - z * sin, y, x * sin + z * cos), variance) * self.intensity
    }
}
