//! Environments: light from all around, as a picture of the whole sphere of directions.
//!
//! `lat_long` is the picture; `cube` is what backends look it up in, filtered to several widths;
//! `studio` is one made by formula.

pub(crate) mod cube;
mod lat_long;
mod studio;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};

pub use self::cube::Cube;
pub use self::lat_long::{LatLong, NotLatLong};
pub use self::studio::studio;

/// What surrounds the scene, infinitely far: surfaces with a reflection coefficient mirror it (Pfister et al. 2000,
/// section 7.5), and it may be the background.
///
/// It lights nothing: diffuse and specular terms are those of lights.
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
    cube: Arc<OnceLock<Arc<Cube>>>,
}

impl Environment {
    /// An environment that is not turned, with intensity 1, and not the background.
    pub fn new(map: LatLong) -> Self {
        Self {
            map: Arc::new(map),
            path: PathBuf::new(),
            rotation: 0.0,
            intensity: 1.0,
            background: false,
            cube: Arc::default(),
        }
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
