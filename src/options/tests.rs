use proptest::prelude::*;

use super::*;
use crate::film::Aov;
use crate::reference::Meshes;
use crate::time::Weight;

fn quality(text: &str) -> Quality {
    text.parse().unwrap()
}

#[test]
fn modes_are_read() {
    assert_eq!(quality("still"), BlurMode::Still { pixel_samples: 16 }.into());
    let interleave = Interleave::None;
    assert_eq!(quality("supersample"), BlurMode::supersample(32).into());
    assert_eq!(quality(" supersample:8+interleave=2 "), BlurMode::interleaved(8, Interleave::Two).into());
    let bucket = |pixel_samples| {
        Quality::Mode(BlurMode::Bucket { buckets: 8, samples: 4, pixel_samples, interleave, times: Times::Even })
    };
    assert_eq!(quality("bucket"), bucket(None));
    assert_eq!(quality("bucket:8x4"), bucket(None));
    assert_eq!(quality("bucket:8x4+pixel-samples=12"), bucket(Some(12)));
    let volumetric = |swept| Quality::Mode(BlurMode::Volumetric { intervals: 3, pixel_samples: None, swept });
    assert_eq!(quality("volumetric:3"), volumetric(SweptKernel::default()));
    assert_eq!(quality("volumetric:3+published"), volumetric(SweptKernel::PUBLISHED));
    let four = SweptKernel { source_samples: SourceSamples(4), ..SweptKernel::PUBLISHED };
    assert_eq!(quality("volumetric:3+source-samples=4+published"), volumetric(four));
    let kernel = SweptKernel {
        shape: KernelShape::Ellipsoid,
        alpha: TemporalAlpha::Sum,
        normalise: Normalise::Once,
        ..SweptKernel::default()
    };
    assert_eq!(quality("volumetric:3+ellipsoid+once+alpha=sum"), volumetric(kernel));
    assert_eq!(quality("volumetric:3+kernel=ellipsoid+normalise=once+sum"), volumetric(kernel));
    assert_eq!(quality("auto"), Quality::default());
    let target = ErrorTarget { error: ErrorTarget::DRAFT, samples_max: 64, pixel_samples: 4, ..ErrorTarget::default() };
    assert_eq!(quality("auto:draft+samples-max=64+pixel-samples=4"), target.into());
    for (word, interleave) in [
        ("auto", Lattice::Auto),
        ("none", Lattice::Fixed(Interleave::None)),
        ("1", Lattice::Fixed(Interleave::None)),
        ("2", Lattice::Fixed(Interleave::Two)),
        ("4", Lattice::Fixed(Interleave::Four)),
    ] {
        let target = ErrorTarget { interleave, ..ErrorTarget::default() };
        assert_eq!(quality(&format!("auto+interleave={word}")), target.into());
    }
    assert_eq!("0.05+samples-max=64+pixel-samples=4".parse(), Ok(target));
    assert_eq!(
        "bucket:8x4".parse(),
        Ok(BlurMode::Bucket { buckets: 8, samples: 4, pixel_samples: None, interleave, times: Times::Even })
    );
    assert_eq!("+kernel=ellipsoid+once+sum".parse(), Ok(kernel));
    assert_eq!("".parse(), Ok(SweptKernel::default()));
}

#[test]
fn equal_modes_are_written_alike() {
    for (text, canonical) in [
        ("supersample", "supersample:32"),
        ("supersample:8+interleave=1", "supersample:8"),
        ("supersample:8+interleave=none", "supersample:8"),
        ("auto+interleave=auto", "auto:0.025"),
        ("auto+interleave=1", "auto:0.025+interleave=none"),
        ("supersample:8+pixel-samples=8", "supersample:8+pixel-samples=8"),
        ("volumetric:3+sum+pixel-samples=2", "volumetric:3+pixel-samples=2+alpha=sum"),
        ("volumetric:3+ellipsoid+chord+sum+once+overlap=1", "volumetric:3+published"),
        (
            "volumetric:3+ellipsoid+chord+sum+once",
            "volumetric:3+kernel=ellipsoid+kernel-weight=chord+alpha=sum+normalise=once",
        ),
        ("volumetric:3+line+ellipsoid", "volumetric:3+kernel=ellipsoid+kernel-weight=line"),
        ("volumetric:3+overlap=.50", "volumetric:3"),
        ("supersample:8+interleave=2+pixel-samples=4", "supersample:8+pixel-samples=4+interleave=2"),
        ("bucket:8x4+pixel-samples=8", "bucket:8x4+pixel-samples=8"),
        ("supersample:8+times=even", "supersample:8"),
        ("bucket:8x4+times=random+interleave=2", "bucket:8x4+interleave=2+times=random"),
        ("auto:final+samples-max=256", "auto:0.0125"),
    ] {
        assert_eq!(quality(text).to_string(), canonical);
    }
}

