//! Captures: 3D Gaussians (Kerbl et al. 2023), as the files of several programs hold them.
//!
//! Readers turn what a file says into [`Gaussians`], in one frame and one meaning. `surfels` makes opaque surfels of
//! them, for scenes that ask for it.

pub(super) mod compressed_ply;
mod glb;
mod smallest_three;
#[cfg(feature = "formats")]
mod sog;
mod splat;
#[cfg(feature = "formats")]
mod spz;
mod surfels;

use glam::{Quat, Vec3};

pub(super) use glb::parse as parse_glb;
#[cfg(feature = "formats")]
pub(super) use sog::parse as parse_sog;
pub(super) use splat::parse as parse_splat;
#[cfg(feature = "formats")]
pub(super) use spz::parse as parse_spz;

#[cfg(not(feature = "formats"))]
use super::error::ParseError;
use super::flaw::{self, Columns};
use super::tidy::MAX_COORDINATE;
use crate::limits::{self, Invalid};

/// The spherical harmonic of degree 0: 1 / (2 sqrt(pi)).
const SH_C0: f32 = 0.282_094_8;

/// Bytes of Gaussians that every file may have, however small it is.
const FREE_BYTES: u64 = 64 << 20;

/// Most bytes of Gaussians for each byte of a file. Real captures have 3 to 6.
const MOST_GROWTH: u64 = 100;

/// Highest degree of harmonics that is kept.
const MOST_DEGREE: u8 = 3;

/// Coefficients of the degrees 1 to 3.
pub(super) const MOST_HARMONICS: usize = 15;

/// What the opacity of Gaussians means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Optics {
    /// The largest alpha of a Gaussian on the screen, in [0, 1] (Kerbl et al. 2023).
    #[default]
    Alpha,
    /// A Gaussian is the kernel of a sample of a volume (Zwicker et al. 2002, eq. 25): its opacity is the integral of
    /// extinction over space, in extinction per scene unit times model units^3; >= 0.
    Extinction {
        /// Depth within which kernels are composited as one layer, model units, > 0.
        layer: f32,
    },
}

/// Transparent 3D Gaussians, as structure of arrays.
///
/// The frame of captures is that of the plain PLY files: x right, y down, z forward. Readers of other frames turn into
/// it. Volumes keep the axes of their file. All values are finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gaussians {
    /// Centres, model units.
    pub position: Vec<Vec3>,
    /// Standard deviations along the three axes of the rotation, model units, >= 0.
    pub sigma: Vec<Vec3>,
    /// From the axes of a Gaussian to the model; unit quaternions.
    pub rotation: Vec<Quat>,
    /// Opacity at the centre, in [0, 1], or what `optics` says.
    pub opacity: Vec<f32>,
    /// What opacities mean.
    pub optics: Optics,
    /// Unit normals that lights shade, or 0 for a Gaussian that has none; empty where Gaussians emit their colours.
    pub normal: Vec<Vec3>,
    /// Coefficients of the harmonic of degree 0, for red, green and blue. See [`Self::colour`].
    pub base: Vec<Vec3>,
    /// Coefficients of the harmonics of degrees 1 to `degree`, for red, green and blue: [`Self::harmonics_each`] for
    /// each Gaussian, by degree and then from -degree to degree. Real harmonics with the Condon-Shortley sign; the
    /// direction is from the eye to the centre.
    pub harmonics: Vec<Vec3>,
    /// Highest degree of harmonics, 0 to 3.
    pub degree: u8,
    /// True if the file says that the capture was trained with the filter of an antialiased rasteriser: whoever widens
    /// a Gaussian by the filter then lowers its opacity.
    pub antialiased: bool,
    /// How the file's axes were turned into the common ones; `None`: not at all.
    pub turned: Option<&'static str>,
    /// True if colours are linear light. Else they are sRGB-encoded.
    pub linear: bool,
    /// What a user should know: Gaussians that were dropped, properties that were ignored.
    pub notes: Vec<String>,
    /// Gaussians that were dropped because they cannot be drawn.
    pub dropped: usize,
}

/// One Gaussian of a file, in any precision that the file has, not yet checked.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gaussian {
    pub position: [f64; 3],
    /// Standard deviations, model units.
    pub sigma: [f64; 3],
    /// w, x, y, z; of any length.
    pub rotation: [f64; 4],
    pub opacity: f64,
    pub base: [f64; 3],
    /// The first [`Gaussians::harmonics_each`] count.
    pub harmonics: [Vec3; MOST_HARMONICS],
}

