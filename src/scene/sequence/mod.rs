//! Sequences of point files: what an object shows of them in one frame.
//!
//! `files` finds and reads files, the next one ahead; `pieces` matches the points of two files. For one frame a
//! sequence becomes ordinary objects (`at_frame.rs`): each shows the points of one file from the middle between it
//! and the file before to its own time, or from there to the middle between it and the file after. So points that only
//! one of two files has are born and die in the middle between them.

mod files;
mod pieces;
mod rows;

use std::path::PathBuf;
use std::sync::Arc;

use self::files::Files;
pub use self::files::Pattern;
use super::model::{Piece, SurfelModel};
use crate::math::Bounds;
use crate::model::{self, ModelError, VelocityUnit};

/// Most files that a shutter may touch: more are a mistake, and fill the memory.
const MOST_FILES: i64 = 256;

/// Which files a sequence has, and when each is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct SequenceSpec {
    /// Names of the files.
    pub pattern: Pattern,
    /// Number of the first file.
    pub first: i64,
    /// Number of the last file, at least `first`.
    pub last: i64,
    /// Frame at which file 0 is shown, or would be.
    pub offset: f64,
    /// Files per frame, > 0.
    pub rate: f64,
    /// Points of files without identities are the same if they are nearest to each other, and not farther than this,
    /// model units, > 0. `None`: they are matched by row.
    pub match_within: Option<f64>,
}

impl SequenceSpec {
    /// The frame at which file `number` is shown.
    pub fn frame_of(&self, number: i64) -> f64 {
        self.offset + number as f64 / self.rate
    }

    /// The frame in the middle between file `number` and the next.
    fn middle_after(&self, number: i64) -> f64 {
        self.offset + (number as f64 + 0.5) / self.rate
    }

    /// The frames between which a file is shown before its own frame (`side` -1), or after it (1).
    fn half(&self, number: i64, side: i64) -> [f64; 2] {
        let at = self.frame_of(number);
        if side < 0 { [self.middle_after(number - 1), at] } else { [at, self.middle_after(number)] }
    }

    /// Is any file shown at some time from `from` to `to` (frames)?
    pub(crate) fn has_files(&self, from: f64, to: f64) -> bool {
        self.middle_after(self.first - 1) <= to && from < self.middle_after(self.last)
    }

    /// Numbers of the files that may be shown at some time from `from` to `to` (frames).
    fn shown(&self, from: f64, to: f64) -> std::ops::RangeInclusive<i64> {
        let nearest = |time: f64| ((time - self.offset) * self.rate).clamp(-1e15, 1e15);
        // One more on each side, against rounding.
        let first = nearest(from).round() as i64 - 1;
        let last = nearest(to).round() as i64 + 1;
        first.max(self.first)..=last.min(self.last)
    }
}

/// A sequence of point files, of which those are in memory that the last frame needed, and the next one.
#[derive(Debug)]
pub struct Sequence {
    spec: SequenceSpec,
    files: Files,
    /// Box around the points of some files.
    bounds: Bounds,
}

/// A sequence before any frame is rendered.
#[derive(Debug)]
pub(crate) struct Opened {
    pub(crate) sequence: Arc<Sequence>,
    /// Both sides of its points show.
    pub(crate) two_sided: bool,
    pub(crate) notes: Vec<String>,
    /// The values of the first and of the last colour, where points are coloured by a column of numbers.
    pub(crate) colour_range: Option<[f64; 2]>,
}

