//! How motion becomes blur: `--mode` and the options that say parts of a mode.

use std::fmt;

use anyhow::bail;
use clap::Args;
use splatblur::film::Aov;
use splatblur::options::{
    self, ErrorTarget, Interleave, KernelShape, KernelWeight, Lattice, Look, ModeName, ModeParts, Normalise,
    OptionError, Overlap, Quality, RenderOptions, SourceSamples, TemporalAlpha, Times,
};
use splatblur::study::Choices;

use crate::cli::common::{Sampling, Splatting, Surfaces};
use crate::cli::values::one_of;

/// A mode, whole or in parts.
#[derive(Debug, Args)]
pub(in crate::cli) struct Blur {
    /// How motion becomes blur, as in still, supersample:32+interleave=2, auto:0.01+samples-max=64 or
    /// volumetric:3+published (`splatblur render --help` lists all). What it leaves open the options below may say
    /// [default: auto; supersample with
    /// --samples, --times or, but in `dataset`, --interleave alone].
    #[arg(long, value_name = "MODE", value_parser = mode, help_heading = "Blur")]
    mode: Option<Mode>,
    /// Mode auto: the largest error of any part of the image, as root mean square of display values: draft (0.05), good
    /// (0.025), final (0.0125), or a number [default: good].
    #[arg(
        long,
        value_name = "E",
        allow_hyphen_values = true,
        value_parser = ErrorTarget::parse_error,
        help_heading = "Blur"
    )]
    error: Option<f64>,
    /// Mode auto: most time samples of a pixel [default: 256].
    #[arg(
        long,
        value_name = "N",
        allow_hyphen_values = true,
        value_parser = options::samples_max,
        help_heading = "Blur"
    )]
    samples_max: Option<u32>,
    /// Time samples of mode supersample [default: 32], or of each bucket [default: 4]; intervals of mode volumetric
    /// [default: 10].
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = options::count, help_heading = "Blur")]
    samples: Option<u32>,
    /// Buckets of mode bucket: intervals with one visibility test and one shading each [default: 8].
    #[arg(long, value_name = "B", allow_hyphen_values = true, value_parser = options::count, help_heading = "Blur")]
    buckets: Option<u32>,
    /// Interleaved sampling: each pixel of a lattice of S x S (none, 2 or 4) has times of its own. auto: mode auto
    /// finds the lattice [default: none; in mode auto of `render` auto].
    #[arg(long, value_name = "S", allow_hyphen_values = true, help_heading = "Blur")]
    interleave: Option<Lattice>,
    /// Modes supersample and bucket: where times lie within the shutter. even: the middles of equal strata; stratified:
    /// a random time in each of as many equal shares of the exposure; random: independent random times. --seed chooses
    /// them [default: even].
    #[arg(long, value_name = "TIMES", value_parser = one_of::<Times>(Times::WORDS), help_heading = "Blur")]
    times: Option<Times>,
    /// Sub-pixel positions of mode still [default: 16], and of static objects in mode auto at the error `good`
    /// [default: 8]; else those of all time samples or buckets [default: one for each; fewer where objects at rest fill
    /// a third of the image], or intervals [default: the pixel's middle]. Fewer are shared out; what is at
    /// rest is splatted once at each. With more, each time sample is rendered at several of them.
    #[arg(long, value_name = "P", allow_hyphen_values = true, value_parser = options::count, help_heading = "Blur")]
    pixel_samples: Option<u32>,
    /// Mode volumetric: what a kernel sweeps over an interval. tube: the 2D kernel moved along, with the same weight at
    /// all times; ellipsoid: 2D Gaussian times a Gaussian along the motion [default: tube].
    #[arg(long, value_name = "KERNEL", value_parser = one_of::<KernelShape>(KernelShape::WORDS), help_heading = "Blur")]
    kernel: Option<KernelShape>,
    /// Mode volumetric: a kernel's weight on a ray. integral: over time; chord: by the length of the ray within the
    /// kernel; line: the integral along the ray within the kernel. The last two need --kernel ellipsoid [default:
    /// integral].
    #[arg(
        long,
        value_name = "WEIGHT",
        value_parser = one_of::<KernelWeight>(KernelWeight::WORDS),
        help_heading = "Blur"
    )]
    kernel_weight: Option<KernelWeight>,
    /// Mode volumetric, weights chord and line: places within a kernel, on a ray, whose visibility is tested, 1 to 64
    /// [default: 1].
    #[arg(long, value_name = "N", allow_hyphen_values = true, help_heading = "Blur")]
    source_samples: Option<SourceSamples>,
    /// Mode volumetric: half-axis of a kernel along its motion, in spacings of the intervals, 0.1 to 4. At 0.5 kernels
    /// of neighbouring intervals meet end to end; at 1 each reaches the middles of its neighbours [default: 0.5].
    #[arg(long, value_name = "S", allow_hyphen_values = true, help_heading = "Blur")]
    overlap: Option<Overlap>,
    /// Mode volumetric: where the coverage of a moving surface comes from. union: the times at which any kernel covers
    /// the pixel; sum: the sum of all weights, at most 1 [default: union].
    #[arg(
        long,
        value_name = "ALPHA",
        value_parser = one_of::<TemporalAlpha>(TemporalAlpha::WORDS),
        help_heading = "Blur"
    )]
    alpha: Option<TemporalAlpha>,
    /// Mode volumetric: when sums of colours are divided by sums of weights: for each interval, or once at the end
    /// [default: interval].
    #[arg(long, value_name = "WHEN", value_parser = one_of::<Normalise>(Normalise::WORDS), help_heading = "Blur")]
    normalise: Option<Normalise>,
    /// Mode volumetric as published by Wolf (2008): ellipsoid, chord, overlap 1, sum, once.
    #[arg(
        long,
        conflicts_with_all = ["kernel", "kernel_weight", "overlap", "alpha", "normalise"],
        help_heading = "Blur"
    )]
    published: bool,
}

