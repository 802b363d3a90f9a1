//! The line-up of a sheet: one frame in several modes, side by side.

use super::StudyError;
use super::contestant::{BackendKind, Contestant, Entry};
use super::experiment::{StudyProgress, Tell};
use super::sheet::{Crop, Panel, SheetError, most_different};
use super::trial::{Shot, Trial};
use crate::compare::{Comparison, Metric, Shown};
use crate::options::PixelFilter;
use crate::time::FrameNumber;

/// One frame in several modes.
#[derive(Clone, Debug)]
pub struct LineUp {
    /// The frame.
    pub frame: FrameNumber,
    /// The modes; those without a backend are rendered on the CPU.
    pub entries: Vec<Entry>,
    /// Samples of a pixel of the reference that they are compared with: a multiple of 16.
    pub reference: Option<u64>,
    /// The part to enlarge.
    pub part: Part,
}

/// Which part of a picture to enlarge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// This one.
    Here(Crop),
    /// The one of this width and height in which the modes differ most.
    MostDifferent(u32, u32),
}

/// The pictures of a line-up.
#[derive(Clone, Debug)]
pub struct Shots {
    /// One for each pixel filter of the modes, with its name; none where none was asked for.
    references: Vec<(PixelFilter, String, Shot)>,
    /// In the order of the entries, each with its pixel filter.
    of_entries: Vec<(PixelFilter, Shot)>,
    /// The part to enlarge.
    pub crop: Crop,
}

impl LineUp {
    /// Refuses a part that is not in the picture.
    ///
    /// # Errors
    /// The part reaches outside.
    pub fn check(&self, trial: &Trial<'_>) -> Result<(), SheetError> {
        match self.part {
            Part::Here(crop) => crop.check(trial.scene().image.width, trial.scene().image.height),
            Part::MostDifferent(..) => Ok(()),
        }
    }

    /// Renderings, as [`StudyProgress`] counts them.
    pub fn steps(&self, trial: &Trial<'_>) -> u64 {
        let references = self.reference.map_or(0, |_| self.filters(trial).len() as u64);
        references + self.entries.iter().map(renderings).sum::<u64>()
    }

    /// The pixel filters of the modes.
    fn filters(&self, trial: &Trial<'_>) -> Vec<PixelFilter> {
        trial.filters_of(self.entries.iter().map(|entry| entry.choices))
    }

    /// Renders the frame in all modes.
    ///
    /// # Errors
    /// The part is not in the picture, or something cannot be rendered.
    pub fn run(&self, trial: &mut Trial<'_>, tell: Tell<'_>) -> Result<Shots, StudyError> {
        self.check(trial)?;
        let mut step = 0;
        let mut references = Vec::new();
        if let Some(samples) = self.reference {
            for filter in self.filters(trial) {
                let what = trial.name_of_judge(filter);
                let share = |share| tell(StudyProgress::At { step, what: &what, share });
                let shot = trial.judge(samples, filter, self.frame, &share)?;
                references.push((filter, what, shot));
                step += 1;
            }
        }
        let mut shots = Vec::new();
        for entry in &self.entries {
            let name = entry.to_string();
            let backend = entry.backend.unwrap_or(BackendKind::Cpu);
            let contestant = Contestant { method: entry.method, choices: entry.choices, backend };
            for turn in 1..=renderings(entry) {
                let share = |share| tell(StudyProgress::At { step, what: &name, share });
                share(0.0);
                let shot = trial.shoot(contestant, self.frame, &share);
                let shot = shot.map_err(StudyError::in_mode(name.clone()))?;
                step += 1;
                if turn == renderings(entry) {
                    shots.push(shot);
                }
            }
        }
        let crop = match self.part {
            Part::Here(crop) => crop,
            Part::MostDifferent(width, height) => {
                // One mode alone can only differ from the reference.
                let alone = references.iter().map(|(.., shot)| shot).filter(|_| shots.len() == 1);
                let pictures: Vec<_> = shots.iter().chain(alone).map(|shot| &shot.picture).collect();
                most_different(&pictures, width, height)?
            }
        };
        let filters = self.entries.iter().map(|entry| trial.filter_of(entry.choices));
        Ok(Shots { references, of_entries: filters.zip(shots).collect(), crop })
    }

    /// Pictures with their labels: samples, seconds and errors. References come first. Each mode is compared with that
    /// of its own pixel filter.
    ///
    /// # Errors
    /// The pictures cannot be compared.
    pub fn panels<'a>(&self, shots: &'a Shots) -> Result<Vec<Panel<'a>>, StudyError> {
        let mut panels = Vec::new();
        let took = |samples: u64, seconds: f64| {
            let plural = if samples == 1 { "" } else { "s" };
            format!("{samples} sample{plural}, {seconds:.3} s")
        };
        for (_, name, shot) in &shots.references {
            let lines = vec![took(self.reference.unwrap_or(0), shot.seconds), "errors are against this".to_owned()];
            panels.push(Panel { title: name.clone(), lines, picture: &shot.picture });
        }
        for (entry, (filter, shot)) in self.entries.iter().zip(&shots.of_entries) {
            let mut lines = vec![took(shot.samples(entry.method), shot.seconds)];
            if let Some((.., reference)) = shots.references.iter().find(|(of, ..)| of == filter) {
                let errors = Comparison::new(&shot.picture, &reference.picture, &[Metric::Flip])?;
                let value = |metric| Shown(errors.value(metric).unwrap_or(f64::NAN));
                lines.push(format!("FLIP {:.6}, RMSE {:.6}", value(Metric::Flip), value(Metric::Rmse)));
            }
            panels.push(Panel { title: entry.to_string(), lines, picture: &shot.picture });
        }
        Ok(panels)
    }
}

/// Once to warm up, once measured. References are slow and need no warming.
fn renderings(entry: &Entry) -> u64 {
    if entry.method.is_traced() { 1 } else { 2 }
}
