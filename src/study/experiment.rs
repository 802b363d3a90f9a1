//! The experiment of a report: contestants against a reference, frame by frame.

use super::StudyError;
use super::contestant::{BackendKind, Contestant, Method};
use super::pictures::{pictured, pictures_of, regions};
use super::provenance::PROGRAM;
use super::report::{
    Floor, FramePictures, FrameStudy, ModeStudy, Region, SceneStudy, Study, WallTimes, pass_rate, split,
};
use super::store::{Store, times};
use super::trial::{Trial, samples_of};
use crate::compare::{self, Comparison, Limit, Metric, flip, ssim};
use crate::film::Picture;
use crate::image;
use crate::options::PixelFilter;
use crate::time::FrameNumber;

/// The pictures that are compared, and how.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Who takes part, each once.
    pub contestants: Vec<Contestant>,
    /// Frames, at least one, each once.
    pub frames: Vec<FrameNumber>,
    /// Samples of a pixel of the reference: a multiple of 16.
    pub reference: u64,
    /// Timed renderings of each contestant and frame, >= 1; references are rendered once.
    pub repeats: u32,
    /// Limits that every contestant must hold in each frame and in all, at most one of each metric.
    pub limits: Vec<Limit>,
}

/// How far a study is. Steps count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StudyProgress<'a> {
    /// A step is at a share, 0 to 1.
    At {
        /// Number of the step.
        step: u64,
        /// The work under way.
        what: &'a str,
        /// Finished share.
        share: f32,
    },
    /// All before this step took no time: an earlier run has done it.
    SkipTo(u64),
}

