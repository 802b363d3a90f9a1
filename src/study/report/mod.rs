//! A report: its figures, curves, maps and page; where a picture is wrong, and whether that is chance.

pub mod chart;
mod figures;
mod floor;
mod maps;
pub mod page;
mod pictures;
mod regions;
mod text;
mod ztest;

pub use self::figures::{FrameStudy, ModeStudy, SceneStudy, Study, WallTimes, csv};
pub use self::floor::Floor;
pub use self::maps::{flip_map, flip_scale, region_map, signed_error};
pub use self::pictures::{FramePictures, ModePictures};
pub use self::regions::{Region, RegionErrors, STRATA, classify, split};
pub use self::ztest::{FLOOR, SIGNIFICANCE, pass_rate};

#[cfg(test)]
mod tests;
