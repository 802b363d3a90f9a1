//! The files of a sequence: their names, and those that are in memory.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use rayon::prelude::*;

use crate::model::{self, Kind, LoadedModel, LoadedShape, ModelError, Spacing};
use crate::scene::SurfelModel;

/// Names of files that differ in a number, as in `cache.%04d.ply`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    before: String,
    /// Fewest digits, filled up with zeros.
    digits: usize,
    after: String,
}

impl Pattern {
    /// Reads `before%04dafter`, or `%d` without zeros; `None` if there is not exactly one number.
    pub fn parse(text: &str) -> Option<Self> {
        /// More digits than any number has.
        const MOST_DIGITS: usize = 20;
        let (before, rest) = text.split_once('%')?;
        let (width, after) = rest.split_once('d')?;
        let is_width = width.is_empty() || width.starts_with('0') && width.bytes().all(|b| b.is_ascii_digit());
        let digits = if width.is_empty() { 1 } else { width.parse().ok()? };
        let fits = is_width && (1..=MOST_DIGITS).contains(&digits) && !after.contains('%');
        fits.then(|| Self { before: before.to_owned(), digits, after: after.to_owned() })
    }

    /// The path of file `number`.
    pub fn path(&self, number: i64) -> PathBuf {
        let Self { before, digits, after } = self;
        // A sign counts as a digit, as in C.
        PathBuf::from(format!("{before}{number:0digits$}{after}"))
    }

    /// The numbers of the files that there are, rising.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn existing(&self) -> std::io::Result<Vec<i64>> {
        let first = self.path(0);
        let folder = first.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let before = Path::new(&self.before);
        let stem =
            if self.before.ends_with(['/', '\\']) { None } else { before.file_name().and_then(|name| name.to_str()) };
        let mut numbers = Vec::new();
        for entry in std::fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name();
            let digits = name.to_str().and_then(|name| name.strip_prefix(stem.unwrap_or_default()));
            let number =
                digits.and_then(|rest| rest.strip_suffix(self.after.as_str())).and_then(|text| text.parse().ok());
            // `7` is no name of `%04d`.
            let is_named = |number: &i64| self.path(*number).file_name() == Some(&*name);
            numbers.extend(number.filter(is_named).filter(|_| entry.path().is_file()));
        }
        numbers.sort_unstable();
        Ok(numbers)
    }

    /// The same names under another path: `path` is that of file `number`.
    pub(crate) fn at(&self, number: i64, path: &Path) -> Option<Self> {
        let text = path.to_str()?;
        let name = format!("{number:0width$}{}", self.after, width = self.digits);
        let before = text.strip_suffix(name.as_str())?;
        Some(Self { before: before.to_owned(), ..self.clone() })
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { before, digits, after } = self;
        if *digits == 1 { write!(f, "{before}%d{after}") } else { write!(f, "{before}%0{digits}d{after}") }
    }
}

/// A file of a sequence.
#[derive(Debug)]
pub(super) struct File {
    /// The surfels; none for an empty file.
    pub(super) model: SurfelModel,
    /// The points in the order of their identities.
    pub(super) by_id: Vec<u32>,
    /// The identities are numbers of rows: the file has none.
    pub(super) rows: bool,
    /// Number of its points.
    pub(super) points: usize,
}

/// The files that are in memory.
#[derive(Debug)]
pub(super) struct Files {
    pattern: Pattern,
    options: model::LoadOptions,
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    files: BTreeMap<i64, Arc<File>>,
    /// The numbers of the last frame.
    last: Vec<i64>,
    /// The file that is being read ahead.
    ahead: Option<(i64, JoinHandle<Result<File, ModelError>>)>,
}

impl Files {
    pub(super) fn new(pattern: Pattern, mut options: model::LoadOptions) -> Self {
        // Vertices are points that can be followed; samples of faces are not.
        options.mesh.spacing = Spacing::None;
        options.kind = options.kind.filter(|kind| *kind == Kind::Spheres).or(Some(Kind::Surfels));
        Self { pattern, options, held: Mutex::default() }
    }

    /// Is the file there, and does it hold anything?
    pub(super) fn check(&self, number: i64, [first, last]: [i64; 2]) -> Result<(), ModelError> {
        let path = self.pattern.path(number);
        match path.metadata() {
            Ok(data) if data.is_file() && data.len() == 0 => Err(ModelError::EmptyFile { path }),
            Ok(data) if data.is_file() => Ok(()),
            Ok(_) | Err(_) => Err(ModelError::Gap { path, number, first, last }),
        }
    }

