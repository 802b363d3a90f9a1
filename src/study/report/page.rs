//! The page: one HTML file that needs nothing else.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::chart::{COLOURS, Series, log_log};
use super::figures::{ModeStudy, Study};
use super::floor::Floor;
use super::pictures::{FramePictures, frame_pictures, patch};
use super::regions::Region;
use super::text::{figure, percent};
use crate::compare::{Metric, flip};
use crate::study::sheet::SheetError;

const STYLE: &str = include_str!("page.css");

/// The page, with pictures of some frames.
///
/// # Errors
/// A picture cannot be encoded.
pub fn page(study: &Study, pictures: &[FramePictures]) -> Result<String, SheetError> {
    let scene = &study.scene;
    let several = study.frames.len() > 1;
    let shown: Vec<Markup> = pictures.iter().map(|p| frame_pictures(study, p)).collect::<Result<_, _>>()?;
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "Blur modes of " (scene.name) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { "Blur modes of " (scene.name) " against the ray-traced reference" }
                (summary(study))
                (verdict(study))
                h2 { @if several { "All frames" } @else { "Result" } }
                p { "A star marks modes to which no other is both faster and better by FLIP. Seconds: wall time of a "
                    "frame, median of " (scene.repeats) " renderings, shortest to longest; the modes were rendered in "
                    "turn after one rendering each to warm up"
                    @if several { "; means over the frames" } "."
                    @if study.scene.settings.iter().any(|(name, value)| name == "prefilter" && value == "approx") {
                        " The modes have the prefilter approx and the reference has none: part of each error is the "
                        "prefilter's, and no number of samples removes it."
                    } }
                (results(&study.sequence, study.floor()))
                h2 { "Error against samples and time" }
                (charts(study))
                h2 { "All metrics" }
                (metrics(&study.sequence))
                h2 { "Where the error is" }
                (regions(&study.sequence))
                @if several {
                    h2 { "Each frame" }
                    @for f in &study.frames {
                        h3 { "Frame " (f.frame) }
                        (results(&f.modes, f.floor))
                    }
                }
                @if several && shown.len() < study.frames.len() {
                    p class="faint" { "Pictures: the first frame, the one with the greatest FLIP, and the last." }
                }
                @for markup in shown { (markup) }
                h2 id="rendered" { "What was rendered" }
                (settings(study))
            }
        }
    };
    Ok(markup.into_string())
}

fn frames(study: &Study) -> String {
    match &study.frames[..] {
        [one] => format!("frame {}", one.frame),
        [first, .., last] => format!("{} frames, {} to {}", study.frames.len(), first.frame, last.frame),
        [] => "no frames".to_owned(),
    }
}

/// What was rendered, in one sentence.
fn summary(study: &Study) -> Markup {
    let scene = &study.scene;
    let setting = |name: &str| scene.settings.iter().find(|(n, _)| n == name).map_or("", |(_, value)| value);
    html! {
        p class="faint" {
            (frames(study)) ", " (scene.size[0]) " x " (scene.size[1]) " pixels, shutter " (setting("shutter"))
            ", weight " (setting("weight")) ", prefilter " (setting("prefilter"))
            ". Reference: " (scene.reference) " samples a pixel, standard error " (figure(study.floor().rmse))
            ". " (study.program) " on " (study.backends.join("; "))
            ". Everything else is listed " a href="#rendered" { "below" } "."
        }
    }
}

fn verdict(study: &Study) -> Markup {
    let best = study
        .sequence
        .iter()
        .filter(|m| m.errors.flip.is_some_and(f64::is_finite))
        .min_by(|a, b| a.errors.flip.unwrap_or(f64::NAN).total_cmp(&b.errors.flip.unwrap_or(f64::NAN)));
    html! {
        @if let Some(best) = best {
            p {
                "Lowest FLIP: " b { (best.name()) } ", " (figure(best.errors.flip.unwrap_or(f64::NAN)))
                " in " (figure(best.times.median)) " s."
            }
        }
        @for over in &study.over { p class="bad" { "Over the limit: " (over) } }
    }
}

