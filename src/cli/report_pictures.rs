//! The pictures of a report's page.

use anyhow::Context as _;
use splatblur::compare::flip;
use splatblur::image;
use splatblur::study::report::page::{FramePictures, ModePictures};
use splatblur::study::report::{FrameStudy, Region, STRATA, Study, classify, flip_map, region_map, signed_error};
use splatblur::study::sheet::{Canvas, densest};

use super::report::Entry;
use super::report_store::Store;
use super::trial::Trial;

/// Greatest width of a picture on the page.
const PICTURE: u32 = 640;
/// The crops where FLIP is worst.
const CROP: (u32, u32) = (60, 45);

/// The regions of a frame's picture.
pub(super) fn regions(trial: &mut Trial<'_>, frame: i64) -> anyhow::Result<Vec<Region>> {
    classify(&trial.moments(frame)?, f64::from(STRATA)).context("the layers of depth and velocity")
}

/// The pictures of a frame for the page.
pub(super) fn pictures_of(
    trial: &mut Trial<'_>,
    store: &Store<'_>,
    frame: i64,
    entries: &[Entry],
) -> anyhow::Result<FramePictures> {
    let reference = image::read(&store.path(frame, "judge"))?;
    let (signed_range, flip_range) = (0.25, 0.5);
    let mut modes = Vec::new();
    for entry in entries {
        let picture = image::read(&store.path(frame, &entry.name()))?;
        let map = flip::map(&picture, &reference)?;
        let values: Vec<f64> = map.iter().map(|&v| f64::from(v)).collect();
        let crop = densest(&values, picture.width, CROP.0, CROP.1);
        let flip = flip_map(&map, picture.width, picture.height, flip_range)?;
        let cut = |canvas: &Canvas| canvas.enlarged(crop, 1);
        let worst = [cut(&Canvas::of(&picture)?)?, cut(&Canvas::of(&reference)?)?, cut(&flip)?];
        let signed = signed_error(&picture, &reference, signed_range)?;
        let mut shown = Canvas::shrunk(&picture, PICTURE)?;
        shown.mark(crop, picture.width);
        modes.push(ModePictures { picture: shown, signed, flip, worst, crop });
    }
    let regions = region_map(&regions(trial, frame)?, reference.width)?;
    let reference = Canvas::shrunk(&reference, PICTURE)?;
    Ok(FramePictures { frame, reference, regions, modes, signed_range, flip_range })
}

/// Frames with pictures on the page: all of up to three, else the first, that with the greatest FLIP, and the last.
pub(super) fn pictured(study: &Study) -> Vec<i64> {
    let frames = &study.frames;
    let flip = |f: &FrameStudy| f.modes.iter().filter_map(|m| m.errors.flip).fold(0.0, f64::max);
    let mut chosen: Vec<i64> = if frames.len() <= 3 {
        frames.iter().map(|f| f.frame).collect()
    } else {
        let worst = frames.iter().max_by(|a, b| flip(a).total_cmp(&flip(b)));
        [frames.first(), worst, frames.last()].into_iter().flatten().map(|f| f.frame).collect()
    };
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}