    /// One range of values for the colours of all files: that of the options, or the least and the greatest value of
    /// all. `None` where points are not coloured by a column of numbers, or where no point has a value.
    pub(super) fn find_colour_range(&mut self, numbers: RangeInclusive<i64>) -> Result<Option<[f64; 2]>, ModelError> {
        let Some(by) = &self.options.points.colour_by else { return Ok(None) };
        if by.range.is_some() {
            return Ok(by.range);
        }
        let numbers: Vec<i64> = numbers.collect();
        let of_file = |number: &i64| model::value_range(&self.pattern.path(*number), &self.options);
        let ranges: Vec<_> = numbers.par_iter().map(of_file).collect::<Result<_, _>>()?;
        let all = ranges.into_iter().flatten().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        if let Some(by) = &mut self.options.points.colour_by {
            by.range = all;
        }
        Ok(all)
    }

    /// Reads a file without keeping it.
    pub(super) fn read(&self, number: i64) -> Result<(File, Vec<String>), ModelError> {
        read(&self.pattern.path(number), &self.options)
    }

    /// Keeps files that were read, until other ones are held.
    pub(super) fn keep(&self, files: impl IntoIterator<Item = (i64, File)>) {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        held.files.extend(files.into_iter().map(|(number, file)| (number, Arc::new(file))));
    }

    /// The files with these numbers, rising. Others are forgotten, and one that the next frame will need is read ahead
    /// if frames go on as they did.
    pub(super) fn hold(
        &self,
        numbers: &[i64],
        [first, last]: [i64; 2],
    ) -> Result<BTreeMap<i64, Arc<File>>, ModelError> {
        let lock = || self.held.lock().unwrap_or_else(PoisonError::into_inner);
        // Nothing is read while the lock is held: the threads that read may render, too.
        let (mut files, ahead, before) = {
            let mut held = lock();
            let kept = held.files.iter().filter(|(number, _)| numbers.contains(number));
            let kept: BTreeMap<i64, Arc<File>> = kept.map(|(&number, file)| (number, Arc::clone(file))).collect();
            held.files.clone_from(&kept);
            (kept, held.ahead.take(), std::mem::replace(&mut held.last, numbers.to_vec()))
        };
        if let Some((number, reading)) = ahead
            && numbers.contains(&number)
            && let Ok(file) = reading.join()
        {
            files.insert(number, Arc::new(file?));
        }
        for &number in numbers {
            if let Entry::Vacant(place) = files.entry(number) {
                let (file, _) = read(&self.pattern.path(number), &self.options)?;
                place.insert(Arc::new(file));
            }
        }
        let next = match (before.first(), numbers.first(), numbers.last()) {
            (Some(before), Some(least), _) if before > least => least.checked_sub(1),
            (_, _, Some(greatest)) => greatest.checked_add(1),
            _ => None,
        };
        let next = next.filter(|next| (first..=last).contains(next)).and_then(|next| {
            let (path, options) = (self.pattern.path(next), self.options.clone());
            let reading = move || read(&path, &options).map(|(file, _)| file);
            Some((next, std::thread::Builder::new().name("read ahead".to_owned()).spawn(reading).ok()?))
        });
        let mut held = lock();
        held.files.clone_from(&files);
        held.ahead = next;
        Ok(files)
    }
}

fn read(path: &Path, options: &model::LoadOptions) -> Result<(File, Vec<String>), ModelError> {
    let (mut surfels, notes) = match model::load(path, options, &|_, _| {}) {
        // Nothing is there in this frame. A file without bytes is a failed write, and stays an error.
        Err(ModelError::NoPointsIn { dropped, .. }) => {
            let file = File { model: SurfelModel::default(), by_id: Vec::new(), rows: false, points: 0 };
            let why = (!dropped.is_empty()).then(|| format!("an empty frame, without usable points{dropped}"));
            return Ok((file, why.into_iter().collect()));
        }
        Err(error) => return Err(error),
        Ok(LoadedModel { shape: LoadedShape::Surfels(surfels, _), notes, .. }) => (surfels, notes),
        Ok(_) => return Err(ModelError::NoSurfels { path: path.to_owned() }),
    };
    let points = surfels.len();
    let rows = surfels.id.is_empty();
    if rows {
        surfels.id = (0..points as i64).collect();
    }
    let surfels = surfels.spatially_ordered();
    let mut by_id: Vec<u32> = (0..points as u32).collect();
    if rows {
        // Each row is there once.
        surfels.id.iter().zip(0..).for_each(|(&row, i)| by_id[row as usize] = i);
    } else {
        by_id.par_sort_unstable_by_key(|&i| surfels.id[i as usize]);
    }
    let twice = by_id.windows(2).find(|pair| surfels.id[pair[0] as usize] == surfels.id[pair[1] as usize]);
    if let Some(pair) = twice {
        return Err(ModelError::Twice { path: path.to_owned(), id: surfels.id[pair[0] as usize] });
    }
    Ok((File { model: surfels.into(), by_id, rows, points }, notes))
}