/// `--mode`: what it says, and how it says it.
#[derive(Clone, Debug)]
struct Mode {
    text: String,
    parts: ModeParts,
    choices: Choices,
}

fn mode(text: &str) -> Result<Mode, String> {
    // What modes of studies may say, and modes of `render` may not.
    if let Some((_, backend)) = text.split_once('@') {
        return Err(format!("a mode of `render` names no backend; use --backend {backend}"));
    }
    if text.starts_with("reference") {
        return Err("references are made by `splatblur reference`".to_owned());
    }
    let (choices, own) = Choices::split(text).map_err(|error| error.to_string())?;
    let parts = own.parse().map_err(|error: OptionError| error.to_string())?;
    Ok(Mode { text: text.to_owned(), parts, choices })
}

impl Blur {
    /// How to splat, by these and all other options.
    pub(in crate::cli) fn options(
        &self,
        surfaces: &Surfaces,
        sampling: &Sampling,
        splatting: &Splatting,
        aovs: Vec<Aov>,
    ) -> anyhow::Result<RenderOptions> {
        let mut choices = self.mode.as_ref().map_or(Choices::default(), |mode| mode.choices);
        self.put(&mut choices.filter, sampling.filter, "--filter")?;
        self.put(&mut choices.prefilter, splatting.prefilter, "--prefilter")?;
        self.put(&mut choices.detail, splatting.detail, "--detail")?;
        let look = surfaces.look(sampling, aovs);
        Ok(RenderOptions {
            quality: self.quality()?,
            prefilter: choices.prefilter.unwrap_or_default(),
            detail: choices.detail.unwrap_or_default(),
            look: Look { filter: choices.filter.unwrap_or_default(), ..look },
            ..RenderOptions::default()
        })
    }

    /// The mode that all options together say.
    fn quality(&self) -> anyhow::Result<Quality> {
        let lone = self.interleave.is_some_and(|lattice| lattice != Lattice::Auto) && !self.says_auto();
        let name = if lone { ModeName::Supersample } else { self.name() };
        let mut parts = self.mode.as_ref().map_or(ModeParts::new(name), |mode| mode.parts);
        self.check_parts(parts.name)?;
        self.put(&mut parts.error, self.error, "--error")?;
        self.put(&mut parts.samples_max, self.samples_max, "--samples-max")?;
        self.put(&mut parts.samples, self.samples, "--samples")?;
        self.put(&mut parts.buckets, self.buckets, "--buckets")?;
        self.put(&mut parts.interleave, self.interleave, "--interleave")?;
        self.put(&mut parts.times, self.times, "--times")?;
        self.put(&mut parts.pixel_samples, self.pixel_samples, "--pixel-samples")?;
        self.put(&mut parts.kernel, self.kernel, "--kernel")?;
        self.put(&mut parts.kernel_weight, self.kernel_weight, "--kernel-weight")?;
        self.put(&mut parts.source_samples, self.source_samples, "--source-samples")?;
        self.put(&mut parts.overlap, self.overlap, "--overlap")?;
        self.put(&mut parts.alpha, self.alpha, "--alpha")?;
        self.put(&mut parts.normalise, self.normalise, "--normalise")?;
        parts.published |= self.published;
        parts.quality().map_err(|error| anyhow::anyhow!(self.explain(&error)))
    }