impl Sequence {
    /// Reads the first file, and the next one if points are to be matched by row; if `all_bounds`, also files in the
    /// middle and at the end, for the size of the whole.
    ///
    /// # Errors
    /// A file is missing or empty, or one of these cannot be read.
    pub(crate) fn open(
        spec: SequenceSpec,
        options: &model::LoadOptions,
        all_bounds: bool,
    ) -> Result<Opened, ModelError> {
        let mut files = Files::new(spec.pattern.clone(), options.clone());
        for number in spec.first..=spec.last {
            files.check(number, [spec.first, spec.last])?;
        }
        let colour_range = files.find_colour_range(spec.first..=spec.last)?;
        let mut opened = Opened {
            sequence: Arc::new(Self { spec, files, bounds: Bounds::default() }),
            two_sided: false,
            notes: Vec::new(),
            colour_range,
        };
        let Some(sequence) = Arc::get_mut(&mut opened.sequence) else { return Ok(opened) };
        let SequenceSpec { first, last, .. } = sequence.spec;
        let middle = first + (last - first) / 2;
        for number in [first, middle, last] {
            if number != first && !all_bounds {
                break;
            }
            let (file, notes) = sequence.files.read(number)?;
            if sequence.bounds.is_empty() {
                opened.two_sided = file.model.surfels().two_sided;
                opened.notes = notes;
            }
            sequence.bounds.merge(&file.model.bounds());
            if number == first && !file.rows && sequence.spec.match_within.is_some() {
                opened.notes.push("`match` means nothing here: points are matched by their `id`".to_owned());
            }
            let unsure = file.model.surfels().velocity.is_empty() || sequence.spec.match_within.is_some();
            if number == first && first < last && file.rows && unsure {
                let (next, _) = sequence.files.read(first + 1)?;
                opened.notes.extend(match sequence.spec.match_within {
                    Some(within) => Some(pieces::matched(&file, &next, within)),
                    None => rows::in_another_order(&file, &next),
                });
                sequence.files.keep([(first, file), (first + 1, next)]);
            }
        }
        Ok(opened)
    }

    /// Which files it has.
    pub fn spec(&self) -> &SequenceSpec {
        &self.spec
    }

    /// Box around the points of some files, model space.
    pub(crate) fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The points that show from `from` to `to` (frames) in a scene of `rate` frames per second: of one file each, with
    /// paths per frame, and the frame at which they are where the file has them. `unit`: of velocities, in place of the
    /// files' own.
    ///
    /// # Errors
    /// A file cannot be read, or says nothing of how its points become those beside it.
    pub(crate) fn pieces(
        &self,
        unit: Option<VelocityUnit>,
        rate: f64,
        [from, to]: [f64; 2],
    ) -> Result<Vec<(SurfelModel, f64)>, ModelError> {
        let spec = &self.spec;
        let shown = spec.shown(from, to);
        let count = shown.end().saturating_sub(*shown.start()).saturating_add(1);
        if count > MOST_FILES {
            let path = PathBuf::from(spec.pattern.to_string());
            return Err(ModelError::ManyFiles { path, files: count, most: MOST_FILES });
        }
        // Where a half is shown, the file beside it says how points move there.
        let halves = shown.flat_map(|number| [(number, -1), (number, 1)]);
        let halves: Vec<(i64, i64, [f64; 2])> = halves
            .map(|(number, side)| (number, side, spec.half(number, side)))
            .filter(|(.., window)| window[0] <= to && from < window[1])
            .collect();
        // Before the first file and after the last one, points go on as between it and the one on its other side.
        let has = |number: i64| (spec.first..=spec.last).contains(&number);
        let side_of = |number: i64, side: i64| if has(number + side) { side } else { -side };
        let mut numbers: Vec<i64> =
            halves.iter().flat_map(|&(number, side, _)| [number, number + side_of(number, side)]).collect();
        numbers.retain(|&number| has(number));
        numbers.sort_unstable();
        numbers.dedup();
        let files = self.files.hold(&numbers, [spec.first, spec.last])?;
        let mut out = Vec::new();
        for (number, side, window) in halves {
            let Some(file) = files.get(&number).filter(|file| file.points > 0) else { continue };
            let side = side_of(number, side);
            let beside = files.get(&(number + side)).map(Arc::as_ref);
            let unit = unit.unwrap_or(file.model.surfels().velocity_unit);
            let per_frame = if unit == VelocityUnit::Second { 1.0 / rate } else { 1.0 };
            let paths = pieces::paths(file, beside, spec.match_within, side as f64 / spec.rate, per_frame).map_err(
                |points| {
                    let path = |number| spec.pattern.path(number);
                    ModelError::Unmatched { path: path(number), beside: path(number + side), points }
                },
            )?;
            let piece = Piece { paths, window, is_first: out.is_empty() };
            out.push((file.model.with_piece(piece), spec.frame_of(number)));
        }
        Ok(out)
    }
}
