//! Pictures side by side in one labelled image, with the same enlarged crop below each; and the same as an animation.

mod canvas;
mod crop;
mod layout;

pub use self::canvas::{Canvas, Colour, animation};
pub use self::crop::{Crop, densest, most_different};
pub use self::layout::{Layout, Panel, flip_through, sheet};

/// Why a sheet could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SheetError {
    /// Nothing to show.
    #[error("there are no pictures to show")]
    Nothing,
    /// The pictures are not of one size.
    #[error("the pictures differ in size")]
    Sizes,
    /// The crop is not inside the pictures.
    #[error("the crop {crop} does not lie in a picture of {width} x {height}")]
    Crop {
        /// The crop.
        crop: Crop,
        /// Width of the pictures.
        width: u32,
        /// Height of the pictures.
        height: u32,
    },
    /// The image would be too large.
    #[error("an image of {width} x {height} pixels is too large (at most {limit} in all)", limit = canvas::MAX_PIXELS)]
    Large {
        /// Width.
        width: u64,
        /// Height.
        height: u64,
    },
    /// The encoder failed.
    #[error("cannot encode the image")]
    Encode(#[from] png::EncodingError),
}

#[cfg(test)]
mod tests;