    /// The mode, where `--interleave` alone says none.
    fn name(&self) -> ModeName {
        let counted = self.samples.is_some() || self.times.is_some();
        let name = if counted { ModeName::Supersample } else { ModeName::Auto };
        self.mode.as_ref().map_or(name, |mode| mode.parts.name)
    }

    /// Most samples of mode auto in a studio, unless somebody says how good the picture is to be. The penumbra of a
    /// large lamp takes 144 for the error that mode auto has else, seven times as long, and looks the same.
    const IN_STUDIO: u32 = 32;

    /// Spares the samples of a picture in a studio.
    pub(in crate::cli) fn spare(&self, quality: &mut Quality) {
        if let Quality::Error(target) = quality
            && !self.says_auto()
        {
            target.samples_max = Self::IN_STUDIO;
        }
    }

    /// Does an option say that the mode is auto?
    fn says_auto(&self) -> bool {
        self.mode.is_some() || self.error.is_some() || self.samples_max.is_some()
    }

    /// The options that [`Self::quality`] needs beside those that are given, so that mode auto weaves no lattice into
    /// pictures unless one is asked for, and `--interleave` alone means mode auto.
    pub(in crate::cli) fn without_lattice(&self) -> Vec<String> {
        let mut needed = Vec::new();
        if self.name() != ModeName::Auto {
            return needed;
        }
        if !self.says_auto() {
            needed.push(format!("--mode={}", ModeName::Auto));
        }
        let said = self.interleave.or(self.mode.as_ref().and_then(|mode| mode.parts.interleave));
        if said.is_none() {
            needed.push(format!("--interleave={}", Lattice::Fixed(Interleave::None)));
        }
        needed
    }

    /// Lets an option say what the mode leaves open.
    fn put<T>(&self, part: &mut Option<T>, given: Option<T>, option: &str) -> anyhow::Result<()>
    where
        T: Copy + PartialEq + fmt::Display,
    {
        if let (Some(said), Some(given), Some(mode)) = (*part, given, &self.mode)
            && said != given
        {
            bail!("{option} {given} contradicts --mode {}", mode.text);
        }
        *part = given.or(*part);
        Ok(())
    }

    /// Refuses options that the mode does not have.
    fn check_parts(&self, mode: ModeName) -> anyhow::Result<()> {
        let given = [
            ("error", self.error.is_some()),
            ("samples-max", self.samples_max.is_some()),
            ("buckets", self.buckets.is_some()),
            ("kernel", self.kernel.is_some()),
            ("kernel-weight", self.kernel_weight.is_some()),
            ("source-samples", self.source_samples.is_some()),
            ("overlap", self.overlap.is_some()),
            ("alpha", self.alpha.is_some()),
            ("normalise", self.normalise.is_some()),
            ("published", self.published),
            ("samples", self.samples.is_some()),
            ("interleave", self.interleave.is_some()),
            ("times", self.times.is_some()),
        ];
        let Some((part, _)) = given.into_iter().find(|(part, given)| *given && !mode.parts().contains(part)) else {
            return Ok(());
        };
        let owner = match part {
            "error" | "samples-max" => ModeName::Auto,
            "buckets" => ModeName::Bucket,
            _ => ModeName::Volumetric,
        };
        bail!(match (mode, part) {
            (ModeName::Auto, "samples") => "--mode auto chooses the samples; use --samples-max, or --mode supersample",
            (ModeName::Auto, "times") => "--mode auto chooses the times; --times is for --mode supersample and bucket",
            (_, "times") => "--times is for modes with time samples: supersample and bucket",
            (ModeName::Volumetric, "interleave") =>
                "--interleave is not for --mode volumetric, which has no time samples",
            (ModeName::Still, "samples") =>
                "--samples counts time samples, which --mode still has not; use --pixel-samples",
            (ModeName::Still, "interleave") => "--interleave is for modes with time samples, not for --mode still",
            _ => bail!("--{part} is for --mode {owner}"),
        })
    }

