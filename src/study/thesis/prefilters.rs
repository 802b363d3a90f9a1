//! The figures about the prefilter: full EWA beside its approximation and beside none, held against the reference.

use std::fmt::Write as _;
use std::path::Path;

use super::planes::{self, Plate};
use super::{Thesis, alpha, write_sheet};
use crate::compare::{flip, gamma_rmse};
use crate::film::{Aov, Picture};
use crate::options::{BlurMode, Look, PixelFilter, Prefilter, RenderOptions};
use crate::reference::{self, ReferenceOptions};
use crate::renderer::Renderer;
use crate::scene::Scene;
use crate::study::StudyError;

/// Samples of a pixel of the reference.
const RAYS: u64 = 256;

/// What stands side by side: name, prefilter, positions in a pixel, and where they are. With [`PixelFilter::Point`] the
/// low-pass filter of full EWA has variance 1, as published; with [`PixelFilter::Box`] that of a pixel's square.
const CONTESTANTS: [(&str, Prefilter, u32, PixelFilter); 5] = [
    ("none", Prefilter::None, 1, PixelFilter::Box),
    ("none, 4 samples", Prefilter::None, 4, PixelFilter::Box),
    ("approx", Prefilter::Approx, 1, PixelFilter::Box),
    ("ewa", Prefilter::Ewa, 1, PixelFilter::Box),
    ("ewa, variance 1", Prefilter::Ewa, 1, PixelFilter::Point),
];

impl Thesis {
    /// Figures 4.9 and 4.10, and the checkerboards of Ren et al. (2002) and Zwicker et al. (2002).
    pub(super) fn prefilters(
        &self,
        renderer: &mut Renderer,
        directory: &Path,
        tell: &dyn Fn(&str),
    ) -> Result<String, StudyError> {
        let mut text = String::from(
            "\n## Prefilters\n\nFLIP and RMSE (display values) against the ray-traced reference (256 samples), box \
             filter, one sample a pixel where no other number is named:\n\n| figure | part |",
        );
        for (name, ..) in CONTESTANTS {
            let _ = write!(text, " {name} |");
        }
        text.push('\n');
        text += &"| --- ".repeat(2 + CONTESTANTS.len());
        text += "|\n";
        // Shown pixel for pixel: a smaller picture would be filtered.
        let size = self.size.map(|side| (side * 3 / 5).max(48));
        for plate in planes::plates(size, self.fewer as usize)? {
            tell(&format!("{}: {}, {}", plate.source, plate.about, plate.parts.join(", ")));
            self.plate(renderer, directory, &plate, &mut text)?;
        }
        tell("Wolf 4.10: single discs");
        self.discs(renderer, directory, &mut text)?;
        Ok(text)
    }

    /// All contestants and the reference.
    fn contest(&self, renderer: &mut Renderer, scene: &Scene) -> Result<Vec<(String, Picture)>, StudyError> {
        let mut pictures = Vec::new();
        for (name, prefilter, pixel_samples, filter) in CONTESTANTS {
            let options = self.options(BlurMode::Still { pixel_samples });
            let look = Look { filter, aovs: vec![Aov::Alpha], ..options.look };
            let options = RenderOptions { prefilter, look, ..options };
            pictures.push((name.to_owned(), renderer.render(scene, 0, &options)?.picture));
        }
        let options = ReferenceOptions {
            samples: RAYS,
            look: Look { shadows: false, aovs: vec![Aov::Alpha], ..Look::default() },
            ..ReferenceOptions::default()
        };
        let truth = reference::render(scene, 0, &options, None, &|_| {})?;
        pictures.push(("reference".to_owned(), truth.picture));
        Ok(pictures)
    }

    /// The picture and the errors of a scene.
    fn plate(
        &self,
        renderer: &mut Renderer,
        directory: &Path,
        plate: &Plate,
        text: &mut String,
    ) -> Result<(), StudyError> {
        let pictures = self.contest(renderer, &plate.scene)?;
        let last = pictures.len() - 1;
        let width = plate.scene.image.width / plate.parts.len() as u32;
        for (part, name) in plate.parts.iter().enumerate() {
            let columns = |picture: &Picture| columns(picture, part as u32 * width, width);
            let truth = columns(&pictures[last].1);
            let _ = write!(text, "| {} | {name} |", plate.source);
            for (_, picture) in &pictures[..last] {
                let picture = columns(picture);
                let _ = write!(text, " {:.4}, {:.4} |", flip::mean(&picture, &truth)?, gamma_rmse(&picture, &truth)?);
            }
            text.push('\n');
        }
        let heading = format!("As {}: {}, {}", plate.source, plate.about, plate.parts.join(", "));
        write_sheet(directory, &format!("figure-{}", plate.name), &heading, &pictures)
    }