#[test]
fn mistakes_are_explained() {
    for (text, hint) in [
        ("", "there are: auto, still, supersample, bucket, volumetric"),
        ("super:8", "there is no mode `super`"),
        ("supersample:0", "1 to 65536, found `0`"),
        ("supersample:", "1 to 65536"),
        ("supersample:8x4", "1 to 65536"),
        ("supersample:8+interleave", "needs a value"),
        ("supersample:8+interleave=3", "option `interleave`: expected none, 1, 2 or 4, found `3`"),
        ("supersample:8+interleave=2+interleave=2", "twice"),
        ("supersample:8+once", "it takes: interleave, times, pixel-samples"),
        ("supersample:8+pixel-samples=0", "1 to 65536"),
        ("supersample:8+", "has no option ``"),
        ("still:4+interleave=2", "it takes: nothing"),
        ("bucket:8", "BUCKETSxSAMPLES"),
        ("bucket:8x4x2", "1 to 65536"),
        ("bucket:65536x65536", "at most 65536 in all"),
        ("volumetric:3+published+once", "it cannot stand beside `normalise`"),
        ("volumetric:3+published+overlap=1", "it cannot stand beside `overlap`"),
        ("volumetric:3+overlap=0", "option `overlap`: expected a number from 0.1 to 4, found `0`"),
        ("volumetric:3+overlap=nan", "from 0.1 to 4"),
        ("volumetric:3+overlap=4.1", "from 0.1 to 4"),
        ("volumetric:3+published=1", "takes no value, found `1`"),
        ("volumetric:3+kernel=ball", "there are: tube, ellipsoid"),
        ("volumetric:3+kernel=tube+ellipsoid", "twice"),
        ("volumetric:3+chord", "kernel-weight=chord is of ellipsoids: it needs kernel=ellipsoid"),
        ("volumetric:3+line", "kernel-weight=line is of ellipsoids"),
        ("volumetric:3+tube", "it takes: "),
        ("volumetric:3+alpha", "needs a value"),
        ("volumetric:3+source-samples=65", "1 to 64"),
        ("volumetric:3+interleave=2", "has no option"),
        ("auto:0", "draft, good, final"),
        ("auto:best", "draft, good, final"),
        ("auto:nan", "draft, good, final"),
        ("auto:0.1+samples-max=3", "4 to 65536"),
        ("auto:0.1+white=0.5", "1 to 65504"),
        ("auto:0.1+white=NaN", "1 to 65504"),
        ("supersample:8+times=halton", "`halton` is no choice of times (there are: even, stratified"),
        ("volumetric:3+times=random", "has no option `times`"),
        (
            "auto:0.1+times=random",
            "mode auto has no option `times` (it takes: samples-max, pixel-samples, interleave, white)",
        ),
        ("auto:0.1+interleave=3", "option `interleave`: expected none, auto, 2 or 4, found `3`"),
        ("supersample:8+interleave=auto", "option `interleave`: expected none, 1, 2 or 4, found `auto`"),
    ] {
        let error = text.parse::<Quality>().unwrap_err().to_string();
        assert!(error.contains(hint), "{text}: {error}");
    }
    let known = "auto".parse::<BlurMode>().unwrap_err().to_string();
    assert!(known.ends_with("(there are: still, supersample, bucket, volumetric)"), "{known}");
    assert!("kernel=ellipsoid".parse::<SweptKernel>().is_err() && "+samples=3".parse::<SweptKernel>().is_err());
    assert!("".parse::<ErrorTarget>().is_err());
}

#[test]
fn parts_from_elsewhere_are_checked() {
    let mut parts: ModeParts = "supersample:8".parse().unwrap();
    assert_eq!(parts.said(), ["samples"]);
    parts.interleave = Some(Lattice::Fixed(Interleave::Two));
    assert_eq!(parts.quality(), Ok(BlurMode::interleaved(8, Interleave::Two).into()));
    parts.interleave = Some(Lattice::Auto);
    let error = parts.quality().unwrap_err().to_string();
    assert_eq!(error, "option `interleave`: expected none, 1, 2 or 4, found `auto`");
    parts.interleave = None;
    parts.buckets = Some(3);
    let error = parts.quality().unwrap_err().to_string();
    assert!(error.contains("supersample has no option `buckets` (it takes: samples, interleave"), "{error}");
}