    /// Why the parts do not make a mode, in the words of the command line.
    fn explain(&self, error: &OptionError) -> String {
        let text = self.mode.as_ref().map_or("", |mode| &mode.text);
        if let Some(mode) = &self.mode
            && mode.parts.quality().as_ref() == Err(error)
        {
            return format!("--mode {text}: {error}");
        }
        match error {
            OptionError::Published { .. } if self.published => format!("--published contradicts --mode {text}"),
            OptionError::Published { option } => format!("--{option} contradicts --mode {text}"),
            OptionError::OfEllipsoids { weight } => {
                format!("--kernel-weight {weight} is of ellipsoids: it needs --kernel ellipsoid")
            }
            other => other.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use splatblur::options::{Detail, PixelFilter, Prefilter};

    use super::*;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        blur: Blur,
    }

    fn quality(arguments: &str) -> anyhow::Result<Quality> {
        let arguments = std::iter::once("program").chain(arguments.split_whitespace());
        Program::try_parse_from(arguments)?.blur.quality()
    }

    /// The whole form, the parts, and both together say the same.
    #[test]
    fn modes_are_said_in_several_ways() {
        for (arguments, mode) in [
            ("", "auto:0.025"),
            ("--samples 8", "supersample:8"),
            ("--interleave 2", "supersample:32+interleave=2"),
            ("--times random", "supersample:32+times=random"),
            ("--mode bucket:4x2 --times stratified", "bucket:4x2+times=stratified"),
            ("--mode supersample:32+interleave=2", "supersample:32+interleave=2"),
            ("--mode supersample:32 --interleave 2 --samples 32", "supersample:32+interleave=2"),
            ("--mode auto:0.01+samples-max=64", "auto:0.01+samples-max=64"),
            ("--mode auto:good --error 0.025 --pixel-samples 4", "auto:0.025+pixel-samples=4"),
            ("--error draft", "auto:0.05"),
            ("--mode still --pixel-samples 4", "still:4"),
            ("--mode bucket --buckets 3", "bucket:3x4"),
            ("--mode volumetric:3+published", "volumetric:3+published"),
            ("--mode volumetric:3 --published --source-samples 4", "volumetric:3+published+source-samples=4"),
            ("--interleave none", "supersample:32"),
            ("--interleave auto", "auto:0.025"),
            ("--error draft --interleave none", "auto:0.05+interleave=none"),
            ("--samples-max 64 --interleave 2", "auto:0.025+samples-max=64+interleave=2"),
            ("--mode auto --interleave 4", "auto:0.025+interleave=4"),
            ("--mode auto+interleave=none --interleave 1", "auto:0.025+interleave=none"),
            ("--mode supersample:8 --interleave none", "supersample:8"),
            ("--mode volumetric --overlap 1", "volumetric:10+overlap=1"),
            ("--mode volumetric+chord --kernel ellipsoid", "volumetric:10+kernel=ellipsoid+kernel-weight=chord"),
        ] {
            assert_eq!(quality(arguments).unwrap().to_string(), mode, "{arguments}");
        }
    }

    /// Filters and detail are said in the mode or beside it, not in two ways.
    #[test]
    fn a_mode_has_filters_and_detail() {
        #[derive(Parser)]
        struct All {
            #[command(flatten)]
            blur: Blur,
            #[command(flatten)]
            surfaces: Surfaces,
            #[command(flatten)]
            sampling: Sampling,
            #[command(flatten)]
            splatting: Splatting,
        }
        let options = |arguments: &str| {
            let arguments = std::iter::once("program").chain(arguments.split_whitespace());
            let All { blur, surfaces, sampling, splatting } = All::try_parse_from(arguments)?;
            blur.options(&surfaces, &sampling, &splatting, Vec::new())
        };
        let same = options("--mode still:4 --detail full --prefilter ewa --filter point").unwrap();
        assert_eq!((same.detail, same.prefilter), (Detail::Full, Prefilter::Ewa));
        assert_eq!(same.look.filter, PixelFilter::Point);
        for arguments in [
            "--mode still:4+detail=full+prefilter=ewa+filter=point",
            "--mode still:4+prefilter=ewa --detail full --filter point --prefilter ewa",
        ] {
            assert_eq!(options(arguments).unwrap(), same, "{arguments}");
        }
        assert_eq!(options("").unwrap().detail, Detail::Auto);
        let contradicts = options("--mode auto:good+detail=full --detail good").unwrap_err().to_string();
        assert_eq!(contradicts, "--detail good contradicts --mode auto:good+detail=full");
        assert!(options("--mode auto+detail=fine").is_err() && options("--mode auto+detail=full+detail=full").is_err());
    }

    /// In pictures of a dataset, mode auto weaves a lattice only where one is asked for.
    #[test]
    fn no_lattice_but_one_that_is_asked_for() {
        for (arguments, needed, mode) in [
            ("", "--mode=auto --interleave=none", "auto:0.025+interleave=none"),
            ("--error draft", "--interleave=none", "auto:0.05+interleave=none"),
            ("--mode auto:0.01", "--interleave=none", "auto:0.01+interleave=none"),
            ("--pixel-samples 4", "--mode=auto --interleave=none", "auto:0.025+pixel-samples=4+interleave=none"),
            ("--interleave 2", "--mode=auto", "auto:0.025+interleave=2"),
            ("--interleave auto", "--mode=auto", "auto:0.025"),
            ("--error draft --interleave auto", "", "auto:0.05"),
            ("--mode auto+interleave=4", "", "auto:0.025+interleave=4"),
            ("--samples 8 --interleave 2", "", "supersample:8+interleave=2"),
            ("--mode supersample:8", "", "supersample:8"),
        ] {
            let line: Vec<&str> = std::iter::once("program").chain(arguments.split_whitespace()).collect();
            let found = Program::try_parse_from(&line).unwrap().blur.without_lattice();
            assert_eq!(found.join(" "), needed, "{arguments}");
            assert_eq!(quality(&format!("{arguments} {needed}")).unwrap().to_string(), mode, "{arguments}");
        }
    }

    #[test]
    fn contradictions_name_both_sides() {
        for (arguments, message) in [
            ("--mode supersample:32 --samples 16", "--samples 16 contradicts --mode supersample:32"),
            ("--mode still:4 --pixel-samples 8", "--pixel-samples 8 contradicts --mode still:4"),
            ("--mode auto:good --error 0.05", "--error 0.05 contradicts --mode auto:good"),
            ("--mode bucket:8x4 --buckets 4", "--buckets 4 contradicts --mode bucket:8x4"),
            ("--mode supersample+interleave=2 --interleave 4", "--interleave 4 contradicts"),
            ("--mode volumetric+published --alpha union", "--alpha contradicts --mode volumetric+published"),
            ("--mode volumetric+ellipsoid --published", "--published contradicts --mode volumetric+ellipsoid"),
            ("--mode volumetric+published --overlap 1", "--overlap contradicts --mode volumetric+published"),
            ("--mode volumetric+overlap=2 --overlap 1", "--overlap 1 contradicts --mode volumetric+overlap=2"),
            ("--mode auto+interleave=none --interleave 2", "--interleave 2 contradicts --mode auto+interleave=none"),
            ("--samples 8 --interleave auto", "option `interleave`: expected none, 1, 2 or 4, found `auto`"),
            ("--mode bucket --interleave auto", "option `interleave`: expected none, 1, 2 or 4, found `auto`"),
            ("--mode still --interleave auto", "--interleave is for modes with time samples"),
            ("--error draft --samples 8", "--error is for --mode auto"),
            ("--mode auto --times random", "--mode auto chooses the times"),
            ("--mode still --times random", "--times is for modes with time samples"),
            ("--mode volumetric --times random", "--times is for modes with time samples"),
            ("--mode supersample+times=even --times random", "--times random contradicts"),
            ("--mode supersample --overlap 1", "--overlap is for --mode volumetric"),
            ("--mode volumetric+published+once", "--mode volumetric+published+once: `published` says all"),
            ("--mode volumetric+chord", "--mode volumetric+chord: kernel-weight=chord is of ellipsoids"),
            ("--mode volumetric --kernel-weight chord", "it needs --kernel ellipsoid"),
            ("--mode volumetric --kernel-weight line", "--kernel-weight line is of ellipsoids: it needs --kernel"),
            ("--mode supersample:8 --buckets 4", "--buckets is for --mode bucket"),
            ("--mode bucket:6000x6000", "--mode bucket:6000x6000: 6000 buckets of 6000 samples"),
            ("--mode swept", "there is no mode `swept` (there are: auto, still, supersample"),
            ("--mode supersample:8@cpu", "use --backend cpu"),
            ("--mode reference:16", "`splatblur reference`"),
        ] {
            let error = quality(arguments).unwrap_err().to_string();
            assert!(error.contains(message), "{arguments}: {error}");
        }
    }
}