/// Told how far a study is.
pub type Tell<'a> = &'a (dyn Fn(StudyProgress<'_>) + Sync);

/// A contestant of whose frame no sound rendering is there.
struct Missing {
    contestant: Contestant,
    settings: String,
    seconds: Vec<f64>,
}

impl Experiment {
    /// Refuses experiments that could only fail at their end.
    ///
    /// # Errors
    /// The pictures are too small for SSIM, or a metric has two limits.
    pub fn check(&self, trial: &Trial<'_>) -> Result<(), StudyError> {
        let image = &trial.scene().image;
        if image.width.min(image.height) < ssim::WINDOW {
            return Err(StudyError::Small);
        }
        Ok(Limit::check_unique(&self.limits)?)
    }

    /// Steps of all frames, as [`StudyProgress`] counts them.
    pub fn steps(&self, trial: &Trial<'_>) -> u64 {
        self.frames.len() as u64 * self.steps_of_frame(trial)
    }

    /// The pixel filters of the contestants.
    fn filters(&self, trial: &Trial<'_>) -> Vec<PixelFilter> {
        trial.filters_of(self.contestants.iter().map(|contestant| contestant.choices))
    }

    /// Renders what is missing in the store, and compares all. Modes that are missing are measured in turn, after one
    /// rendering of each to warm up.
    ///
    /// # Errors
    /// As [`Experiment::check`] says, something cannot be rendered, or the store cannot be written or read.
    pub fn run(
        &self,
        trial: &mut Trial<'_>,
        store: &Store<'_>,
        tell: Tell<'_>,
    ) -> Result<(Study, Vec<FramePictures>), StudyError> {
        self.check(trial)?;
        let mut step = 0;
        for &frame in &self.frames {
            self.render(trial, store, frame, tell, step).map_err(StudyError::in_frame(frame))?;
            step += self.steps_of_frame(trial);
        }
        let study = self.study(trial, store)?;
        let pictures = pictured(&study).into_iter().map(|frame| pictures_of(trial, store, frame, &self.contestants));
        let pictures = pictures.collect::<Result<_, _>>()?;
        Ok((study, pictures))
    }

    fn repeats_of(&self, method: Method) -> u32 {
        // References are slow, and their times hardly vary.
        if method.is_traced() { 1 } else { self.repeats }
    }

    /// Renderings of a frame: the references, and for each contestant one to warm up and the timed ones.
    fn steps_of_frame(&self, trial: &Trial<'_>) -> u64 {
        self.filters(trial).len() as u64
            + self.contestants.iter().map(|c| 1 + u64::from(self.repeats_of(c.method))).sum::<u64>()
    }

    /// Renders what is missing of a frame.
    fn render(
        &self,
        trial: &mut Trial<'_>,
        store: &Store<'_>,
        frame: FrameNumber,
        tell: Tell<'_>,
        first_step: u64,
    ) -> Result<(), StudyError> {
        let mut step = first_step;
        for filter in self.filters(trial) {
            let path = store.path_of_judge(trial, frame, filter);
            let settings = trial.settings_of_judge(self.reference, filter)?.of_frame(frame)?;
            if store.finished(&path, &settings).is_none() {
                let what = format!("frame {frame}, {}", trial.name_of_judge(filter));
                let share = |share| tell(StudyProgress::At { step, what: &what, share });
                let shot = trial.judge(self.reference, filter, frame, &share)?;
                store.keep(&path, &shot.picture, &settings, &[shot.seconds])?;
            }
            step += 1;
        }
        let mut missing = Vec::new();
        for &contestant in &self.contestants {
            let settings = trial.settings(contestant, frame)?;
            match store.finished(&store.path(frame, &contestant.to_string()), &settings) {
                // An earlier run may have measured fewer times.
                Some(seconds) if seconds.len() >= self.repeats_of(contestant.method) as usize => {
                    step += 1 + u64::from(self.repeats_of(contestant.method));
                }
                _ => missing.push(Missing { contestant, settings, seconds: Vec::new() }),
            }
        }
        tell(StudyProgress::SkipTo(step));
        let most = missing.iter().map(|missing| self.repeats_of(missing.contestant.method)).max().unwrap_or(0);
        for round in 0..=most {
            for Missing { contestant, settings, seconds } in &mut missing {
                let (name, traced) = (contestant.to_string(), contestant.method.is_traced());
                let repeats = self.repeats_of(contestant.method);
                // References need no warming: nothing is gained by tracing twice.
                if round > repeats || (traced && round == 0) {
                    continue;
                }
                let what = format!("frame {frame}, {name}");
                let share = |share| tell(StudyProgress::At { step, what: &what, share });
                share(0.0);
                let shot = trial.shoot(*contestant, frame, &share).map_err(StudyError::in_mode(name.clone()))?;
                step += if traced { 2 } else { 1 };
                if round > 0 {
                    seconds.push(shot.seconds);
                }
                if round == repeats {
                    store.keep(&store.path(frame, &name), &shot.picture, settings, seconds)?;
                }
            }
        }
        Ok(())
    }

    /// Compares what was rendered.
    fn study(&self, trial: &mut Trial<'_>, store: &Store<'_>) -> Result<Study, StudyError> {
        let mut frames = Vec::new();
        for &frame in &self.frames {
            let regions = regions(trial, frame)?;
            let mut modes: Vec<Option<ModeStudy>> = vec![None; self.contestants.len()];
            let mut floors = Vec::new();
            let mut reference_seconds = 0.0;
            for filter in self.filters(trial) {
                let path = store.path_of_judge(trial, frame, filter);
                let reference = image::read(&path)?;
                let settings = trial.settings_of_judge(self.reference, filter)?.of_frame(frame)?;
                reference_seconds += WallTimes::of(&times(&path, &settings).unwrap_or_default()).median;
                floors.push(Floor::of(&reference)?.ok_or(StudyError::NoStandardError)?);
                for (mode, &contestant) in modes.iter_mut().zip(&self.contestants) {
                    if trial.filter_of(contestant.choices) == filter {
                        *mode = Some(measure(trial, store, frame, contestant, &reference, &regions)?);
                    }
                }
            }
            let floor = Floor::pooled(floors.into_iter());
            frames.push(FrameStudy { frame, reference_seconds, floor, modes: modes.into_iter().flatten().collect() });
        }
        let sequence: Vec<_> = (0..self.contestants.len())
            .filter_map(|i| ModeStudy::pooled(&frames.iter().map(|f| &f.modes[i]).collect::<Vec<_>>()))
            .collect();
        let mut kinds: Vec<BackendKind> = self.contestants.iter().map(|contestant| contestant.backend).collect();
        kinds.sort();
        kinds.dedup();
        Ok(Study {
            program: PROGRAM.to_owned(),
            scene: self.scene(trial)?,
            backends: kinds.into_iter().map(|kind| trial.describe(kind)).collect::<Result<_, _>>()?,
            over: self.over(&frames, &sequence),
            frames,
            sequence,
            notes: Vec::new(),
        })
    }

    /// What does not hold its limits, in words.
    fn over(&self, frames: &[FrameStudy], sequence: &[ModeStudy]) -> Vec<String> {
        let mut over = Vec::new();
        for limit in &self.limits {
            for f in frames {
                let of_frame = |m: &ModeStudy| limit.check(&m.errors, format!("frame {}, {}", f.frame, m.name()));
                over.extend(f.modes.iter().filter_map(of_frame));
            }
            if frames.len() > 1 {
                let of_all = |m: &ModeStudy| limit.check(&m.errors, format!("all frames, {}", m.name()));
                over.extend(sequence.iter().filter_map(of_all));
            }
        }
        over.iter().map(ToString::to_string).collect()
    }

    /// The settings that all modes share, and the reference's.
    fn scene(&self, trial: &mut Trial<'_>) -> Result<SceneStudy, StudyError> {
        let own = |value: Option<f64>| value.map_or_else(|| "the scene's".to_owned(), |e| e.to_string());
        let judge = trial.settings_of_judge(self.reference, trial.options().look.filter)?;
        let of_modes = self.filters(trial).into_iter().map(|filter| filter.to_string()).collect::<Vec<_>>();
        let options = trial.options();
        let mut settings = judge.in_words();
        settings.push(("prefilter", trial.prefilter()));
        settings.sort_unstable();
        settings.insert(0, ("scene file", trial.path().display().to_string()));
        settings.push(("seed of references among the modes", trial.seed_of_others().to_string()));
        settings.push(("filters of the modes, each with a reference of its own", of_modes.join(", ")));
        settings.push(("epsilon of the modes", own(options.look.epsilon)));
        settings.push(("epsilon of the reference", own(None)));
        let scene = trial.scene();
        Ok(SceneStudy {
            name: scene.name.clone(),
            size: [scene.image.width, scene.image.height],
            reference: self.reference,
            repeats: self.repeats,
            settings: settings.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
        })
    }
}

/// One contestant against the reference.
fn measure(
    trial: &mut Trial<'_>,
    store: &Store<'_>,
    frame: FrameNumber,
    contestant: Contestant,
    reference: &Picture,
    regions: &[Region],
) -> Result<ModeStudy, StudyError> {
    let path = store.path(frame, &contestant.to_string());
    let seconds = times(&path, &trial.settings(contestant, frame)?).unwrap_or_default();
    let picture = image::read(&path)?;
    let mut errors = Comparison::new(&picture, reference, &[Metric::Ssim])?;
    let map = flip::map(&picture, reference)?;
    errors.flip = Some(compare::mean(&map, picture.width as usize));
    Ok(ModeStudy {
        mode: contestant.mode(),
        family: contestant.family(),
        backend: contestant.backend.to_string(),
        samples: samples_of(contestant.method, &picture),
        times: WallTimes::of(&seconds),
        z_pass: pass_rate(&picture, reference).ok_or(StudyError::NoStandardError)?,
        regions: split(&picture, reference, &map, regions),
        errors,
    })
}
