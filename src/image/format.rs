//! The formats of picture files, and their options.

use std::path::Path;

/// Bits of a PNG channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bits {
    /// 0..=255.
    #[default]
    Eight,
    /// 0..=65535.
    Sixteen,
}

/// How an EXR file stores the numbers of its channels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 16 bits a channel, up to 65504, with 11 significant bits. Layers that this would spoil stay as they are in
    /// [`Precision::Float`] ([`Aov::needs_float`](crate::film::Aov::needs_float)).
    Half,
    /// 32 bits a channel: what the renderer computes, unchanged.
    #[default]
    Float,
}

/// How an EXR file is made smaller. Every way gives the same numbers back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
    None,
    /// Runs of equal bytes.
    Rle,
    /// Deflate, each row by itself.
    Zips,
    /// Deflate, 16 rows together.
    #[default]
    Zip,
    /// Wavelets, 32 rows together; best for noisy pictures.
    Piz,
}

impl Compression {
    /// All, with their names.
    pub const ALL: [(&'static str, Self); 5] =
        [("none", Self::None), ("rle", Self::Rle), ("zips", Self::Zips), ("zip", Self::Zip), ("piz", Self::Piz)];

    /// Its name, as `OpenEXR` has it.
    pub fn name(self) -> &'static str {
        Self::ALL.into_iter().find(|(_, of_name)| *of_name == self).map_or("", |(name, _)| name)
    }
}

/// Options of an EXR file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exr {
    /// How numbers are stored.
    pub precision: Precision,
    /// How the file is made smaller.
    pub compression: Compression,
}

/// File formats that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// sRGB-encoded, straight alpha; no AOVs.
    Png {
        /// Channel depth.
        bits: Bits,
        /// RGBA instead of RGB. The caller decides, not the pixels: so all frames of a sequence have one type.
        alpha: bool,
    },
    /// Linear, premultiplied; AOVs as layers.
    Exr(Exr),
}

impl Format {
    /// EXR with the default options: 32-bit float, ZIP.
    pub const EXR: Self = Self::Exr(Exr { precision: Precision::Float, compression: Compression::Zip });

    /// The format that a file's extension names, in upper or lower case: 8-bit PNG (RGBA if `alpha`, else RGB), or EXR
    /// with the default options.
    pub fn of(path: &Path, alpha: bool) -> Option<Self> {
        let extension = path.extension()?;
        if extension.eq_ignore_ascii_case("png") {
            Some(Self::Png { bits: Bits::Eight, alpha })
        } else if extension.eq_ignore_ascii_case("exr") {
            Some(Self::EXR)
        } else {
            None
        }
    }

    /// File name extension.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Png { .. } => "png",
            Self::Exr(_) => "exr",
        }
    }

    /// Bits of a channel of colour.
    pub const fn bits(self) -> u32 {
        match self {
            Self::Png { bits: Bits::Eight, .. } => 8,
            Self::Png { bits: Bits::Sixteen, .. } | Self::Exr(Exr { precision: Precision::Half, .. }) => 16,
            Self::Exr(Exr { precision: Precision::Float, .. }) => 32,
        }
    }
}
