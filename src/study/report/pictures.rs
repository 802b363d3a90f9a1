//! The pictures of the page.

use base64::engine::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};

use super::figures::Study;
use super::maps::flip_scale;
use super::regions::Region;
use super::text::figure;
use crate::compare::Metric;
use crate::study::sheet::{Canvas, Crop, SheetError};
use crate::time::FrameNumber;

/// The pictures of one frame.
#[derive(Clone, Debug)]
pub struct FramePictures {
    /// Frame number.
    pub frame: FrameNumber,
    /// The references, one for each pixel filter of the modes, with their names.
    pub references: Vec<(String, Canvas)>,
    /// The regions.
    pub regions: Canvas,
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
    /// Where FLIP is worst.
    pub crop: Crop,
    /// There: the picture, the reference, FLIP.
    pub worst: [Canvas; 3],
}

/// The section of a frame with pictures.
pub(super) fn frame_pictures(study: &Study, pictures: &FramePictures) -> Result<Markup, SheetError> {
    let modes = study.frames.iter().find(|f| f.frame == pictures.frame).map_or(&[][..], |f| &f.modes);
    let mut cards = Vec::new();
    for (m, p) in modes.iter().zip(&pictures.modes) {
        let worst = &m.errors.colour.worst;
        cards.push(html! {
            div class="card" {
                h3 { (m.name()) }
                p class="faint" {
                    "FLIP " (figure(m.errors.flip.unwrap_or(f64::NAN)))
                    ", RMSE " (figure(m.errors.value(Metric::Rmse).unwrap_or(f64::NAN)))
                    ", " (figure(m.times.median)) " s; worst pixel (" (worst.x) ", " (worst.y)
                    "); FLIP is worst where the picture has a frame: " (p.crop)
                }
                div class="pictures" {
                    (image(&p.picture, "picture", false)?)
                    (image(&p.signed, "signed error: red too bright, blue too dark", false)?)
                    (image(&p.flip, "FLIP", false)?)
                    (image(&p.worst[0], "where FLIP is worst", true)?)
                    (image(&p.worst[1], "the reference there", true)?)
                    (image(&p.worst[2], "FLIP there", true)?)
                }
            }
        });
    }
    Ok(html! {
        h2 { "Frame " (pictures.frame) }
        p { "Signed error, mean of r, g, b of display values: " span class="key" {
            "-" (figure(f64::from(pictures.signed_range)))
            span class="scale" style="background:linear-gradient(90deg,rgb(33,102,172),#fff,rgb(178,24,43))" {}
            "+" (figure(f64::from(pictures.signed_range))) } ". FLIP: " span class="key" { "0"
            span class="scale" style=(format!("background:linear-gradient(90deg,{})", flip_stops())) {}
            (figure(f64::from(pictures.flip_range))) } ". The maps of all modes share these scales." }
        div class="modes" {
            div class="card" {
                h3 { "reference" }
                div class="pair" {
                    @for (name, reference) in &pictures.references { (image(reference, name, false)?) }
                    div {
                        (image(&pictures.regions, "regions", false)?)
                        p class="legend" { @for region in Region::ALL { span {
                            i class="patch" style=(patch(region)) {} (region.name())
                        } } }
                    }
                }
            }
            @for card in cards { (card) }
        }
    })
}

/// The style of a region's patch of colour.
pub(super) fn patch(region: Region) -> String {
    let [r, g, b] = region.colour();
    format!("background:rgb({r},{g},{b})")
}

fn flip_stops() -> String {
    let stop = |i: u8| {
        let [r, g, b] = flip_scale(f32::from(i) / 5.0);
        format!("rgb({r},{g},{b})")
    };
    (0..=5).map(stop).collect::<Vec<_>>().join(",")
}

fn image(canvas: &Canvas, caption: &str, crop: bool) -> Result<Markup, SheetError> {
    let data = format!("data:image/png;base64,{}", STANDARD.encode(canvas.png()?));
    Ok(html! {
        figure {
            img class=[crop.then_some("crop")] src=(data) width=(canvas.width()) height=(canvas.height()) alt=(caption);
            figcaption { (caption) }
        }
    })
}