    /// Figure 4.10: the kernel, the low-pass filter, and how they are combined.
    fn discs(&self, renderer: &mut Renderer, directory: &Path, text: &mut String) -> Result<(), StudyError> {
        let pictures = self.contest(renderer, &planes::discs()?)?;
        *text += "\n## Figure 4.10\n\nSingle discs: the sum of alpha over the disc's area, the mean of 20 places \
                  below the pixel, and in brackets the least and the greatest:\n\n| disc | half-axes, pixels |";
        for (name, _) in &pictures {
            let _ = write!(text, " {name} |");
        }
        text.push('\n');
        *text += &"| --- ".repeat(2 + pictures.len());
        *text += "|\n";
        for (row, (name, half)) in planes::HALF_AXES.iter().enumerate() {
            let _ = write!(text, "| {name} | {} x {} |", half[0], half[1]);
            for (_, picture) in &pictures {
                let [mean, least, most] = areas(picture, row, half[0] * half[1] * std::f64::consts::PI);
                let _ = write!(text, " {mean:.2} ({least:.2} to {most:.2}) |");
            }
            text.push('\n');
        }
        write_sheet(directory, "figure-4.10", "As Wolf 4.10: magnified, thin and minified discs", &pictures)
    }
}

/// The sums of alpha of a row of discs over their area: mean, least, greatest.
fn areas(picture: &Picture, row: usize, area: f64) -> [f64; 3] {
    let (width, space) = (picture.width as usize, planes::DISC_SPACE as usize);
    let mut sums = vec![0.0; width / space];
    let rows = alpha(picture).chunks(width).skip(row * space).take(space);
    for (x, value) in rows.flat_map(|line| line.iter().enumerate()) {
        if let Some(sum) = sums.get_mut(x / space) {
            *sum += f64::from(*value) / area;
        }
    }
    let mean = sums.iter().sum::<f64>() / sums.len().max(1) as f64;
    [mean, sums.iter().copied().fold(f64::INFINITY, f64::min), sums.iter().copied().fold(0.0, f64::max)]
}

/// Some columns of a picture, without its layers.
fn columns(picture: &Picture, from: u32, width: u32) -> Picture {
    let rows = picture.rgba.chunks(picture.width.max(1) as usize);
    let rgba = rows.flat_map(|row| row.iter().skip(from as usize).take(width as usize).copied()).collect();
    Picture { width, height: picture.height, rgba, layers: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::renderer::Device;

    fn small() -> (Thesis, Renderer) {
        (Thesis { size: [128, 96], repeats: 1, fewer: 1, memory: 1 << 30 }, Renderer::open(Device::Cpu).unwrap())
    }

    #[test]
    fn columns_are_cut_out() {
        let rgba = (0..12).map(|i| [i as f32; 4]).collect();
        let picture = Picture { width: 4, height: 3, rgba, layers: Vec::new() };
        let part = columns(&picture, 1, 2);
        assert_eq!(part.rgba.iter().map(|p| p[0]).collect::<Vec<_>>(), [1.0, 2.0, 5.0, 6.0, 9.0, 10.0]);
    }

    /// RMSE in the order of CONTESTANTS: .118, .030, .064, .018 and .076 (lattice); .082, .021, .058, .012 and .055 (at
    /// random).
    // Not deep: it holds the prefilters against each other.
    #[test]
    fn full_ewa_is_nearest_at_the_horizon() {
        let (thesis, mut renderer) = small();
        for random in [false, true] {
            let pictures = thesis.contest(&mut renderer, &planes::horizon([128, 96], 1, random).unwrap()).unwrap();
            let [none, four, approx, ewa, _] =
                [0, 1, 2, 3, 4].map(|i| gamma_rmse(&pictures[i].1, &pictures[5].1).unwrap());
            assert!(ewa < 0.25 * none && ewa < 0.8 * four && ewa < 0.4 * approx, "{none} {four} {approx} {ewa}");
        }
    }

    /// What full EWA adds at the rim of a disc it takes away inside; the approximation only adds. `ewa`: .996, 1.012,
    /// 1.054; with variance 1: .992, 1.002, 1.008; `approx`: .996, 1.385, 7.13.
    #[test]
    fn full_ewa_keeps_the_area_of_discs() {
        let (thesis, mut renderer) = small();
        let pictures = thesis.contest(&mut renderer, &planes::discs().unwrap()).unwrap();
        for (row, (name, half)) in planes::HALF_AXES.iter().enumerate() {
            let area = half[0] * half[1] * std::f64::consts::PI;
            let means = [0, 1, 2, 3, 4, 5].map(|i| areas(&pictures[i].1, row, area)[0]);
            assert!([means[3], means[4]].iter().all(|ewa| (0.85..1.15).contains(ewa)), "{name}: {means:?}");
            assert!((means[2] > 1.2) == (*name != "magnified"), "{name}: {means:?}");
            assert!((means[5] - 1.0).abs() < 0.02, "{name}: {means:?}");
        }
    }
}