/// The figures that a mode is chosen by. The last line is what the reference's noise makes.
fn results(modes: &[ModeStudy], floor: Floor) -> Markup {
    const SHOWN: [Metric; 5] = [Metric::Flip, Metric::GammaRmse, Metric::Rmse, Metric::Ssim, Metric::Psnr];
    html! {
        div class="wide" { table {
            thead { tr {
                th { "mode" } th { "seconds" } th { "from, to" } th { "samples" } (heads(&SHOWN)) th { "z-test" }
            } }
            tbody {
                @for m in modes { tr class=[m.leads(modes).then_some("leads")] {
                    td { (breakable(&m.name())) } td { (figure(m.times.median)) }
                    td { (figure(m.times.least)) ", " (figure(m.times.most)) } td { (m.samples) }
                    (values(m, &SHOWN)) td { (percent(m.z_pass)) }
                } }
                tr class="faint" {
                    td { "noise of the reference" } td {} td {} td {}
                    @for metric in SHOWN {
                        td { @match metric {
                            Metric::Flip => (figure(floor.flip)),
                            Metric::Rmse => (figure(floor.rmse)),
                            _ => {}
                        } }
                    }
                    td {}
                }
            }
        } }
    }
}

/// All metrics, a table for each kind of values.
fn metrics(modes: &[ModeStudy]) -> Markup {
    const DISPLAY: [Metric; 4] = [Metric::GammaRmse, Metric::Psnr, Metric::Ssim, Metric::Flip];
    let of = |metrics: &[Metric], bias: bool| {
        html! {
            div class="wide" { table {
                thead { tr { th { "mode" } (heads(metrics)) @if bias { th { "signed bias of r, g, b" } } } }
                tbody { @for m in modes { tr {
                    td { (breakable(&m.name())) } (values(m, metrics))
                    @if bias { td { (m.errors.colour.bias.map(|b| format!("{b:+.1e}")).join(", ")) } }
                } } }
            } }
        }
    };
    let (colour, alpha) = Metric::ALL.split_at(Metric::ALL.iter().position(|m| *m == Metric::AlphaRmse).unwrap_or(0));
    let linear: Vec<Metric> = colour.iter().copied().filter(|metric| !DISPLAY.contains(metric)).collect();
    html! {
        h3 { "Linear light, as stored, not clamped" } (of(&linear, true)) (formulas(&linear))
        h3 { "Display values: sRGB-encoded, clamped to 0..1" } (of(&DISPLAY, false)) (formulas(&DISPLAY))
        h3 { "Alpha (1 everywhere where the scene has a background), and values that are not finite" }
        (of(alpha, false)) (formulas(alpha))
        p class="faint" {
            "a is the mode's picture, b the reference. FLIP at " (format!("{:.2}", flip::PIXELS_PER_DEGREE))
            " pixels per degree: a monitor 0.7 m wide with 3840 pixels, seen from 0.7 m. z-test: share of the values "
            "that differ from the reference by no more than its standard error (at least 1e-4) explains, two-sided, 1 "
            "% for all values together (Šidák). Noise of the reference: the errors of a picture that has none of its "
            "own; RMSE is the standard error (root mean square), FLIP that of normal noise of that size."
        }
    }
}

fn heads(metrics: &[Metric]) -> Markup {
    html! { @for metric in metrics { th title=(metric.meaning()) { (metric.name()) } } }
}

/// The name of a mode, which may go on in a new line after an option.
fn breakable(name: &str) -> Markup {
    html! { @for part in name.split_inclusive('+') { (part) wbr; } }
}

fn values(mode: &ModeStudy, metrics: &[Metric]) -> Markup {
    html! { @for &metric in metrics { td { (mode.errors.value(metric).map_or_else(|| "-".to_owned(), figure)) } } }
}

fn formulas(metrics: &[Metric]) -> Markup {
    html! {
        p class="faint" { @for (i, metric) in metrics.iter().enumerate() {
            @if i > 0 { "; " }
            b { (metric.name()) } " "
            (metric.meaning().split_once(": ").map_or(metric.meaning(), |(_, formula)| formula))
        } "." }
    }
}

