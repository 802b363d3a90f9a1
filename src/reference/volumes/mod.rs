//! Volumes: kernels of extinction that light is integrated through along each ray, without any approximation of the
//! projection (Zwicker et al. 2002, eq. 9; docs/math.md, section 12).
//!
//! Data flow: `kernel` (kernels in the tree of `gaussians`) → `line` (one kernel along one ray) → `light` (its
//! colour) → `march` (which of them where) → `block` (sums at equal distances, and their light).

mod block;
mod buckets;
pub(super) mod kernel;
mod light;
mod line;
pub(super) mod march;
