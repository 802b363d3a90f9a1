//! The figures of a report: as values, as JSON, as CSV.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::floor::Floor;
use super::regions::{Region, RegionErrors};
use crate::compare::{Comparison, Metric, flip, number, values};
use crate::time::FrameNumber;

/// All that a report states.
#[derive(Clone, Debug)]
pub struct Study {
    /// Program and version.
    pub program: String,
    /// What was rendered.
    pub scene: SceneStudy,
    /// The backends, in words.
    pub backends: Vec<String>,
    /// Frames, in order.
    pub frames: Vec<FrameStudy>,
    /// The modes over all frames, in the order in which they were asked for.
    pub sequence: Vec<ModeStudy>,
    /// Limits that were exceeded, in words.
    pub over: Vec<String>,
    /// What loading the scene has noted.
    pub notes: Vec<String>,
}

/// What was rendered, and how.
#[derive(Clone, Debug, Default)]
pub struct SceneStudy {
    /// Name of the scene.
    pub name: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples of a pixel of the reference.
    pub reference: u64,
    /// Timed renderings of a mode.
    pub repeats: u32,
    /// Everything else, as name and value: hash, shutter, weight, filter, seeds and so on.
    pub settings: Vec<(String, String)>,
}

/// One frame.
#[derive(Clone, Debug)]
pub struct FrameStudy {
    /// Frame number.
    pub frame: FrameNumber,
    /// Wall time of the reference.
    pub reference_seconds: f64,
    /// What the reference's noise makes.
    pub floor: Floor,
    /// The modes.
    pub modes: Vec<ModeStudy>,
}

/// One mode on one backend, of one frame or of all.
#[derive(Clone, Debug)]
pub struct ModeStudy {
    /// The mode, without backend.
    pub mode: String,
    /// The mode without its counts: modes that a curve joins.
    pub family: String,
    /// The backend.
    pub backend: String,
    /// Samples of a pixel.
    pub samples: u64,
    /// Wall times of rendering a frame.
    pub times: WallTimes,
    /// The errors.
    pub errors: Comparison,
    /// Share of values that pass the z-test.
    pub z_pass: f64,
    /// The errors by region.
    pub regions: Vec<RegionErrors>,
}

/// Wall times, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WallTimes {
    /// The median.
    pub median: f64,
    /// The shortest.
    pub least: f64,
    /// The longest.
    pub most: f64,
}

impl WallTimes {
    /// The times of these renderings; 0 where there are none.
    pub fn of(seconds: &[f64]) -> Self {
        let mut sorted = seconds.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (Some(&least), Some(&most)) = (sorted.first(), sorted.last()) else { return Self::default() };
        let n = sorted.len();
        Self { median: f64::midpoint(sorted[(n - 1) / 2], sorted[n / 2]), least, most }
    }

    /// The mean over frames of each figure.
    fn mean(times: &[Self]) -> Self {
        let n = times.len().max(1) as f64;
        let mean = |value: fn(&Self) -> f64| times.iter().map(value).sum::<f64>() / n;
        Self { median: mean(|t| t.median), least: mean(|t| t.least), most: mean(|t| t.most) }
    }
}

impl ModeStudy {
    /// The mode as a column's title.
    pub fn name(&self) -> String {
        format!("{}@{}", self.mode, self.backend)
    }

    /// One mode over all frames; `None` where there is none.
    pub fn pooled(frames: &[&Self]) -> Option<Self> {
        let first = *frames.first()?;
        let n = frames.len() as f64;
        let errors: Vec<_> = frames.iter().map(|f| f.errors.clone()).collect();
        let regions = Region::ALL.into_iter().filter_map(|region| pooled_region(region, frames)).collect();
        Some(Self {
            times: WallTimes::mean(&frames.iter().map(|f| f.times).collect::<Vec<_>>()),
            errors: Comparison::pooled(&errors).ok()?,
            z_pass: frames.iter().map(|f| f.z_pass).sum::<f64>() / n,
            regions,
            ..first.clone()
        })
    }

    /// Whether no other mode is both faster and better by FLIP.
    pub fn leads(&self, others: &[Self]) -> bool {
        let key = |m: &Self| (m.times.median, m.errors.flip.unwrap_or(f64::NAN));
        let (time, flip) = key(self);
        let beats = |other: &Self| {
            let (t, f) = key(other);
            t <= time && f <= flip && (t, f) != (time, flip)
        };
        time.is_finite() && flip.is_finite() && !others.iter().any(beats)
    }

