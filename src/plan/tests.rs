use super::*;
use crate::options::{SourceSamples, TemporalAlpha, Times};
use crate::sampling::pixel_offsets;
use crate::time::Weight;

fn times(plan: &Exposure) -> Vec<(f64, f64)> {
    plan.groups().flat_map(|g| &g.samples).map(|s| (s.time, s.weight)).collect()
}

/// Offset of each position.
fn offsets(plan: &Exposure) -> Vec<[f32; 2]> {
    plan.rasters.iter().flat_map(|raster| &raster.positions).map(|position| position.offset).collect()
}

fn interval(group: &Group) -> Interval {
    group.sweep.unwrap().0
}

fn posed_interval(guard: u32) -> PosedInterval {
    PosedInterval { moments: [1.0 / 32.0; 32], slope: 0.0, guard, slices: 4 }
}

const SCENERY: Scenery = Scenery { has_rest: true, low_pass: false, see_through: false, transparent: false };

/// Objects at rest are painted once where several groups share a position, and not where one is alone.
#[test]
fn groups_of_one_position_share_what_is_at_rest() {
    let paint = |group, shares_rest| Step::Paint { group, shares_rest };
    assert_eq!(Step::of_position(&[None, None], SCENERY), [paint(0, true), paint(1, true)]);
    assert_eq!(Step::of_position(&[None], SCENERY), [paint(0, false)]);
    let moving = Scenery { has_rest: false, ..SCENERY };
    assert_eq!(Step::of_position(&[None, None], moving), [paint(0, false), paint(1, false)]);
}

/// Transparent objects come after the opaque picture of the same group.
#[test]
fn layers_and_composites_follow_the_opaque_picture() {
    let (paint, peel) = (|group| Step::Paint { group, shares_rest: true }, |group| Step::Peel { group });
    let over = |group| Step::Composite { group };
    let foggy = Scenery { transparent: true, ..SCENERY };
    assert_eq!(Step::of_position(&[None, None], foggy), [paint(0), over(0), paint(1), over(1)]);
    let glass = Scenery { see_through: true, ..foggy };
    assert_eq!(Step::of_position(&[None, None], glass), [paint(0), peel(0), over(0), paint(1), peel(1), over(1)]);
}

/// Kernels in motion are one step an interval; published ones are two, and instants with low-pass discs one.
#[test]
fn what_is_published_has_steps_of_its_own() {
    let interval = posed_interval(3);
    let steps = |kernel| Step::of_position(&[Some((interval, kernel))], SCENERY);
    let kernel = SweptKernel::default();
    assert_eq!(steps(kernel), [Step::Sweep { group: 0, interval, kernel }]);
    let kernel = SweptKernel::PUBLISHED;
    let of = |part| Step::Published { group: 0, part };
    assert_eq!(steps(kernel), [of(Published::Map { guard: 3 }), of(Published::Sweep { interval, kernel })]);
    let low_pass = Scenery { low_pass: true, ..SCENERY };
    assert_eq!(Step::of_position(&[None], low_pass), [of(Published::Instant)]);
}

/// Layers are peeled off one after the other; those of a group of several samples are not told apart by depth.
#[test]
fn a_layer_has_four_passes_or_three() {
    for (layered, each) in [(true, 4), (false, 3)] {
        let order = LayerPass::order(layered);
        assert_eq!(order.len(), 1 + each * usize::from(LAYERS) + 2);
        assert_eq!((order[0], order[order.len() - 1]), (LayerPass::Start, LayerPass::LeftOut));
        assert_eq!(order.contains(&LayerPass::Second(0)), layered);
    }
}

#[test]
fn supersample_takes_mid_strata() {
    let shutter = Shutter { open: -0.5, close: 0.5, weight: Weight::Ramp { centre: 1.0 }, ..Shutter::default() };
    let plan = Exposure::new(BlurMode::supersample(2), PixelFilter::Point, 1, &shutter, 10.0, &[]);
    assert_eq!(times(&plan), [(9.75, 0.25), (10.25, 0.75)]);
    assert!(offsets(&plan).iter().all(|&offset| offset == [0.0; 2]));
}

#[test]
fn still_stays_at_the_frame_number() {
    let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Box, ..Shutter::default() };
    let plan = Exposure::new(BlurMode::Still { pixel_samples: 4 }, PixelFilter::Box, 1, &shutter, 3.0, &[]);
    assert_eq!(times(&plan), [(3.0, 0.25); 4]);
    assert!(offsets(&plan).iter().any(|&offset| offset != [0.0; 2]));
}

#[test]
fn one_sample_sits_at_mid_shutter_and_pixel_centre() {
    let plan = Exposure::new(BlurMode::supersample(1), PixelFilter::Box, 9, &Shutter::default(), 3.0, &[]);
    assert_eq!(times(&plan), [(3.0, 1.0)]);
    assert_eq!(offsets(&plan), [[0.0; 2]]);
}

