//! Transparent Gaussians of captures, for rays: at the time of a ray those that it meets are gathered, sorted by the
//! depth of their centres and composited front to back (docs/math.md, section 11).
//!
//! Data flow: `tree` (Gaussians in boxes) → `beam` (which of them a group of rays may meet) → `place` and `sight`
//! (one Gaussian as one ray sees it) → `veil` (gather, sort, composite), with `colour` and `blend`. Volumes share the
//! tree, and what `veil` composites among captures and surfaces.

pub(super) mod beam;
pub(super) mod blend;
pub(super) mod colour;
pub(super) mod place;
mod sight;
pub(super) mod tree;
pub(super) mod veil;
