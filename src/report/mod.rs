//! What a report says beside the metrics: where a picture is wrong, whether that is chance, and curves, maps and the page.

pub mod chart;
mod maps;
pub mod page;
mod regions;
mod study;
mod ztest;

pub use self::maps::{flip_map, flip_scale, signed_error};
pub use self::regions::{Region, RegionErrors, STRATA, classify, split};
pub use self::study::{FrameStudy, ModeStudy, SceneStudy, Study, Times, csv};
pub use self::ztest::{FLOOR, SIGNIFICANCE, pass_rate, standard_error};

#[cfg(test)]
mod tests;
