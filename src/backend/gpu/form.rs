//! What programs are written for, by device.

/// What an invocation works on (`shaders/common/quad.wgsl`, `pixel.wgsl`). Pass `attribute` has both forms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Lanes {
    /// Four pixels of a row, and lists by itself. Software devices are fast with it.
    Quads,
    /// One pixel. The invocations of a tile read lists together. Hardware is fast with it.
    Pixels,
}

/// What programs are written for, beside their kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) struct Form {
    pub lanes: Lanes,
    /// Does the device have operations of subgroups?
    pub subgroups: bool,
}

#[cfg(test)]
impl Lanes {
    pub(in crate::backend) const ALL: [Self; 2] = [Self::Quads, Self::Pixels];
}

#[cfg(test)]
impl Form {
    pub(in crate::backend) fn all() -> impl Iterator<Item = Self> {
        Lanes::ALL.into_iter().flat_map(|lanes| [false, true].map(|subgroups| Self { lanes, subgroups }))
    }
}