#[test]
fn classes_follow_bayers_order() {
    let matrix = |interleave: Interleave| -> Vec<u32> {
        let s = interleave.stride();
        (0..s * s).map(|i| interleave.order([i % s, i / s])).collect()
    };
    // Bayer 1973.
    assert_eq!(matrix(Interleave::None), [0]);
    assert_eq!(matrix(Interleave::Two), [0, 2, 3, 1]);
    assert_eq!(matrix(Interleave::Four), [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5]);
}

#[test]
fn classes_have_offsets_of_their_own() {
    let mode = BlurMode::interleaved(4, Interleave::Two);
    let plan = Exposure::new(mode, PixelFilter::Box, 1, &Shutter::default(), 0.0, &[]);
    let of_class = |raster: &RasterExposure| raster.positions.iter().map(|p| p.offset).collect::<Vec<_>>();
    let classes: Vec<_> = plan.rasters.iter().map(of_class).collect();
    assert!((1..4).all(|i| (0..i).all(|j| classes[i] != classes[j])), "{classes:?}");
}

/// Samples take turns at the positions, so that each sees the whole exposure, and stand together by position.
#[test]
fn samples_share_out_sub_pixel_positions() {
    let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Ramp { centre: 1.0 }, ..Shutter::default() };
    let plan = |samples, pixel_samples, interleave, filter| {
        let mode =
            BlurMode::Supersample { samples, pixel_samples: Some(pixel_samples), interleave, times: Times::Even };
        Exposure::new(mode, filter, 3, &shutter, 0.0, &[])
    };
    let all = plan(7, 3, Interleave::None, PixelFilter::Box);
    let shared = pixel_offsets(3, 3);
    let places = [0, 3, 6, 1, 4, 2, 5].map(|i| (f64::from(i) + 0.5) / 7.0);
    assert_eq!(offsets(&all), shared);
    assert!(all.rasters[0].positions.iter().map(|position| position.groups.len()).eq([3, 2, 2]));
    for (group, place) in all.groups().zip(places) {
        assert!((group.samples[0].time - place).abs() < 1e-12, "{place}: {group:?}");
        // Each keeps the weight of its stratum.
        assert!((group.samples[0].weight - 2.0 * place / 7.0).abs() < 1e-12, "{place}: {group:?}");
    }
    let classes = plan(7, 3, Interleave::Two, PixelFilter::Box);
    assert!(classes.rasters.iter().all(|class| class.positions.len() == 3));
    // As many positions as samples, or none: as without.
    for (pixel_samples, filter) in [(5, PixelFilter::Box), (2, PixelFilter::Point)] {
        let usual = Exposure::new(BlurMode::supersample(5), filter, 3, &shutter, 0.0, &[]);
        assert!(usual.groups().map(|group| group.samples[0].time).is_sorted());
        assert_eq!(plan(5, pixel_samples, Interleave::None, filter), usual);
    }
}

/// Intervals stay with their samples.
/// A part of a streak is not shifted, whichever interval shows it.
#[test]
fn each_interval_sees_the_pixel_evenly() {
    let shutter = Shutter::default();
    let mode = BlurMode::Volumetric { intervals: 3, pixel_samples: Some(8), swept: SweptKernel::default() };
    for filter in [PixelFilter::Box, PixelFilter::Gaussian { sigma: 1.0 }] {
        let positions = Exposure::new(mode, filter, 5, &shutter, 2.0, &[]).rasters.remove(0).positions;
        assert_eq!(positions.len(), 9);
        for of_interval in positions.chunks(3) {
            let times: Vec<f64> = of_interval.iter().map(|position| position.groups[0].samples[0].time).collect();
            assert!(times.iter().all(|time| *time == times[0]), "{times:?}");
            for axis in 0..2 {
                let offsets: Vec<f32> = of_interval.iter().map(|position| position.offset[axis]).collect();
                assert!(offsets.iter().sum::<f32>().abs() < 1e-6, "{offsets:?}");
                assert!(offsets.iter().any(|offset| offset.abs() > 0.1), "{offsets:?}");
            }
        }
    }
}

#[test]
fn intervals_share_out_sub_pixel_positions() {
    let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Box, ..Shutter::default() };
    let mode = BlurMode::Volumetric { intervals: 5, pixel_samples: Some(2), swept: SweptKernel::default() };
    let plan = Exposure::new(mode, PixelFilter::Box, 1, &shutter, 0.0, &[]);
    let starts = plan.groups().map(|group| (interval(group).ends[0] * 5.0).round());
    assert!(starts.eq([0.0, 2.0, 4.0, 1.0, 3.0]));
    for group in plan.groups() {
        let [from, to] = interval(group).ends;
        assert!(from < group.samples[0].time && group.samples[0].time < to);
    }
    assert_eq!(plan.rasters[0].positions.len(), 2);
}