    fn json(&self) -> Value {
        let regions: Vec<Value> = self
            .regions
            .iter()
            .map(|r| {
                json!({ "region": r.region.name(), "pixels": number(r.pixels), "rmse": number(r.rmse),
                        "flip": number(r.flip), "error_share": number(r.error) })
            })
            .collect();
        let worst = &self.errors.colour.worst;
        json!({
            "mode": self.mode,
            "backend": self.backend,
            "samples": self.samples,
            "seconds": { "median": self.times.median, "least": self.times.least, "most": self.times.most },
            "metrics": values(&self.errors, &Metric::ALL),
            "bias": self.errors.colour.bias.map(number),
            "worst": { "x": worst.x, "y": worst.y },
            "z_pass": number(self.z_pass),
            "regions": regions,
        })
    }
}

/// A region over all frames: weighted by its pixels in each.
fn pooled_region(region: Region, frames: &[&ModeStudy]) -> Option<RegionErrors> {
    let here: Vec<&RegionErrors> =
        frames.iter().flat_map(|f| f.regions.iter().filter(|r| r.region == region)).collect();
    let pixels: f64 = here.iter().map(|r| r.pixels).sum();
    let squares = |r: &RegionErrors| r.rmse.powi(2) * r.pixels;
    let total: f64 = frames.iter().flat_map(|f| &f.regions).map(squares).sum();
    let here_squares: f64 = here.iter().map(|r| squares(r)).sum();
    (pixels > 0.0).then(|| RegionErrors {
        region,
        pixels: pixels / frames.len() as f64,
        rmse: (here_squares / pixels).sqrt(),
        flip: here.iter().map(|r| r.flip * r.pixels).sum::<f64>() / pixels,
        error: if total == 0.0 { 0.0 } else { here_squares / total },
    })
}

impl Study {
    /// The floor of all frames.
    pub fn floor(&self) -> Floor {
        Floor::pooled(self.frames.iter().map(|f| f.floor))
    }

    /// The report's JSON.
    pub fn json(&self) -> Value {
        let SceneStudy { name, size, reference, repeats, settings } = &self.scene;
        let settings: serde_json::Map<_, _> =
            settings.iter().map(|(name, value)| (name.clone(), Value::from(value.as_str()))).collect();
        let frames: Vec<Value> = self
            .frames
            .iter()
            .map(|f| {
                json!({
                    "frame": f.frame,
                    "reference_seconds": f.reference_seconds,
                    "standard_error": number(f.floor.rmse),
                    "flip_floor": number(f.floor.flip),
                    "modes": f.modes.iter().map(ModeStudy::json).collect::<Vec<_>>(),
                })
            })
            .collect();
        json!({
            "program": self.program,
            "scene": name,
            "size": size,
            "reference_samples": reference,
            "repeats": repeats,
            "pixels_per_degree": flip::PIXELS_PER_DEGREE,
            "settings": settings,
            "machines": self.backends,
            "sequence": self.sequence.iter().map(ModeStudy::json).collect::<Vec<_>>(),
            "frames": frames,
            "over": self.over,
            "notes": self.notes,
        })
    }
}

/// One line for each frame, mode and backend, and for each mode and backend over all frames (`all`).
pub fn csv(study: &Study) -> String {
    let mut out = String::from("frame,mode,backend,samples,seconds_median,seconds_least,seconds_most");
    // Writing to a string cannot fail.
    for metric in Metric::ALL {
        let _ = write!(out, ",{}", metric.name());
    }
    out.push_str(",bias_r,bias_g,bias_b,z_pass,standard_error,flip_floor");
    for region in Region::ALL {
        let name = region.name().replace(' ', "_");
        let _ = write!(out, ",{name}_pixels,{name}_rmse,{name}_flip");
    }
    out.push('\n');
    let rows = study.frames.iter().flat_map(|f| f.modes.iter().map(move |m| (f.frame.to_string(), m, f.floor)));
    for (frame, m, floor) in rows.chain(study.sequence.iter().map(|m| ("all".to_owned(), m, study.floor()))) {
        let WallTimes { median, least, most } = m.times;
        // Modes have neither commas nor quotes.
        let _ = write!(out, "{frame},{},{},{},{median},{least},{most}", m.mode, m.backend, m.samples);
        for metric in Metric::ALL {
            let _ = write!(out, ",{}", m.errors.value(metric).map_or_else(String::new, |v| v.to_string()));
        }
        let [r, g, b] = m.errors.colour.bias;
        let _ = write!(out, ",{r},{g},{b},{},{},{}", m.z_pass, floor.rmse, floor.flip);
        for region in Region::ALL {
            match m.regions.iter().find(|r| r.region == region) {
                Some(r) => drop(write!(out, ",{},{},{}", r.pixels, r.rmse, r.flip)),
                None => out.push_str(",0,,"),
            }
        }
        out.push('\n');
    }
    out
}
