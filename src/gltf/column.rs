//! Columns of numbers: accessors into buffers, with their ranges checked.

use serde::Deserialize;

/// Numbers of one accessor. All of them lie in `data`.
pub(crate) struct Column<'a> {
    pub(super) data: &'a [u8],
    pub(super) stride: usize,
    pub(super) component: Component,
    pub(super) normalized: bool,
    pub(crate) count: usize,
}

/// How many numbers a value has.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) enum ValueShape {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    Mat2,
    Mat3,
    Mat4,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Column<'_> {
    /// The numbers of one value; NaN beyond the end.
    pub(crate) fn get<const N: usize>(&self, row: usize) -> [f64; N] {
        let size = self.component.size();
        std::array::from_fn(|index| {
            self.data.get(row * self.stride + index * size..).map_or(f64::NAN, |b| self.number(b))
        })
    }

    /// A whole number of a column of indices.
    pub(crate) fn index(&self, row: usize) -> usize {
        let bytes = self.data.get(row * self.stride..).unwrap_or_default();
        let number: u32 = match self.component {
            Component::U8 => u8::from_le_bytes(first(bytes)).into(),
            Component::U16 => u16::from_le_bytes(first(bytes)).into(),
            _ => u32::from_le_bytes(first(bytes)),
        };
        number as usize
    }

    /// True if its numbers are floats of 32 bits.
    pub(crate) fn is_f32(&self) -> bool {
        self.component == Component::F32
    }

    /// True if its numbers are unsigned and not normalised, as those of indices are.
    pub(crate) fn counts(&self) -> bool {
        matches!(self.component, Component::U8 | Component::U16 | Component::U32) && !self.normalized
    }

    /// True if its numbers are floats, or integers that stand for parts of 1.
    pub(crate) fn is_real(&self) -> bool {
        self.normalized || self.component == Component::F32
    }

    fn number(&self, bytes: &[u8]) -> f64 {
        let (value, most) = match self.component {
            Component::I8 => (f64::from(i8::from_le_bytes(first(bytes))), f64::from(i8::MAX)),
            Component::U8 => (f64::from(u8::from_le_bytes(first(bytes))), f64::from(u8::MAX)),
            Component::I16 => (f64::from(i16::from_le_bytes(first(bytes))), f64::from(i16::MAX)),
            Component::U16 => (f64::from(u16::from_le_bytes(first(bytes))), f64::from(u16::MAX)),
            Component::U32 => (f64::from(u32::from_le_bytes(first(bytes))), f64::from(u32::MAX)),
            Component::F32 => return f64::from(f32::from_le_bytes(first(bytes))),
        };
        if self.normalized { (value / most).max(-1.0) } else { value }
    }
}

fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

impl Component {
    pub(super) fn of(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

impl ValueShape {
    pub(super) fn width(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vec2 => 2,
            Self::Vec3 => 3,
            Self::Vec4 | Self::Mat2 => 4,
            Self::Mat3 => 9,
            Self::Mat4 => 16,
        }
    }
}
