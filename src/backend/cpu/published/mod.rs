//! What Wolf (2008) prints, as printed: the low-pass disc of the approximate EWA filter (4.2.3), and kernels in motion
//! that weigh by their chord (eq. 4.12) or by the line integral (eq. C.38), with visibility from a map at mid-interval
//! (fig. 4.5). It is here to be compared with; docs/modes.md says what replaces it.

pub(in crate::backend) mod attribute;
mod coverage;
mod low_pass;
pub(in crate::backend) mod map;
mod map_group;
mod mask;
mod project;
pub(in crate::backend) mod ray;
mod resolve;
mod sweep_group;
mod waste;

pub(in crate::backend) use self::low_pass::LowPassSplat;
pub(in crate::backend) use self::map::Map;
pub(in crate::backend) use self::map_group::MapGroup;
pub(in crate::backend) use self::mask::PublishedMask;
pub(in crate::backend) use self::sweep_group::PublishedSweepGroup;
pub(in crate::backend::cpu) use self::waste::waste_of;