#[test]
fn widths_of_pixel_filters_have_a_range() {
    assert_eq!("gaussian".parse(), Ok(PixelFilter::Gaussian { sigma: 1.0 }));
    for text in ["gaussian:0.2", "gaussian:4.1", "gaussian:nan", "gaussian:", "gaussian:-1"] {
        let error = text.parse::<PixelFilter>().unwrap_err().to_string();
        assert!(error.contains("0.25 to 4 pixels") && error.contains(text), "{error}");
    }
    assert!("box:1".parse::<PixelFilter>().is_err());
}

/// Every word is read as what it is written for.
#[test]
fn words_read_back() {
    fn both<T: std::str::FromStr<Err = OptionError> + std::fmt::Display>(words: &[&str]) {
        for word in words {
            assert_eq!(word.parse::<T>().unwrap_or_else(|e| panic!("{e}")).to_string(), *word);
        }
        let error = "hat".parse::<T>().map(|_| ()).unwrap_err().to_string();
        let name = |word: &str| word.split(':').next().unwrap_or_default().to_owned();
        assert!(words.iter().all(|word| error.contains(&name(word))), "{error}");
    }
    both::<PixelFilter>(&["box", "point", "gaussian:0.25", "gaussian:1", "gaussian:4"]);
    both::<Prefilter>(Prefilter::WORDS);
    both::<Shading>(Shading::WORDS);
    both::<Detail>(Detail::WORDS);
    both::<Meshes>(Meshes::WORDS);
    both::<KernelShape>(KernelShape::WORDS);
    both::<KernelWeight>(KernelWeight::WORDS);
    both::<TemporalAlpha>(TemporalAlpha::WORDS);
    both::<Normalise>(Normalise::WORDS);
    both::<ModeName>(ModeName::WORDS);
    both::<Interleave>(&["1", "2", "4"]);
    both::<Lattice>(&["auto", "none", "2", "4"]);
}

#[test]
fn weights_are_read() {
    let weight = |text: &str| text.parse::<Weight>();
    assert_eq!(weight("box"), Ok(Weight::Box));
    assert_eq!(weight("tent"), Ok(Weight::Tent));
    assert_eq!(weight("ramp"), Ok(Weight::Ramp { centre: 1.0 }));
    assert_eq!(weight("ramp:centre=.25"), Ok(Weight::Ramp { centre: 0.25 }));
    assert_eq!(weight("exponential"), Ok(Weight::Exponential { rate: 3.0, centre: 1.0 }));
    assert_eq!(weight("exponential:centre=0,rate=5"), Ok(Weight::Exponential { rate: 5.0, centre: 0.0 }));
    assert_eq!(weight("one-minus-exponential"), Ok(Weight::OneMinusExponential { centre: 1.0 }));
    assert_eq!(weight("gaussian:width=.1"), Ok(Weight::Gaussian { centre: 0.5, width: 0.1 }));
    for (text, hint) in [
        ("triangle", "`triangle` is no weight (there are: box, tent"),
        ("box:centre=1", "it takes: nothing"),
        ("ramp:center=1", "it takes: centre"),
        ("ramp:centre", "name=value"),
        ("ramp:centre=2", "0 to 1"),
        ("ramp:centre=x", "expected a number from 0 to 1 (the shutter), found `x`"),
        ("ramp:centre=nan", "0 to 1"),
        ("gaussian:width=0", "0.001 to 1000"),
        ("exponential:rate=-3", "0.001 to 1000"),
        ("exponential:rate=inf", "0.001 to 1000"),
        ("ramp:centre=1,centre=0", "twice"),
        ("", "is no weight"),
    ] {
        let error = weight(text).unwrap_err().to_string();
        assert!(error.contains(hint), "{text}: {error}");
    }
}

#[test]
fn channels_are_sorted_and_unique() {
    assert_eq!(in_order(&[Aov::Velocity, Aov::Depth]), Ok(vec![Aov::Depth, Aov::Velocity]));
    assert!(in_order(&[Aov::Depth, Aov::Depth]).unwrap_err().to_string().contains("`depth` is there twice"));
    for aov in Aov::LAYERS {
        assert_eq!(aov.name().parse(), Ok(aov));
    }
    let error = "colour".parse::<Aov>().unwrap_err().to_string();
    assert!(error.contains("alpha, depth, normal, velocity, samples, error"), "{error}");
}

