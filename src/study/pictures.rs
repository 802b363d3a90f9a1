//! The pictures of a report's page.

use super::StudyError;
use super::contestant::Contestant;
use super::report::{
    FramePictures, FrameStudy, ModePictures, Region, STRATA, Study, classify, flip_map, region_map, signed_error,
};
use super::sheet::{Canvas, densest};
use super::store::Store;
use super::trial::Trial;
use crate::compare::flip;
use crate::film::Picture;
use crate::image;
use crate::options::PixelFilter;
use crate::time::FrameNumber;

/// Greatest width of a picture on the page, pixels.
const PICTURE: u32 = 640;
/// Size of the crops where FLIP is worst, pixels.
const CROP: (u32, u32) = (60, 45);
/// Difference of display values that has the full colour.
const SIGNED_RANGE: f32 = 0.25;
/// FLIP that has the brightest colour.
const FLIP_RANGE: f32 = 0.5;

/// The regions of a frame's picture.
pub(super) fn regions(trial: &mut Trial<'_>, frame: FrameNumber) -> Result<Vec<Region>, StudyError> {
    classify(&trial.moments(frame)?, f64::from(STRATA)).ok_or(StudyError::NoLayers)
}

/// The pictures of a finished frame for the page.
pub(super) fn pictures_of(
    trial: &mut Trial<'_>,
    store: &Store<'_>,
    frame: FrameNumber,
    contestants: &[Contestant],
) -> Result<FramePictures, StudyError> {
    let mut references = Vec::new();
    for filter in trial.filters_of(contestants.iter().map(|contestant| contestant.choices)) {
        references.push((filter, image::read(&store.path_of_judge(trial, frame, filter))?));
    }
    let mut modes = Vec::new();
    for contestant in contestants {
        let filter = trial.filter_of(contestant.choices);
        let Some((_, reference)) = references.iter().find(|(of, _)| *of == filter) else { continue };
        let picture = image::read(&store.path(frame, &contestant.to_string()))?;
        let map = flip::map(&picture, reference)?;
        let values: Vec<f64> = map.iter().map(|&v| f64::from(v)).collect();
        let crop = densest(&values, picture.width, CROP.0, CROP.1);
        let flip = flip_map(&map, picture.width, picture.height, FLIP_RANGE)?;
        let cut = |canvas: &Canvas| canvas.enlarged(crop, 1);
        let worst = [cut(&Canvas::of(&picture)?)?, cut(&Canvas::of(reference)?)?, cut(&flip)?];
        let signed = signed_error(&picture, reference, SIGNED_RANGE)?;
        let mut shown = Canvas::shrunk(&picture, PICTURE)?;
        shown.mark(crop, picture.width);
        modes.push(ModePictures { picture: shown, signed, flip, worst, crop });
    }
    let regions = region_map(&regions(trial, frame)?, trial.scene().image.width)?;
    let shown = |(filter, picture): (PixelFilter, Picture)| -> Result<_, StudyError> {
        Ok((trial.name_of_judge(filter), Canvas::shrunk(&picture, PICTURE)?))
    };
    let references = references.into_iter().map(shown).collect::<Result<_, _>>()?;
    let (signed_range, flip_range) = (SIGNED_RANGE, FLIP_RANGE);
    Ok(FramePictures { frame, references, regions, modes, signed_range, flip_range })
}

/// Frames with pictures on the page: all of up to three, else the first, that with the greatest FLIP, and the last.
pub(super) fn pictured(study: &Study) -> Vec<FrameNumber> {
    let frames = &study.frames;
    let flip = |f: &FrameStudy| f.modes.iter().filter_map(|m| m.errors.flip).fold(0.0, f64::max);
    let mut chosen: Vec<FrameNumber> = if frames.len() <= 3 {
        frames.iter().map(|f| f.frame).collect()
    } else {
        let worst = frames.iter().max_by(|a, b| flip(a).total_cmp(&flip(b)));
        [frames.first(), worst, frames.last()].into_iter().flatten().map(|f| f.frame).collect()
    };
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}
