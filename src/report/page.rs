//! The page: one HTML file that needs nothing else.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::chart::{COLOURS, Series, log_log};
use super::maps::flip_scale;
use super::regions::Region;
use super::study::{ModeStudy, Study};
use crate::compare::{Metric, flip};
use crate::sheet::{Canvas, SheetError};

const STYLE: &str = include_str!("page.css");

/// The pictures of one frame.
#[derive(Clone, Debug)]
pub struct FramePictures {
    /// Frame number.
    pub frame: i64,
    /// The reference.
    pub reference: Canvas,
    /// One for each mode of the frame, in the order of the study.
    pub modes: Vec<ModePictures>,
    /// Difference of display values that has the full colour of the signed maps.
    pub signed_range: f32,
    /// FLIP that has the brightest colour of the FLIP maps.
    pub flip_range: f32,
}

/// The pictures of one mode.
#[derive(Clone, Debug)]
pub struct ModePictures {
    /// The picture.
    pub picture: Canvas,
    /// Signed error.
    pub signed: Canvas,
    /// FLIP.
    pub flip: Canvas,
    /// Where FLIP is worst: the picture, and the reference.
    pub worst: [Canvas; 2],
}

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
                p class="faint" { (frames(study)) ", " (scene.size[0]) " x " (scene.size[1]) " pixels, reference with " (scene.reference) " samples a pixel. " (study.program) "." }
                (verdict(study))
                h2 { @if several { "All frames" } @else { "Result" } }
                p { "A star marks modes to which no other is both faster and better by FLIP. Seconds: wall time of a frame, median of "
                    (scene.repeats) " renderings, shortest to longest; the modes were rendered in turn after one rendering each to warm up"
                    @if several { "; means over the frames" } "." }
                (table(&study.sequence, &[Metric::Flip, Metric::GammaRmse, Metric::Rmse, Metric::Ssim, Metric::Psnr]))
                h2 { "Error against samples and time" }
                (charts(study))
                h2 { "All metrics" }
                (table(&study.sequence, &Metric::ALL))
                (formulas())
                h2 { "Where the error is" }
                (regions(&study.sequence))
                @if several {
                    h2 { "Each frame" }
                    @for f in &study.frames {
                        h3 { "Frame " (f.frame) }
                        p class="faint" { "Standard error of the reference: " (figure(f.standard_error)) }
                        (table(&f.modes, &[Metric::Flip, Metric::GammaRmse, Metric::Rmse, Metric::Ssim, Metric::Psnr]))
                    }
                }
                @if several && shown.len() < study.frames.len() {
                    p class="faint" { "Pictures: the first frame, the one with the greatest FLIP, and the last." }
                }
                @for markup in shown { (markup) }
                h2 { "What was rendered" }
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

fn verdict(study: &Study) -> Markup {
    let best = study
        .sequence
        .iter()
        .filter(|m| m.errors.flip.is_some_and(f64::is_finite))
        .min_by(|a, b| a.errors.flip.unwrap_or(f64::NAN).total_cmp(&b.errors.flip.unwrap_or(f64::NAN)));
    html! {
        @if let Some(best) = best {
            p { "Lowest FLIP: " b { (best.name()) } ", " (figure(best.errors.flip.unwrap_or(f64::NAN))) " in " (figure(best.times.median)) " s." }
        }
        @for over in &study.over { p class="bad" { "Over the limit: " (over) } }
    }
}