fn charts(study: &Study) -> Markup {
    let mut names: Vec<(String, String)> = Vec::new();
    for m in &study.sequence {
        let key = (m.family.clone(), m.backend.clone());
        if !names.contains(&key) {
            names.push(key);
        }
    }
    let series = |x: fn(&ModeStudy) -> f64, y: Metric| -> Vec<Series> {
        names
            .iter()
            .map(|(family, backend)| Series {
                name: format!("{family}@{backend}"),
                points: study
                    .sequence
                    .iter()
                    .filter(|m| m.family == *family && m.backend == *backend)
                    .map(|m| (x(m), m.errors.value(y).unwrap_or(f64::NAN), m.name()))
                    .collect(),
            })
            .collect()
    };
    let floor = study.floor();
    let samples: fn(&ModeStudy) -> f64 = |m| m.samples as f64;
    let seconds: fn(&ModeStudy) -> f64 = |m| m.times.median;
    let chart = |title: &str, (x_name, x), (y_name, y), floor: f64| {
        let drawn = PreEscaped(log_log(x_name, y_name, &series(x, y), Some((floor, "noise of the reference"))));
        html! { div class="card" { h3 { (title) } (drawn) } }
    };
    let (time, count) = (("seconds a frame", seconds), ("samples a pixel", samples));
    let (flip, rmse) = (("FLIP", Metric::Flip), ("RMSE", Metric::Rmse));
    html! {
        div class="legend" {
            @for (i, (family, backend)) in names.iter().enumerate() {
                span { i style=(format!("background:var(--s{})", i % COLOURS)) {} (family) "@" (backend) }
            }
        }
        div class="charts" {
            (chart("FLIP against time", time, flip, floor.flip))
            (chart("RMSE (linear) against time", time, rmse, floor.rmse))
            (chart("FLIP against samples", count, flip, floor.flip))
            (chart("RMSE (linear) against samples", count, rmse, floor.rmse))
        }
    }
}

fn regions(modes: &[ModeStudy]) -> Markup {
    let used: Vec<Region> =
        Region::ALL.into_iter().filter(|r| modes.iter().any(|m| m.regions.iter().any(|e| e.region == *r))).collect();
    let share =
        |region: Region| modes.iter().flat_map(|m| &m.regions).find(|r| r.region == region).map_or(0.0, |r| r.pixels);
    html! {
        p {
            "Below a region's name: its share of the pixels. In each cell: its RMSE (linear), FLIP, and share of the "
            "squared error. Static: one surface that moves by less than 0.25 pixels while the shutter is open; swept: "
            "one that moves farther; occlusion change: another surface comes or goes; silhouette: an edge that does "
            "not move."
        }
        div class="wide" { table {
            thead { tr { th { "mode" } @for &region in &used { th {
                i class="patch" style=(patch(region)) {} (region.name()) br;
                span class="faint" { (percent(share(region))) }
            } } } }
            tbody { @for m in modes { tr {
                td { (breakable(&m.name())) }
                @for &region in &used { td {
                    @if let Some(r) = m.regions.iter().find(|r| r.region == region) {
                        (figure(r.rmse)) br; (figure(r.flip)) br; span class="faint" { (percent(r.error)) }
                    }
                } }
            } } }
        } }
    }
}

fn settings(study: &Study) -> Markup {
    html! {
        div class="wide" { table class="settings" { tbody {
            @for (name, value) in &study.scene.settings { tr { td { (name) } td { (value) } } }
            @for backend in &study.backends { tr { td { "backend" } td { (backend) } } }
            @for f in &study.frames {
                tr { td { "reference of frame " (f.frame) } td {
                    "standard error (root mean square) " (figure(f.floor.rmse))
                    ", FLIP of such noise " (figure(f.floor.flip))
                    ", made in " (figure(f.reference_seconds)) " s on the CPU"
                } }
            }
            @for note in &study.notes { tr { td { "note" } td { (note) } } }
        } } }
    }
}
