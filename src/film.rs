//! The film: accumulators that become a [`Picture`].

use glam::DVec3;

/// A channel set beside colour (arbitrary output variable): the coverage-weighted mean over the exposure, divided by alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Aov {
    /// Temporal coverage, 0..=1.
    Alpha,
    /// Camera depth, scene units; +inf where alpha is 0.
    Depth,
    /// Shading normal, world space; 0 where alpha is 0.
    Normal,
    /// Screen velocity, pixels per shutter, x right, y down, forward in time; 0 where alpha is 0.
    Velocity,
}

impl Aov {
    /// All, in the order of their layers.
    pub const ALL: [Self; 4] = [Self::Alpha, Self::Depth, Self::Normal, Self::Velocity];

    /// Layer name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Alpha => "alpha",
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Velocity => "velocity",
        }
    }

    /// Channel names inside the layer.
    pub const fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Alpha => &["A"],
            Self::Depth => &["Z"],
            Self::Normal => &["X", "Y", "Z"],
            Self::Velocity => &["X", "Y"],
        }
    }
}

/// One AOV of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Which.
    pub aov: Aov,
    /// One row-major plane a channel, in the order of [`Aov::channels`].
    pub planes: Vec<Vec<f32>>,
}

/// A finished image: row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear Rec.709, premultiplied by alpha, row-major. Alpha is 1 where a background was composited.
    pub rgba: Vec<[f32; 4]>,
    /// AOVs, in the order of [`Aov::ALL`].
    pub layers: Vec<Layer>,
}

/// What is seen where the film is not covered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Background {
    /// Linear Rec.709.
    pub colour: DVec3,
    /// Leave it out and keep alpha.
    pub transparent: bool,
}
