//! Coded normals and colours of .sfl records.

use glam::{DVec3, Vec3};

/// How normals are coded: bits 2 and 3 of the property mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NormalCode {
    /// Three floats.
    Plain,
    /// Cube map, 16 bits.
    Cube16,
    /// Cube map, 32 bits.
    Cube32,
}

impl NormalCode {
    /// The code in the property mask; `None` for the code "ico8", which was never implemented.
    pub(super) fn from_mask(mask: i64) -> Option<Self> {
        match (mask >> 2) & 3 {
            0 => Some(Self::Plain),
            2 => Some(Self::Cube16),
            3 => Some(Self::Cube32),
            _ => None,
        }
    }

    /// Bytes in a record.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Plain => 12,
            Self::Cube16 => 2,
            Self::Cube32 => 4,
        }
    }
}

/// Unit normal from a cube-map code. `bits`, the number of bits of a coordinate, is 6 (the face is in bits 13 to 15) or
/// 14 (the face is in bits 29 to 31).
///
/// With h = (2^bits - 1) / 2, and u and v the coordinates minus h, it is the direction (u, v, h), permuted and signed
/// by the face. Face 6 is the zero vector (no normal); face 7 is invalid and gives `None`.
pub(super) fn cube_normal(code: u32, bits: u32) -> Option<DVec3> {
    let mask = (1_u32 << bits) - 1;
    let h = f64::from(mask) / 2.0;
    let u = f64::from(code & mask) - h;
    let v = f64::from((code >> bits) & mask) - h;
    let face = if bits == 6 { (code >> 13) & 7 } else { code >> 29 };
    let direction = match face {
        0 => DVec3::new(u, v, h),
        1 => DVec3::new(u, v, -h),
        2 => DVec3::new(u, h, v),
        3 => DVec3::new(u, -h, v),
        4 => DVec3::new(h, u, v),
        5 => DVec3::new(-h, u, v),
        6 => return Some(DVec3::ZERO),
        _ => return None,
    };
    Some(direction.normalize())
}

/// Colour model: bits 16 to 20 of the property mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColourModel {
    /// Grey, in 1 byte or with an alpha in 2.
    Grey { bytes: usize },
    /// Red, green, blue.
    Rgb { bytes: usize },
    /// Full-range BT.601; 128 stands for no chroma.
    Yuv { bytes: usize },
}

impl ColourModel {
    /// The colour model in the property mask. Bits without a meaning are the error.
    pub(super) fn from_mask(mask: i64) -> Result<Self, i64> {
        match (mask >> 16) & 0x1f {
            0x01 => Ok(Self::Grey { bytes: 1 }),
            0x09 => Ok(Self::Grey { bytes: 2 }),
            0x07 => Ok(Self::Rgb { bytes: 3 }),
            0x0f => Ok(Self::Rgb { bytes: 4 }),
            0x10 => Ok(Self::Yuv { bytes: 3 }),
            0x18 => Ok(Self::Yuv { bytes: 4 }),
            other => Err(other),
        }
    }

    /// Bytes in a record.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Grey { bytes } | Self::Rgb { bytes } | Self::Yuv { bytes } => bytes,
        }
    }

    /// The colour, 0..=1, without its alpha; white if bytes are missing.
    pub(super) fn decode(self, raw: &[u8]) -> Vec3 {
        let share = |b: u8| (f64::from(b) / 255.0) as f32;
        match (self, raw) {
            (Self::Grey { .. }, [l, ..]) => Vec3::splat(share(*l)),
            (Self::Rgb { .. }, [r, g, b, ..]) => Vec3::new(share(*r), share(*g), share(*b)),
            (Self::Yuv { .. }, [y, u, v, ..]) => {
                let (y, u, v) = (f64::from(*y), f64::from(*u) - 128.0, f64::from(*v) - 128.0);
                // BT.601: Kr = 0.299, Kb = 0.114.
                let rgb = DVec3::new(y + 1.402 * v, y - 0.344_136 * u - 0.714_136 * v, y + 1.772 * u);
                (rgb / 255.0).clamp(DVec3::ZERO, DVec3::ONE).as_vec3()
            }
            _ => Vec3::ONE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_of_the_cube() {
        // The middle of a face lies between codes: h is 31.5 for 6 bits, so code 31 is half a step off.
        let code = |face: u32| (face << 13) | (31 << 6) | 31;
        let k = (31.5_f64.powi(2) + 0.5).sqrt();
        let (a, h) = (-0.5 / k, 31.5 / k);
        let expected = [[a, a, h], [a, a, -h], [a, h, a], [a, -h, a], [h, a, a], [-h, a, a]];
        for (face, e) in (0..).zip(expected) {
            let n = cube_normal(code(face), 6).unwrap();
            assert!((n - DVec3::from_array(e)).length() < 1e-12, "face {face}: {n}");
        }
        assert_eq!(cube_normal(code(6), 6), Some(DVec3::ZERO));
        assert_eq!(cube_normal(code(7), 6), None);
        // u in the low bits, v above: the corner u = +h, v = -h of face 0.
        let n = cube_normal((1 << 14) - 1, 14).unwrap();
        assert!((n - DVec3::new(1.0, -1.0, 1.0).normalize()).length() < 1e-12, "{n}");
    }

    #[test]
    fn colour_models() {
        let mask = |m: i64| ColourModel::from_mask(m << 16).unwrap();
        assert_eq!(mask(0x01).decode(&[51]), Vec3::splat(0.2));
        assert_eq!(mask(0x09).size(), 2);
        assert_eq!(mask(0x0f).decode(&[255, 0, 51, 7]), Vec3::new(1.0, 0.0, 0.2));
        assert_eq!(mask(0x10).decode(&[255, 128, 128]), Vec3::ONE);
        // Pure red in full-range BT.601 is (76, 85, 255).
        assert!((mask(0x18).decode(&[76, 85, 255, 0]) - Vec3::X).length() < 0.01);
        assert_eq!(ColourModel::from_mask(0x02 << 16), Err(2));
    }
}