fn table(modes: &[ModeStudy], metrics: &[Metric]) -> Markup {
    html! {
        div class="wide" { table {
            thead { tr {
                th { "mode" } th { "samples" }
                @for metric in metrics { th title=(metric.meaning()) { (metric.name()) } }
                th { "bias r, g, b" } th { "z-test" } th { "seconds" } th { "from" } th { "to" }
            } }
            tbody { @for m in modes {
                tr class=[m.leads(modes).then_some("leads")] {
                    td { (m.name()) } td { (m.samples) }
                    @for &metric in metrics { td { (m.errors.value(metric).map_or_else(|| "-".to_owned(), figure)) } }
                    td { (m.errors.colour.bias.map(|b| format!("{b:+.1e}")).join(" ")) }
                    td { (percent(m.z_pass)) }
                    td { (figure(m.times.median)) } td { (figure(m.times.least)) } td { (figure(m.times.most)) }
                }
            } }
        } }
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
    let squares: f64 = study.frames.iter().map(|f| f.standard_error.powi(2)).sum();
    let floor = (squares / study.frames.len().max(1) as f64).sqrt();
    let floor = Some((floor, "standard error of the reference"));
    let samples: fn(&ModeStudy) -> f64 = |m| m.samples as f64;
    let seconds: fn(&ModeStudy) -> f64 = |m| m.times.median;
    let chart = |x_name: &str, x, y_name: &str, y, floor| PreEscaped(log_log(x_name, y_name, &series(x, y), floor));
    html! {
        div class="legend" {
            @for (i, (family, backend)) in names.iter().enumerate() {
                span { i style=(format!("background:var(--s{})", i % COLOURS)) {} (family) "@" (backend) }
            }
        }
        div class="charts" {
            div class="card" { h3 { "FLIP against time" } (chart("seconds a frame", seconds, "FLIP", Metric::Flip, None)) }
            div class="card" { h3 { "RMSE (linear) against time" } (chart("seconds a frame", seconds, "RMSE", Metric::Rmse, floor)) }
            div class="card" { h3 { "FLIP against samples" } (chart("samples a pixel", samples, "FLIP", Metric::Flip, None)) }
            div class="card" { h3 { "RMSE (linear) against samples" } (chart("samples a pixel", samples, "RMSE", Metric::Rmse, floor)) }
        }
    }
}

fn regions(modes: &[ModeStudy]) -> Markup {
    let used: Vec<Region> =
        Region::ALL.into_iter().filter(|r| modes.iter().any(|m| m.regions.iter().any(|e| e.region == *r))).collect();
    let share =
        |region: Region| modes.iter().flat_map(|m| &m.regions).find(|r| r.region == region).map_or(0.0, |r| r.pixels);
    html! {
        p { "In each cell: RMSE (linear), FLIP, share of the squared error. Static: one surface that moves by less than 0.25 pixels while the "
            "shutter is open; swept: one that moves farther; occlusion change: another surface comes or goes; silhouette: a still edge." }
        div class="wide" { table {
            thead { tr { th { "mode" } @for &region in &used { th { (region.name()) br; (percent(share(region))) " of the pixels" } } } }
            tbody { @for m in modes { tr {
                td { (m.name()) }
                @for &region in &used { td {
                    @if let Some(r) = m.regions.iter().find(|r| r.region == region) {
                        (figure(r.rmse)) ", " (figure(r.flip)) ", " (percent(r.error))
                    }
                } }
            } } }
        } }
    }
}

fn frame_pictures(study: &Study, pictures: &FramePictures) -> Result<Markup, SheetError> {
    let modes = study.frames.iter().find(|f| f.frame == pictures.frame).map_or(&[][..], |f| &f.modes);
    let mut cards = Vec::new();
    for (m, p) in modes.iter().zip(&pictures.modes) {
        let worst = &m.errors.colour.worst;
        cards.push(html! {
            div class="card" {
                h3 { (m.name()) }
                p class="faint" {
                    "FLIP " (figure(m.errors.flip.unwrap_or(f64::NAN))) ", RMSE " (figure(m.errors.value(Metric::Rmse).unwrap_or(f64::NAN)))
                    ", " (figure(m.times.median)) " s; worst pixel (" (worst.x) ", " (worst.y) ")"
                }
                div class="pictures" {
                    (image(&p.picture, "picture", false)?)
                    (image(&p.signed, "signed error: red too bright, blue too dark", false)?)
                    (image(&p.flip, "FLIP", false)?)
                    (image(&p.worst[0], "where FLIP is worst", true)?)
                    (image(&p.worst[1], "the reference there", true)?)
                }
            }
        });
    }
    Ok(html! {
        h2 { "Frame " (pictures.frame) }
        p { "Signed error, mean of r, g, b of display values: -" (figure(f64::from(pictures.signed_range)))
            span class="scale" style="background:linear-gradient(90deg,rgb(33,102,172),#fff,rgb(178,24,43))" {}
            "+" (figure(f64::from(pictures.signed_range))) ". FLIP: 0"
            span class="scale" style=(format!("background:linear-gradient(90deg,{})", flip_stops())) {}
            (figure(f64::from(pictures.flip_range))) ". The maps of a frame share their scales." }
        div class="modes" {
            div class="card" { h3 { "reference" } div class="reference" { (image(&pictures.reference, "the reference", false)?) } }
            @for card in cards { (card) }
        }
    })
}

fn flip_stops() -> String {
    let stop = |i: u8| {
        let [r, g, b] = flip_scale(f32::from(i) / 5.0);
        format!("rgb({r},{g},{b})")
    };
    (0..=5).map(stop).collect::<Vec<_>>().join(",")
}

fn image(canvas: &Canvas, caption: &str, crop: bool) -> Result<Markup, SheetError> {
    let data = format!("data:image/png;base64,{}", base64(&canvas.png()?));
    Ok(html! {
        figure {
            img class=[crop.then_some("crop")] src=(data) width=(canvas.width()) height=(canvas.height()) alt=(caption);
            figcaption { (caption) }
        }
    })
}

fn formulas() -> Markup {
    html! {
        p class="faint" {
            @for (i, metric) in Metric::ALL.into_iter().enumerate() {
                @if i > 0 { "; " }
                b { (metric.name()) } " " (metric.meaning())
            }
            ". Linear: light as stored, not clamped; display: sRGB-encoded, clamped to 0..1. FLIP at " (format!("{:.2}", flip::PIXELS_PER_DEGREE))
            " pixels per degree (monitor 0.7 m wide, 3840 pixels, seen from 0.7 m). z-test: share of the values that differ from the reference "
            "by no more than its standard error (at least 1e-4) explains, two-sided, 1 % for all values together (Šidák)."
        }
    }
}

fn settings(study: &Study) -> Markup {
    html! {
        div class="wide" { table class="settings" { tbody {
            @for (name, value) in &study.scene.settings { tr { td { (name) } td { (value) } } }
            @for machine in &study.machines { tr { td { "machine" } td { (machine) } } }
            @for f in &study.frames {
                tr { td { "reference of frame " (f.frame) } td { "standard error (root mean square) " (figure(f.standard_error)) ", made in " (figure(f.reference_seconds)) " s" } }
            }
            @for note in &study.notes { tr { td { "note" } td { (note) } } }
        } } }
    }
}

/// Three significant digits.
fn figure(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        format!("{value}")
    } else if (1e-4..1e5).contains(&value.abs()) {
        let digits = (2 - value.abs().log10().floor() as i32).max(0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.2e}")
    }
}

fn percent(share: f64) -> String {
    // 100 % is only what is all: a few wrong values must not be rounded away.
    let text = format!("{:.2} %", share * 100.0);
    if share < 1.0 && text == "100.00 %" { "99.99 %".to_owned() } else { text }
}

/// RFC 4648, with padding.
pub(super) fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0_u32, |word, &b| word << 8 | u32::from(b)) << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= chunk.len() { char::from(letter) } else { '=' });
        }
    }
    out
}
