//! How a frame is rendered: options, and the plan that a backend executes.

use crate::film::Aov;

/// How motion becomes blur.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlurMode {
    /// No motion: everything at the frame number, averaged over sub-pixel offsets.
    Still {
        /// Sub-pixel positions, >= 1.
        pixel_samples: u32,
    },
    /// Temporal supersampling (thesis 3.6.1, 4.3): one visibility test, one normalisation and one shading per time sample.
    Supersample {
        /// Time samples, >= 1.
        samples: u32,
    },
}

/// How sub-pixel positions are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelFilter {
    /// Mean over the pixel's square: each time sample has its own sub-pixel offset.
    #[default]
    Box,
    /// Pixel centres.
    Point,
}

/// Screen-space prefilter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Prefilter {
    /// Botsch et al. 2005 (thesis 4.2.3): the smaller of the object-space and the screen-space radius.
    #[default]
    Approx,
    /// Object-space kernels alone.
    None,
}

/// Where shading happens.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Per pixel, with the averaged normal (deferred; thesis 4.1.1).
    #[default]
    Phong,
    /// Per surfel.
    Gouraud,
}

/// How frames are splatted. Defaults: design section 2.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Blur mode.
    pub mode: BlurMode,
    /// Sub-pixel positions.
    pub filter: PixelFilter,
    /// Screen-space prefilter.
    pub prefilter: Prefilter,
    /// Where shading happens.
    pub shading: Shading,
    /// Show back faces, with their normals turned to the viewer.
    pub two_sided: bool,
    /// Depth tolerance for all objects, world units, >= 0; overrides the scene's.
    pub epsilon: Option<f64>,
    /// Seed of the sub-pixel offsets.
    pub seed: u64,
    /// Bytes that a frame may take beside the models.
    pub memory: u64,
    /// Extra channels, in the order of [`Aov::ALL`], each at most once.
    pub aovs: Vec<Aov>,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            mode: BlurMode::Supersample { samples: 32 },
            filter: PixelFilter::Box,
            prefilter: Prefilter::Approx,
            shading: Shading::Phong,
            two_sided: false,
            epsilon: None,
            seed: 1,
            memory: 1 << 30,
            aovs: Vec::new(),
        }
    }
}
