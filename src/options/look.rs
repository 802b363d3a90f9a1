//! What a picture shows, whoever makes it.

use super::{PixelFilter, Shading};
use crate::film::Aov;
use crate::limits::{self, Invalid};

/// The choices that a picture of the renderer and one of the reference have in common. Pictures of different looks
/// cannot be compared, so both take them from one value.
///
/// ```
/// use splatblur::reference::ReferenceOptions;
/// use splatblur::{Look, PixelFilter, RenderOptions};
///
/// let look = Look { filter: PixelFilter::Gaussian { sigma: 0.5 }, seed: 7, ..Look::default() };
/// let splatted = RenderOptions { look: look.clone(), ..RenderOptions::default() };
/// let traced = ReferenceOptions { samples: 256, look, ..ReferenceOptions::default() };
/// assert_eq!(splatted.look, traced.look);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// What a pixel is a mean of. Default: its square.
    pub filter: PixelFilter,
    /// Where shading happens. Default: per pixel.
    pub shading: Shading,
    /// Show the back faces of all objects, with their normals turned to the viewer. Default: as each object says.
    pub two_sided: bool,
    /// Depth tolerance of visibility for all objects, scene units, 0 to 1e30. `None`: the scene's.
    pub epsilon: Option<f64>,
    /// Show the shadows of lights that have them. Without, lights are points or directions. Default: true.
    pub shadows: bool,
    /// Seed of sub-pixel offsets, of random times and of points on lights. Default: 1.
    pub seed: u64,
    /// Extra channels, in the order of [`Aov::LAYERS`], each at most once. Default: none. A reference cannot make
    /// [`Aov::LodError`] and [`Aov::Object`], and it always has [`Aov::Error`].
    pub aovs: Vec<Aov>,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            filter: PixelFilter::Box,
            shading: Shading::Phong,
            two_sided: false,
            epsilon: None,
            shadows: true,
            seed: 1,
            aovs: Vec::new(),
        }
    }
}

impl Look {
    /// Checks all values. The renderer and the reference do it by themselves.
    ///
    /// # Errors
    /// The first number that is out of its bounds, or a channel that is out of order or there twice.
    pub fn check(&self) -> Result<(), Invalid> {
        self.filter.check()?;
        if let Some(epsilon) = self.epsilon {
            limits::EPSILON.check("epsilon", epsilon)?;
        }
        match self.aovs.windows(2).find(|pair| pair[0] >= pair[1]) {
            None => Ok(()),
            Some(pair) => {
                let found = format!("{} before {}", pair[0].name(), pair[1].name());
                let order = Aov::LAYERS.map(Aov::name).join(", ");
                Err(Invalid::new("aovs", found, format!("each at most once, in this order: {order}")))
            }
        }
    }
}