fn interleave() -> impl Strategy<Value = Interleave> {
    prop::sample::select(vec![Interleave::None, Interleave::Two, Interleave::Four])
}

fn lattice() -> impl Strategy<Value = Lattice> {
    prop_oneof![Just(Lattice::Auto), interleave().prop_map(Lattice::Fixed)]
}

fn times() -> impl Strategy<Value = Times> {
    prop::sample::select(Times::WORDS).prop_map(|word| word.parse().unwrap())
}

/// Positions, or none where there are as many as groups.
fn positions(groups: u32, positions: u32) -> Option<u32> {
    Some(positions).filter(|&positions| positions != groups)
}

fn swept() -> impl Strategy<Value = SweptKernel> {
    (0_u32..64, 1_u32..=64, 0.1..=4.0_f64).prop_map(|(bits, source_samples, overlap)| {
        let bit = |i: u32| bits >> i & 1 == 1;
        SweptKernel {
            shape: if bit(0) { KernelShape::Ellipsoid } else { KernelShape::Tube },
            weight: match (bit(0) && bit(1), bit(5)) {
                (false, _) => KernelWeight::Integral,
                (true, false) => KernelWeight::Chord,
                (true, true) => KernelWeight::Line,
            },
            source_samples: SourceSamples(source_samples),
            overlap: if bit(4) { Overlap(overlap) } else { Overlap::default() },
            alpha: if bit(2) { TemporalAlpha::Sum } else { TemporalAlpha::Union },
            normalise: if bit(3) { Normalise::Once } else { Normalise::Interval },
        }
    })
}

/// Every mode in the range of the grammar.
pub(crate) fn any_quality() -> impl Strategy<Value = Quality> {
    let count = || 1_u32..=256;
    prop_oneof![
        count().prop_map(|pixel_samples| BlurMode::Still { pixel_samples }.into()),
        (1..=MAX_SAMPLES, count(), interleave(), times()).prop_map(|(samples, pixel, interleave, times)| {
            BlurMode::Supersample { samples, pixel_samples: positions(samples, pixel), interleave, times }.into()
        }),
        (count(), count(), count(), interleave(), times()).prop_map(|(buckets, samples, pixel, interleave, times)| {
            BlurMode::Bucket { buckets, samples, pixel_samples: positions(buckets, pixel), interleave, times }.into()
        }),
        (count(), count(), swept()).prop_map(|(intervals, pixel, swept)| {
            BlurMode::Volumetric { intervals, pixel_samples: positions(intervals, pixel), swept }.into()
        }),
        (1e-4..=1.0_f64, 4..=MAX_SAMPLES, count(), lattice(), 1.0..=65504.0_f64).prop_map(
            |(error, samples_max, pixel_samples, interleave, white)| {
                ErrorTarget { error, samples_max, pixel_samples, interleave, white }.into()
            }
        ),
    ]
}

fn any_weight() -> impl Strategy<Value = Weight> {
    let (centre, other) = (|| 0.0..=1.0_f64, || 1e-3..=1e3_f64);
    prop_oneof![
        Just(Weight::Box),
        Just(Weight::Tent),
        centre().prop_map(|centre| Weight::Ramp { centre }),
        (other(), centre()).prop_map(|(rate, centre)| Weight::Exponential { rate, centre }),
        centre().prop_map(|centre| Weight::OneMinusExponential { centre }),
        (centre(), other()).prop_map(|(centre, width)| Weight::Gaussian { centre, width }),
    ]
}

proptest! {
    /// Written text is read as the same, and as a part of itself.
    #[test]
    fn options_read_back(quality in any_quality(), swept in swept(), weight in any_weight()) {
        prop_assert_eq!(quality.to_string().parse(), Ok(quality));
        match quality {
            Quality::Mode(mode) => prop_assert_eq!(mode.to_string().parse(), Ok(mode)),
            Quality::Error(target) => prop_assert_eq!(target.to_string().parse(), Ok(target)),
        }
        prop_assert_eq!(swept.to_string().parse(), Ok(swept));
        prop_assert_eq!(weight.to_string().parse(), Ok(weight));
    }

    /// Any text is a mode or a sentence, and what is read is written so that it reads back.
    #[test]
    fn any_text(text in "[a-z:+=x0-9,.-]{0,24}|(still|supersample|bucket|volumetric|auto)[:+=x0-9a-z,.-]{0,16}") {
        match text.parse::<Quality>() {
            Ok(quality) => prop_assert_eq!(quality.to_string().parse(), Ok(quality)),
            Err(error) => prop_assert!(!error.to_string().contains('\n')),
        }
    }
}
