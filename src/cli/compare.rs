//! `splatblur compare`: the errors of pictures against others.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use clap::Args;
use serde_json::{Value, json};
use splatblur::FrameNumber;
use splatblur::compare::{
    self, AlphaErrors, Comparison, Limit, Metric, Over, Shown, Worst, flip, number, pairs, ssim, values,
};
use splatblur::image;
use splatblur::study::provenance::PROGRAM;

use super::output::{is_closed_pipe, print, print_json};

/// Compare pictures with a reference: error metrics, and a gate.
///
/// A and B, the reference, are two pictures, or two sequences (folders, or patterns such as out/a.%04d.png) with the
/// same frames; PNG or EXR. Colour is compared premultiplied, that is over black; alpha by itself. A value that is not
/// finite makes the metrics NaN, which is within no limit.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Metrics (linear: light as stored, not clamped; display: sRGB-encoded, clamped to 0..1, as a screen shows it):
  mse         linear: mean of (a - b)^2 over pixels and r, g, b
  rmse        linear: root of mse
  relmse      linear: mean of (a - b)^2 / (b^2 + 0.01)
  mae         linear: mean of |a - b|
  bias        linear: the largest of the channels' |mean of a - b|
  worst       linear: the largest |a - b| of any pixel and channel
  gamma-rmse  display: root of the mean of (a - b)^2
  psnr        display: 20 log10(1 / gamma-rmse), dB; a limit is the least that passes
  ssim        display: mean SSIM, Gaussian window of 11 x 11 (sigma 1.5), r, g, b; a limit is the least that passes
  flip        display: mean LDR-FLIP at 67.02 pixels per degree (monitor 0.7 m wide, 3840 pixels, seen from 0.7 m)
  alpha-rmse, alpha-mae, alpha-bias, alpha-worst: the same of alpha
  non-finite  pixels with a value that is not finite, in both

Examples:
  splatblur compare out/a.0012.png reference.0012.exr
  splatblur compare out/fast out/slow --metric flip,rmse
  As a gate; every frame must pass, and the sequence as a whole:
    splatblur compare 'out/a.%04d.exr' 'ref/a.%04d.exr' --limit flip=0.02 --limit psnr=35

JSON (--json), one object: program, a, b, metrics: {name: value, ...}, bias: [r, g, b], worst and alpha_worst: {frame,
x, y, difference}, alpha_bias, non_finite: [a, b], pixels, pixels_per_degree, frames: [{frame, a, b, width, height,
metrics, worst, non_finite}], over: [{of, metric, value, limit}], within. Values that are not finite are the strings
\"NaN\", \"inf\".

Exit status: 0 within the limits (or none given), 1 over a limit, 2 the comparison could not be made.")]
pub(super) struct Compare {
    /// Picture, folder or pattern to be judged.
    a: PathBuf,
    /// The reference.
    b: PathBuf,
    /// Metrics to show, several with commas [default: all].
    #[arg(long, value_name = "METRIC", value_delimiter = ',')]
    metric: Vec<Metric>,
    /// Exit with status 1 where METRIC of a frame or of the whole is beyond VALUE; may be repeated.
    #[arg(long, value_name = "METRIC=VALUE", value_delimiter = ',')]
    limit: Vec<Limit>,
    /// Print one JSON object instead of text.
    #[arg(long)]
    json: bool,
}

/// A compared pair.
struct Pair {
    frame: Option<FrameNumber>,
    a: PathBuf,
    b: PathBuf,
    size: (u32, u32),
    errors: Comparison,
}

