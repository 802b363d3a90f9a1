//! The pictures and numbers of Wolf (2008) made again: figures 3.1, 5.1, 5.2, 5.3, and table 5.1; and the figures about
//! the prefilter: 4.9, 4.10, and those of Ren et al. (2002) and Zwicker et al. (2002).
//!
//! The models are not the thesis' own, which are not public. They have as many surfels, and move as its captions say.

mod figures;
mod models;
mod planes;
mod prefilters;

use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use self::figures::{Figure, figures};
use super::StudyError;
use super::sheet::{self, Canvas, Layout, Panel};
use crate::compare::{flip, gamma_rmse};
use crate::film::{Aov, Picture};
use crate::options::{
    BlurMode, Detail, KernelShape, KernelWeight, Look, Normalise, Overlap, PixelFilter, Prefilter, RenderOptions,
    SweptKernel, TemporalAlpha,
};
use crate::renderer::Renderer;
use crate::scene::Scene;
use crate::time::Weight;

/// Time samples of the pictures that others are compared with.
const TRUTH: u32 = 256;
/// Columns of a panel.
const PANEL: u32 = 300;

/// What the study takes.
#[derive(Clone, Debug)]
pub struct Thesis {
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Timed renderings of each cell of table 5.1, after one that is not timed; the least counts.
    pub repeats: u32,
    /// Models have 1 of so many of the thesis' surfels, 1 to 1000.
    pub fewer: u32,
    /// Bytes that a frame and its models may take.
    pub memory: u64,
}