impl Gaussians {
    /// None yet, with harmonics up to `degree`.
    pub(super) fn of_degree(degree: u8) -> Self {
        Self { degree: degree.min(MOST_DEGREE), ..Self::default() }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Checks whether the columns go together and hold what can be drawn. It looks at each entry once.
    ///
    /// # Errors
    /// The first column that does not.
    pub(crate) fn check(&self) -> Result<(), Invalid> {
        let columns = Columns(self.len());
        columns.check("sigma", self.sigma.len())?;
        columns.check("rotation", self.rotation.len())?;
        columns.check("opacity", self.opacity.len())?;
        columns.check("base", self.base.len())?;
        columns.check_optional("normal", self.normal.len())?;
        limits::check_count("degree", self.degree.into(), &(0..=MOST_DEGREE.into()))?;
        let coefficients = self.len() * self.harmonics_each();
        if self.harmonics.len() != coefficients {
            let found = format!("{} entries long", self.harmonics.len());
            return Err(Invalid::new("harmonics", found, format!("{coefficients} entries")));
        }
        flaw::each("position", &self.position, flaw::is_place, flaw::PLACE)?;
        let is_sigma = |sigma: Vec3| flaw::is_place(sigma) && sigma.min_element() >= 0.0;
        flaw::each("sigma", &self.sigma, is_sigma, "numbers from 0 to 1e18")?;
        flaw::each("rotation", &self.rotation, |q| (q.length_squared() - 1.0).abs() < 0.01, "a unit quaternion")?;
        let most = if self.optics == Optics::Alpha { 1.0 } else { f32::MAX };
        let expected = format!("a number from 0 to {most}");
        flaw::each("opacity", &self.opacity, |opacity| (0.0..=most).contains(&opacity), &expected)?;
        flaw::each("normal", &self.normal, flaw::is_normal, "a vector of length at most 1")?;
        flaw::each("base", &self.base, flaw::is_place, flaw::PLACE)?;
        flaw::each("harmonics", &self.harmonics, flaw::is_place, flaw::PLACE)
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        let each = 3 * size_of::<Vec3>() + size_of::<Quat>() + size_of::<f32>();
        (self.len() * each + size_of_val(self.harmonics.as_slice()) + size_of_val(self.normal.as_slice())) as u64
    }

    /// Coefficients of harmonics above degree 0 that each Gaussian has: 0, 3, 8 or 15.
    pub fn harmonics_each(&self) -> usize {
        harmonics_of(self.degree)
    }

    /// The part of Gaussian `index`'s colour that is the same from all sides: 0.5 and the harmonic of degree 0. In the
    /// space of the capture; it may lie outside [0, 1].
    pub fn colour(&self, index: usize) -> Vec3 {
        0.5 + SH_C0 * self.base[index]
    }

    /// The coefficient of degree 0 ([`Self::base`]) that gives a colour, up to rounding. The colour is in the space of
    /// the capture, which [`Self::linear`] names.
    pub fn base_of(colour: Vec3) -> Vec3 {
        (colour - 0.5) / SH_C0
    }

    /// Appends one of a file, or counts it as dropped where it cannot be drawn: where a number is not finite or too
    /// large, the rotation has no direction, or the opacity is not one.
    pub(super) fn push(&mut self, of_file: &Gaussian) {
        let Gaussian { position, sigma, rotation, opacity, base, harmonics } = *of_file;
        let harmonics = &harmonics[..self.harmonics_each()];
        let length = rotation.iter().map(|x| x * x).sum::<f64>().sqrt();
        let sane = position.iter().all(|x| x.abs() <= MAX_COORDINATE)
            && sigma.iter().all(|s| (0.0..=MAX_COORDINATE).contains(s))
            && (1e-15..1e15).contains(&length)
            && (0.0..=1.0).contains(&opacity)
            && base.iter().all(|c| c.abs() <= MAX_COORDINATE)
            && harmonics.iter().all(|c| c.is_finite());
        if !sane {
            self.dropped += 1;
            return;
        }
        let [w, x, y, z] = rotation.map(|x| (x / length) as f32);
        self.position.push(Vec3::from_array(position.map(|x| x as f32)));
        self.sigma.push(Vec3::from_array(sigma.map(|s| s as f32)));
        self.rotation.push(Quat::from_xyzw(x, y, z, w));
        self.opacity.push(opacity as f32);
        self.base.push(Vec3::from_array(base.map(|c| c as f32)));
        self.harmonics.extend_from_slice(harmonics);
    }
}

/// Refuses an SPZ file: what inflates it is not part of this program.
#[cfg(not(feature = "formats"))]
pub(super) fn parse_spz(_: &[u8]) -> Result<Gaussians, ParseError> {
    Err(needs_formats("an SPZ capture"))
}

/// Refuses a SOG file: what unpacks it is not part of this program.
#[cfg(not(feature = "formats"))]
pub(super) fn parse_sog(_: &[u8], _: &dyn Fn(f32)) -> Result<Gaussians, ParseError> {
    Err(needs_formats("a SOG capture"))
}

#[cfg(not(feature = "formats"))]
pub(super) fn needs_formats(found: &str) -> ParseError {
    ParseError::byte(0, found, "a program built with the Cargo feature `formats`, which reads it")
}

/// Most bytes of Gaussians that a file of `size` bytes may hold: what compresses better, or stands in more places of a
/// scene, is no capture but an attempt to fill memory.
fn allowance(size: usize) -> u64 {
    FREE_BYTES + MOST_GROWTH * size as u64
}

/// Number of harmonics of degrees 1 to `degree`.
pub(super) fn harmonics_of(degree: u8) -> usize {
    let degree = usize::from(degree);
    (degree + 1) * (degree + 1) - 1
}

/// The opacity of a logit.
pub(super) fn logistic(logit: f64) -> f64 {
    1.0 / (1.0 + (-logit).exp())
}