impl Compare {
    pub(super) fn run(&self) -> anyhow::Result<ExitCode> {
        Limit::check_unique(&self.limit).context("--limit")?;
        let pairs = pairs(&self.a, &self.b)?;
        let pairs: Vec<Pair> = pairs.into_iter().map(|pair| self.compare(pair)).collect::<anyhow::Result<_>>()?;
        let frames: Vec<_> = pairs.iter().map(|pair| pair.errors.clone()).collect();
        let whole = Comparison::pooled(&frames)?;
        let over = self.over(&pairs, &whole);
        let code = if over.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(super::OVER) };
        let printed = if self.json {
            print_json(&self.document(&pairs, &whole, &over))
        } else {
            print(&self.text(&pairs, &whole, &over))
        };
        match printed {
            // The verdict stands, whoever stopped reading.
            Err(error) if !is_closed_pipe(&error) => Err(error),
            _ => Ok(code),
        }
    }

    /// Metrics that are shown: those asked for, and those with a limit.
    fn shown(&self) -> Vec<Metric> {
        let asked = |metric: &Metric| {
            self.metric.is_empty() || self.metric.contains(metric) || self.limit.iter().any(|l| l.metric == *metric)
        };
        Metric::ALL.into_iter().filter(asked).collect()
    }

    fn compare(&self, pair: compare::Pair) -> anyhow::Result<Pair> {
        let compare::Pair { frame, a, b } = pair;
        let pictures = [image::read(&a)?, image::read(&b)?];
        let [first, second] = &pictures;
        let size = (first.width, first.height);
        let mut metrics = self.shown();
        let wanted = self.metric.contains(&Metric::Ssim) || self.limit.iter().any(|l| l.metric == Metric::Ssim);
        if size.0.min(size.1) < ssim::WINDOW && !wanted {
            metrics.retain(|&metric| metric != Metric::Ssim);
        }
        let errors = Comparison::new(first, second, &metrics)
            .with_context(|| format!("cannot compare {} with {}", a.display(), b.display()))?;
        Ok(Pair { frame, a, b, size, errors })
    }

    fn over(&self, pairs: &[Pair], whole: &Comparison) -> Vec<Over> {
        let mut over = Vec::new();
        for limit in &self.limit {
            over.extend(pairs.iter().filter_map(|pair| limit.check(&pair.errors, name(pair))));
            if pairs.len() > 1 {
                over.extend(limit.check(whole, "all frames".to_owned()));
            }
        }
        over
    }

    fn text(&self, pairs: &[Pair], whole: &Comparison, over: &[Over]) -> String {
        let mut out = String::new();
        let shown = self.shown();
        let (a, b) = (self.a.display(), self.b.display());
        // Writing to a string cannot fail.
        let _ = match pairs {
            [one] => writeln!(out, "{a} against {b}: {} x {} pixels", one.size.0, one.size.1),
            _ => writeln!(out, "{a} against {b}: {} frames, {} pixels", pairs.len(), whole.pixels),
        };
        for &metric in &shown {
            let value = whole.value(metric).map_or_else(|| "-".to_owned(), |v| Shown(v).to_string());
            let _ = writeln!(out, "  {:<11} {value:>12}  {}", metric.name(), metric.meaning());
        }
        if shown.contains(&Metric::Bias) {
            let [r, g, b] = whole.colour.bias.map(Shown);
            let _ = writeln!(out, "bias of r, g, b: {r}, {g}, {b}");
        }
        let frame = |worst: &Worst| {
            pairs.get(worst.frame).and_then(|pair| pair.frame).map_or_else(String::new, |f| format!(" of frame {f}"))
        };
        if shown.contains(&Metric::Worst) {
            let worst = &whole.colour.worst;
            let _ = writeln!(out, "worst pixel: ({}, {}){}", worst.x, worst.y, frame(worst));
        }
        if shown.contains(&Metric::AlphaWorst) && whole.alpha.worst.difference != 0.0 {
            let worst = &whole.alpha.worst;
            let _ = writeln!(out, "worst alpha: ({}, {}){}", worst.x, worst.y, frame(worst));
        }
        if whole.non_finite != [0, 0] {
            let [in_a, in_b] = whole.non_finite;
            let _ = writeln!(out, "pixels that are not finite: {in_a} in A, {in_b} in B");
        }
        if pairs.len() > 1 {
            // A table of all metrics would be too wide to read.
            let columns: Vec<Metric> = if self.metric.is_empty() && self.limit.is_empty() {
                vec![Metric::Rmse, Metric::GammaRmse, Metric::Ssim, Metric::Flip]
            } else {
                shown
            };
            let _ = write!(out, "{:>8}", "frame");
            for metric in &columns {
                let _ = write!(out, "  {:>11}", metric.name());
            }
            out.push('\n');
            for pair in pairs {
                let _ = write!(out, "{:>8}", pair.frame.unwrap_or_default());
                for metric in &columns {
                    let value = pair.errors.value(*metric).map_or_else(|| "-".to_owned(), |v| Shown(v).to_string());
                    let _ = write!(out, "  {value:>11}");
                }
                out.push('\n');
            }
        }
        for line in over {
            let _ = writeln!(out, "over the limit: {line}");
        }
        if over.is_empty() && !self.limit.is_empty() {
            out.push_str("within the limits\n");
        }
        out
    }

    fn document(&self, pairs: &[Pair], whole: &Comparison, over: &[Over]) -> Value {
        let shown = self.shown();
        let worst = |worst: &Worst| {
            let frame = pairs.get(worst.frame).and_then(|pair| pair.frame);
            json!({ "frame": frame, "x": worst.x, "y": worst.y, "difference": number(worst.difference) })
        };
        let AlphaErrors { bias: alpha_bias, worst: alpha_worst, .. } = &whole.alpha;
        let frames: Vec<Value> = pairs
            .iter()
            .map(|pair| {
                let place = &pair.errors.colour.worst;
                json!({
                    "frame": pair.frame,
                    "a": path(&pair.a),
                    "b": path(&pair.b),
                    "width": pair.size.0,
                    "height": pair.size.1,
                    "metrics": values(&pair.errors, &shown),
                    "worst": { "x": place.x, "y": place.y, "difference": number(place.difference) },
                    "non_finite": pair.errors.non_finite,
                })
            })
            .collect();
        json!({
            "program": PROGRAM,
            "a": path(&self.a),
            "b": path(&self.b),
            "metrics": values(whole, &shown),
            "bias": whole.colour.bias.map(number),
            "worst": worst(&whole.colour.worst),
            "alpha_bias": number(*alpha_bias),
            "alpha_worst": worst(alpha_worst),
            "non_finite": whole.non_finite,
            "pixels": whole.pixels,
            "pixels_per_degree": flip::PIXELS_PER_DEGREE,
            "frames": frames,
            "over": over,
            "within": over.is_empty(),
        })
    }
}

fn path(path: &Path) -> String {
    path.display().to_string()
}

fn name(pair: &Pair) -> String {
    pair.frame.map_or_else(|| path(&pair.a), |frame| format!("frame {frame}"))
}