/// A mode, by the letter of its picture and its name in table 5.1.
type Cell = (char, u32, &'static str, BlurMode);

/// The five cells of a figure.
fn cells() -> [Cell; 5] {
    let published = |intervals| volumetric(intervals, SweptKernel::PUBLISHED);
    [
        ('a', 1, "2D splats", BlurMode::Still { pixel_samples: 1 }),
        ('b', 10, "2D splats", BlurMode::supersample(10)),
        ('c', 50, "2D splats", BlurMode::supersample(50)),
        ('d', 1, "volumetric", published(1)),
        ('e', 3, "volumetric", published(3)),
    ]
}

const fn volumetric(intervals: u32, swept: SweptKernel) -> BlurMode {
    BlurMode::Volumetric { intervals, pixel_samples: None, swept }
}

/// The published kernels with the strict footprint (Wolf 2008, eq. C.38) instead of the chord.
const LINE: SweptKernel = SweptKernel { weight: KernelWeight::Line, ..SweptKernel::PUBLISHED };

/// The published kernels, end to end instead of overlapping.
const END_TO_END: SweptKernel = SweptKernel { overlap: Overlap(0.5), ..SweptKernel::PUBLISHED };

impl Thesis {
    /// Makes all, writes the pictures into `directory`, and gives the tables in Markdown. `tell` hears what comes next.
    ///
    /// # Errors
    /// The renderer fails, or a picture cannot be written.
    pub fn run(&self, renderer: &mut Renderer, directory: &Path, tell: &dyn Fn(&str)) -> Result<String, StudyError> {
        let mut text = String::new();
        tell("figure 3.1");
        self.weights(renderer, directory, &mut text)?;
        let figures = figures(self.size, self.fewer as usize)?;
        let mut table = String::from(
            "\n## Table 5.1\n\n\
             | figure | cell | samples | kernels | surfels | seconds | frames/s | over (b) | \
             Wolf, frames/s | over (b) |\n\
             | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
        );
        let mut errors = String::from(
            "\n## Errors\n\nFLIP and RMSE (display values) against the mean of 256 time samples; the corrected \
             kernels, which have no low-pass disc, against samples without a prefilter:\n\n\
             | figure | (b) 10 | (c) 50 | (d) 1 | (e) 3 | line 1 | line 3 | corrected 1 | corrected 3 |\n\
             | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
        );
        for figure in &figures {
            tell(&format!("figure {}: {}", figure.name, figure.about));
            self.figure(renderer, directory, figure, &mut table, &mut errors)?;
        }
        text += &(table + &errors);
        tell("figure 5.2(e): the thin end of a tentacle");
        self.thin_part(renderer, directory, &mut text)?;
        tell("figure 5.3: alpha against density");
        self.densities(renderer, &mut text)?;
        text += &self.prefilters(renderer, directory, tell)?;
        Ok(text)
    }

    fn options(&self, mode: BlurMode) -> RenderOptions {
        RenderOptions {
            quality: mode.into(),
            prefilter: Prefilter::Approx,
            memory: self.memory,
            look: Look {
                // The thesis samples pixel centres, with the approximate prefilter (4.2.3).
                filter: PixelFilter::Point,
                shadows: false,
                ..Look::default()
            },
            detail: Detail::Full,
            ..RenderOptions::default()
        }
    }

    /// A picture as figures 5.1 to 5.3 are.
    fn render(&self, renderer: &mut Renderer, scene: &Scene, mode: BlurMode) -> Result<Picture, StudyError> {
        Ok(renderer.render(scene, 0, &self.options(mode))?.picture)
    }

    /// A picture with its alpha, for measurements of kernels: without a prefilter, which would widen them.
    fn bare(&self, renderer: &mut Renderer, scene: &Scene, mode: BlurMode) -> Result<Picture, StudyError> {
        let options = self.options(mode);
        let look = Look { aovs: vec![Aov::Alpha], ..options.look };
        let options = RenderOptions { prefilter: Prefilter::None, look, ..options };
        Ok(renderer.render(scene, 0, &options)?.picture)
    }

    /// Least seconds of a frame, and its picture.
    fn timed(&self, renderer: &mut Renderer, scene: &Scene, mode: BlurMode) -> Result<(f64, Picture), StudyError> {
        let options = self.options(mode);
        let mut picture = renderer.render(scene, 0, &options)?.picture;
        let mut least = f64::INFINITY;
        for _ in 0..self.repeats {
            let start = Instant::now();
            let rendered = renderer.render(scene, 0, &options)?;
            least = least.min(start.elapsed().as_secs_f64());
            picture = rendered.picture;
        }
        Ok((least, picture))
    }

    /// Figure 3.1: (b) even weight, (c) linear, (d) by its formula, and as it is called.
    fn weights(&self, renderer: &mut Renderer, directory: &Path, text: &mut String) -> Result<(), StudyError> {
        let weights = [
            ("(b) box", Weight::Box),
            ("(c) ramp", Weight::Ramp { centre: 1.0 }),
            ("(d) one-minus-exponential", Weight::OneMinusExponential { centre: 1.0 }),
            ("exponential, rate 3", Weight::Exponential { rate: 3.0, centre: 1.0 }),
        ];
        *text += "\n## Figure 3.1\n\nAlpha of a ball that falls, no prefilter, where its centre passes at t = 1/4, 1/2 \
                  and 3/4; in brackets the integral of a(t) while the ball covers:\n\n\
                  | weight | 1/4 | 1/2 | 3/4 |\n| --- | --- | --- | --- |\n";
        let mut pictures = Vec::new();
        for (name, weight) in weights {
            let scene = figures::fall(self.size, weight.clone())?;
            let picture = self.bare(renderer, &scene, BlurMode::supersample(TRUTH))?;
            let _ = write!(text, "| {name} |");
            for t in [0.25, 0.5, 0.75] {
                let [travel, radius] = figures::FALL;
                // The pixel whose centre is nearest; it sees the plane through the ball's centre, 4 away.
                let [width, height] = self.size.map(f64::from);
                let scale = 0.5 * height / libm::tan(0.5 * scene.camera.fovy) / 4.0;
                let row = (0.5 * height + (t - 0.5) * travel * scale).floor();
                let passes = ((row + 0.5 - 0.5 * height) / scale / travel + 0.5, radius / travel);
                let want = weight.integral((passes.0 - passes.1).max(0.0), (passes.0 + passes.1).min(1.0));
                let at = row as usize * self.size[0] as usize + (0.5 * width) as usize;
                let got = alpha(&picture).get(at).copied().unwrap_or(f32::NAN);
                let _ = write!(text, " {got:.3} ({want:.3}) |");
            }
            text.push('\n');
            pictures.push((name.to_owned(), picture));
        }
        write_sheet(directory, "figure-3.1", "A ball falls; the time weight says how its streak fades", &pictures)
    }

    /// The pictures and cells of a figure, and their errors.
    fn figure(
        &self,
        renderer: &mut Renderer,
        directory: &Path,
        figure: &Figure,
        table: &mut String,
        errors: &mut String,
    ) -> Result<(), StudyError> {
        let scene = &figure.scene;
        let surfels: usize = scene.objects.iter().map(|object| object.shape.elements()).sum();
        let mut made = Vec::new();
        for (letter, samples, kernels, mode) in cells() {
            let (seconds, picture) = self.timed(renderer, scene, mode)?;
            made.push((format!("({letter}) {samples} {kernels}"), seconds, picture));
        }
        for (i, (letter, samples, kernels, _)) in cells().into_iter().enumerate() {
            let (rate, published) = (1.0 / made[i].1, figure.published);
            let _ = writeln!(
                table,
                "| {} | ({letter}) | {samples} | {kernels} | {surfels} | {:.4} | {rate:.2} | {:.2} | {} | {:.2} |",
                figure.name,
                made[i].1,
                rate * made[1].1,
                published[i],
                published[i] / published[1],
            );
        }
        let truth = self.render(renderer, scene, BlurMode::supersample(TRUTH))?;
        let lines = [1, 3].map(|intervals| self.render(renderer, scene, volumetric(intervals, LINE)));
        // Only published kernels in motion have the low-pass disc. So the corrected ones are held against samples that
        // have none.
        let bare_truth = self.bare(renderer, scene, BlurMode::supersample(TRUTH))?;
        let corrected = [1, 3].map(|n| self.bare(renderer, scene, volumetric(n, SweptKernel::default())));
        let _ = write!(errors, "| {} |", figure.name);
        let mut add = |picture: &Picture, truth: &Picture| -> Result<(), StudyError> {
            let _ = write!(errors, " {:.4}, {:.4} |", flip::mean(picture, truth)?, gamma_rmse(picture, truth)?);
            Ok(())
        };
        for (_, _, picture) in &made[1..] {
            add(picture, &truth)?;
        }
        for picture in lines {
            add(&picture?, &truth)?;
        }
        for picture in corrected {
            add(&picture?, &bare_truth)?;
        }
        errors.push('\n');
        let mut pictures: Vec<_> = made.into_iter().map(|(title, _, picture)| (title, picture)).collect();
        pictures.push((format!("{TRUTH} 2D splats"), truth));
        let heading = format!("As figure {}: {}, {surfels} surfels", figure.name, figure.about);
        write_sheet(directory, &format!("figure-{}", figure.name), &heading, &pictures)
    }

    /// Figure 5.2(e): where kernels of neighbouring intervals do not overlap, thin parts vanish.
    fn thin_part(&self, renderer: &mut Renderer, directory: &Path, text: &mut String) -> Result<(), StudyError> {
        let scene = figures::thin_part(self.size, self.fewer as usize)?;
        let truth = self.bare(renderer, &scene, BlurMode::supersample(TRUTH))?;
        *text += "\n## Figure 5.2(e)\n\nThe thin end of a tentacle alone, three intervals, no prefilter: alpha over \
                  true alpha, at the pixels where the true one is above .02: the least, the lowest twentieth, the \
                  median, and the share of pixels that have less than half of their true alpha:\n\n\
                  | kernels | least | 5 % | median | vanished |\n| --- | --- | --- | --- | --- |\n";
        let kernels = [
            ("published, overlap .5", END_TO_END),
            ("published (overlap 1)", SweptKernel::PUBLISHED),
            ("line, overlap .5", SweptKernel { overlap: END_TO_END.overlap, ..LINE }),
            ("line, overlap 1", LINE),
            ("corrected", SweptKernel::default()),
        ];
        let mut pictures = Vec::new();
        for (name, kernel) in kernels {
            let picture = self.bare(renderer, &scene, volumetric(3, kernel))?;
            let seen = alpha(&picture).iter().zip(alpha(&truth)).filter(|(_, want)| **want > 0.02);
            let mut ratios: Vec<f32> = seen.map(|(got, want)| got / want).collect();
            ratios.sort_by(f32::total_cmp);
            let at = |part: usize| ratios.get(part * ratios.len() / 20).copied().unwrap_or(f32::NAN);
            let vanished = ratios.partition_point(|&ratio| ratio < 0.5) as f64 / ratios.len().max(1) as f64;
            let _ =
                writeln!(text, "| {name} | {:.2} | {:.2} | {:.2} | {:.1} % |", at(0), at(1), at(10), 100.0 * vanished);
            pictures.push((name.to_owned(), picture));
        }
        pictures.push((format!("{TRUTH} 2D splats"), truth));
        write_sheet(directory, "figure-5.2e", "The thin end of a tentacle of figure 5.2, three intervals", &pictures)
    }

    /// Figure 5.3: a sum of weights is no alpha where kernels are dense.
    fn densities(&self, renderer: &mut Renderer, text: &mut String) -> Result<(), StudyError> {
        *text += "\n## Figure 5.3\n\nThe shell alone, three intervals, no prefilter: mean alpha over mean \
                  true alpha where the true one is .05 to .95, by discs over each point of its surface:\n\n\
                  | discs | published | line | ellipsoid, sum | corrected |\n| --- | --- | --- | --- | --- |\n";
        let summed = SweptKernel {
            shape: KernelShape::Ellipsoid,
            alpha: TemporalAlpha::Sum,
            normalise: Normalise::Once,
            ..SweptKernel::default()
        };
        for discs in [1.0, 2.0, 4.0, 8.0, 16.0] {
            let scene = figures::shell(self.size, self.fewer as usize, discs)?;
            let truth = self.bare(renderer, &scene, BlurMode::supersample(TRUTH))?;
            let _ = write!(text, "| {discs} |");
            for kernel in [SweptKernel::PUBLISHED, LINE, summed, SweptKernel::default()] {
                let picture = self.bare(renderer, &scene, volumetric(3, kernel))?;
                let partly = alpha(&picture).iter().zip(alpha(&truth)).filter(|(_, want)| (0.05..0.95).contains(*want));
                let sums =
                    partly.fold([0.0; 2], |sums, (got, want)| [sums[0] + f64::from(*got), sums[1] + f64::from(*want)]);
                let _ = write!(text, " {:.2} |", sums[0] / sums[1]);
            }
            text.push('\n');
        }
        Ok(())
    }
}

/// The alpha of a picture that was rendered with it.
fn alpha(picture: &Picture) -> &[f32] {
    picture.layers.first().map_or(&[], |layer| &layer.planes[0])
}

/// Writes pictures side by side as `NAME.png`.
fn write_sheet(directory: &Path, name: &str, heading: &str, pictures: &[(String, Picture)]) -> Result<(), StudyError> {
    let panels: Vec<Panel<'_>> =
        pictures.iter().map(|(title, picture)| Panel { title: title.clone(), lines: Vec::new(), picture }).collect();
    let of: Vec<&Picture> = pictures.iter().map(|(_, picture)| picture).collect();
    let crop = sheet::most_different(&of, 60, 45)?;
    let layout = Layout { panel: PANEL, columns: 6 };
    let canvas: Canvas = sheet::sheet(heading, &panels, crop, layout)?;
    let path = directory.join(format!("{name}.png"));
    crate::files::replace(&path, &canvas.png()?).map_err(|source| StudyError::Write { path, source })
}