/// The classes together have the times of S^2 N strata, and each class has the whole exposure.
#[test]
fn interleaved_classes_share_the_strata() {
    let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Ramp { centre: 1.0 }, ..Shutter::default() };
    for interleave in [Interleave::Two, Interleave::Four] {
        let plan = Exposure::new(BlurMode::interleaved(3, interleave), PixelFilter::Box, 1, &shutter, 0.0, &[]);
        let s = interleave.stride();
        let n = 3 * s * s;
        assert_eq!((plan.stride, plan.groups().count()), (s, n as usize));
        let mut all: Vec<f64> = times(&plan).iter().map(|t| t.0).collect();
        all.sort_by(f64::total_cmp);
        for (i, t) in (0..n).zip(all) {
            assert!((t - (f64::from(i) + 0.5) / f64::from(n)).abs() < 1e-12);
        }
        for class in &plan.rasters {
            let groups: Vec<&Group> = class.positions.iter().flat_map(|position| &position.groups).collect();
            assert_eq!(groups.len(), 3);
            let sum: f64 = groups.iter().map(|g| g.samples[0].weight).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn buckets_of_one_sample_are_supersampling() {
    let shutter = Shutter { weight: Weight::Tent, ..Shutter::default() };
    for interleave in [Interleave::None, Interleave::Two] {
        let bucket =
            BlurMode::Bucket { buckets: 5, samples: 1, pixel_samples: Some(5), interleave, times: Times::Even };
        let samples = BlurMode::interleaved(5, interleave);
        let plan = |mode| Exposure::new(mode, PixelFilter::Box, 3, &shutter, 1.0, &[]);
        assert_eq!(plan(bucket), plan(samples));
    }
}

#[test]
fn few_buckets_repeat_for_their_sub_pixel_positions() {
    let mode = BlurMode::Bucket {
        buckets: 3,
        samples: 2,
        pixel_samples: Some(8),
        interleave: Interleave::None,
        times: Times::Even,
    };
    let plan = Exposure::new(mode, PixelFilter::Box, 1, &Shutter::default(), 0.0, &[]);
    let groups: Vec<&Group> = plan.groups().collect();
    assert_eq!(groups.len(), 9);
    assert_eq!(groups[3].samples, groups[5].samples);
    assert_ne!(offsets(&plan)[3], offsets(&plan)[5]);
    assert_eq!(groups[3].samples.len(), 2);
    let sum: f64 = times(&plan).iter().map(|t| t.1).sum();
    assert!((sum - 1.0).abs() < 1e-12);
}

#[test]
fn intervals_tile_the_shutter_and_end_at_jumps() {
    let shutter = Shutter { open: -0.5, close: 0.5, weight: Weight::Ramp { centre: 1.0 }, ..Shutter::default() };
    let mode = BlurMode::Volumetric { intervals: 4, pixel_samples: None, swept: SweptKernel::default() };
    let plan = |jumps: &[f64]| Exposure::new(mode, PixelFilter::Point, 1, &shutter, 10.0, jumps);
    let ends = |plan: &Exposure| plan.groups().map(|g| interval(g).ends).collect::<Vec<_>>();
    assert_eq!(ends(&plan(&[])), [[9.5, 9.75], [9.75, 10.0], [10.0, 10.25], [10.25, 10.5]]);
    // One inside, one at a cut.
    let split = plan(&[9.6, 10.25]);
    let inside = ends(&split);
    assert_eq!(inside.len(), 5);
    assert!(inside[0][1] < 9.6 && inside[0][1] > 9.6 - 1e-6 && inside[1][0] > 9.6 && inside[1][0] < 9.6 + 1e-6);
    assert!(inside[3][1] < 10.25 && inside[4][0] > 10.25 && inside[2][1] == 10.0 && inside[3][0] == 10.0);
    for group in split.groups() {
        let moments: f64 = interval(group).moments.iter().sum();
        assert!((moments - group.samples[0].weight).abs() < 1e-12);
    }
    assert!((times(&split).iter().map(|t| t.1).sum::<f64>() - 1.0).abs() < 1e-12);
}

#[test]
fn modes_have_names() {
    let name = |swept| BlurMode::Volumetric { intervals: 3, pixel_samples: Some(8), swept }.to_string();
    assert_eq!(name(SweptKernel::default()), "volumetric:3+pixel-samples=8");
    let kernel = SweptKernel { source_samples: SourceSamples(4), ..SweptKernel::PUBLISHED };
    assert_eq!(name(kernel), "volumetric:3+pixel-samples=8+published+source-samples=4");
    let kernel = SweptKernel { alpha: TemporalAlpha::Sum, ..SweptKernel::default() };
    assert_eq!(name(kernel), "volumetric:3+pixel-samples=8+alpha=sum");
    let shared = |samples| {
        BlurMode::Supersample { samples, pixel_samples: Some(4), interleave: Interleave::Two, times: Times::Even }
            .to_string()
    };
    assert_eq!(shared(5), "supersample:5+pixel-samples=4+interleave=2");
    // A number that is asked for stays, as without it static objects share positions.
    assert_eq!(shared(4), "supersample:4+pixel-samples=4+interleave=2");
}
