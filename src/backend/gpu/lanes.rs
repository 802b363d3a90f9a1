//! What invocations work on.

/// What an invocation works on (`shaders/common/quad.wgsl`, `pixel.wgsl`). Pass `attribute` has both forms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Lanes {
    /// Four pixels of a row, and lists by itself. Software devices are fast with it.
    Quads,
    /// One pixel. The invocations of a tile read lists together. Hardware is fast with it.
    Pixels,
}

#[cfg(test)]
impl Lanes {
    pub(in crate::backend) const ALL: [Self; 2] = [Self::Quads, Self::Pixels];
}
