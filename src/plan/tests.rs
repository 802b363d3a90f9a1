use super::*;
use crate::options::{SourceSamples, TemporalAlpha};
use crate::time::Weight;

fn times(plan: &Plan) -> Vec<(f64, f64)> {
    plan.groups.iter().flat_map(|g| &g.samples).map(|s| (s.time, s.weight)).collect()
}

#[test]
fn supersample_takes_mid_strata() {
    let shutter = Shutter { open: -0.5, close: 0.5, weight: Weight::Ramp { centre: 1.0 } };
    let plan = Plan::new(BlurMode::supersample(2), PixelFilter::Point, 1, &shutter, 10.0, &[]);
    assert_eq!(times(&plan), [(9.75, 0.25), (10.25, 0.75)]);
    assert!(plan.groups.iter().all(|g| g.offset == [0.0; 2]));
}

#[test]
fn still_stays_at_the_frame_number() {
    let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Box };
    let plan = Plan::new(BlurMode::Still { pixel_samples: 4 }, PixelFilter::Box, 1, &shutter, 3.0, &[]);
    assert_eq!(times(&plan), [(3.0, 0.25); 4]);
    assert!(plan.groups.iter().any(|g| g.offset != [0.0; 2]));
}

#[test]
fn one_sample_sits_at_mid_shutter_and_pixel_centre() {
    let plan = Plan::new(BlurMode::supersample(1), PixelFilter::Box, 9, &Shutter::default(), 3.0, &[]);
    assert_eq!(plan.groups[0].samples, [TimeSample { time: 3.0, weight: 1.0 }]);
    assert_eq!(plan.groups[0].offset, [0.0; 2]);
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
    let plan = Plan::new(mode, PixelFilter::Box, 1, &Shutter::default(), 0.0, &[]);
    let offsets = |class: &[Group]| class.iter().map(|group| group.offset).collect::<Vec<_>>();
    let classes: Vec<_> = plan.groups.chunk_by(|a, b| a.phase == b.phase).map(offsets).collect();
    assert!((1..4).all(|i| (0..i).all(|j| classes[i] != classes[j])), "{classes:?}");
}

/// Samples take turns at the positions, so that each sees the whole exposure, and stand together by position.
#[test]
fn samples_share_out_sub_pixel_positions() {
    let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Ramp { centre: 1.0 } };
    let plan = |samples, pixel_samples, interleave, filter| {
        let mode = BlurMode::Supersample { samples, pixel_samples: Some(pixel_samples), interleave };
        Plan::new(mode, filter, 3, &shutter, 0.0, &[])
    };
    let all = plan(7, 3, Interleave::None, PixelFilter::Box);
    let offsets = pixel_offsets(3, 3);
    let places = [0, 3, 6, 1, 4, 2, 5].map(|i| (f64::from(i) + 0.5) / 7.0);
    for (group, (place, position)) in all.groups.iter().zip(places.into_iter().zip([0, 0, 0, 1, 1, 2, 2])) {
        assert_eq!(group.offset, offsets[position]);
        assert!((group.samples[0].time - place).abs() < 1e-12, "{place}: {group:?}");
        // Each keeps the weight of its stratum.
        assert!((group.samples[0].weight - 2.0 * place / 7.0).abs() < 1e-12, "{place}: {group:?}");
    }
    let classes = plan(7, 3, Interleave::Two, PixelFilter::Box);
    for class in classes.groups.chunk_by(|a, b| a.phase == b.phase) {
        assert_eq!(class.chunk_by(|a, b| a.offset == b.offset).count(), 3);
    }
    // As many positions as samples, or none: as without.
    for (pixel_samples, filter) in [(5, PixelFilter::Box), (2, PixelFilter::Point)] {
        let usual = Plan::new(BlurMode::supersample(5), filter, 3, &shutter, 0.0, &[]);
        assert!(usual.groups.iter().map(|group| group.samples[0].time).is_sorted());
        assert_eq!(plan(5, pixel_samples, Interleave::None, filter), usual);
    }
}

/// Intervals stay with their samples.
#[test]
fn intervals_share_out_sub_pixel_positions() {
    let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Box };
    let mode = BlurMode::Volumetric { intervals: 5, pixel_samples: Some(2), swept: SweptKernel::default() };
    let plan = Plan::new(mode, PixelFilter::Box, 1, &shutter, 0.0, &[]);
    let starts = plan.groups.iter().map(|group| (group.interval.unwrap().ends[0] * 5.0).round());
    assert!(starts.eq([0.0, 2.0, 4.0, 1.0, 3.0]));
    for group in &plan.groups {
        let [from, to] = group.interval.unwrap().ends;
        assert!(from < group.samples[0].time && group.samples[0].time < to);
    }
    assert_eq!(plan.groups.chunk_by(|a, b| a.offset == b.offset).count(), 2);
}

/// The classes together have the times of S^2 N strata, and each class has the whole exposure.
#[test]
fn interleaved_classes_share_the_strata() {
    let shutter = Shutter { open: 0.0, close: 1.0, weight: Weight::Ramp { centre: 1.0 } };
    for interleave in [Interleave::Two, Interleave::Four] {
        let plan = Plan::new(BlurMode::interleaved(3, interleave), PixelFilter::Box, 1, &shutter, 0.0, &[]);
        let s = interleave.stride();
        let n = 3 * s * s;
        assert_eq!((plan.stride, plan.groups.len()), (s, n as usize));
        let mut all: Vec<f64> = times(&plan).iter().map(|t| t.0).collect();
        all.sort_by(f64::total_cmp);
        for (i, t) in (0..n).zip(all) {
            assert!((t - (f64::from(i) + 0.5) / f64::from(n)).abs() < 1e-12);
        }
        for class in plan.groups.chunk_by(|a, b| a.phase == b.phase) {
            assert_eq!(class.len(), 3);
            let sum: f64 = class.iter().map(|g| g.samples[0].weight).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn buckets_of_one_sample_are_supersampling() {
    let shutter = Shutter { weight: Weight::Tent, ..Shutter::default() };
    for interleave in [Interleave::None, Interleave::Two] {
        let bucket = BlurMode::Bucket { buckets: 5, samples: 1, pixel_samples: Some(5), interleave };
        let samples = BlurMode::interleaved(5, interleave);
        let plan = |mode| Plan::new(mode, PixelFilter::Box, 3, &shutter, 1.0, &[]);
        assert_eq!(plan(bucket), plan(samples));
    }
}

#[test]
fn few_buckets_repeat_for_their_sub_pixel_positions() {
    let mode = BlurMode::Bucket { buckets: 3, samples: 2, pixel_samples: Some(8), interleave: Interleave::None };
    let plan = Plan::new(mode, PixelFilter::Box, 1, &Shutter::default(), 0.0, &[]);
    assert_eq!(plan.groups.len(), 9);
    assert_eq!(plan.groups[3].samples, plan.groups[5].samples);
    assert_ne!(plan.groups[3].offset, plan.groups[5].offset);
    assert_eq!(plan.groups[3].samples.len(), 2);
    let sum: f64 = times(&plan).iter().map(|t| t.1).sum();
    assert!((sum - 1.0).abs() < 1e-12);
}

#[test]
fn intervals_tile_the_shutter_and_end_at_jumps() {
    let shutter = Shutter { open: -0.5, close: 0.5, weight: Weight::Ramp { centre: 1.0 } };
    let mode = BlurMode::Volumetric { intervals: 4, pixel_samples: None, swept: SweptKernel::default() };
    let plan = |jumps: &[f64]| Plan::new(mode, PixelFilter::Point, 1, &shutter, 10.0, jumps);
    let ends = |plan: &Plan| plan.groups.iter().map(|g| g.interval.unwrap().ends).collect::<Vec<_>>();
    assert_eq!(ends(&plan(&[])), [[9.5, 9.75], [9.75, 10.0], [10.0, 10.25], [10.25, 10.5]]);
    // One inside, one at a cut.
    let split = plan(&[9.6, 10.25]);
    let inside = ends(&split);
    assert_eq!(inside.len(), 5);
    assert!(inside[0][1] < 9.6 && inside[0][1] > 9.6 - 1e-6 && inside[1][0] > 9.6 && inside[1][0] < 9.6 + 1e-6);
    assert!(inside[3][1] < 10.25 && inside[4][0] > 10.25 && inside[2][1] == 10.0 && inside[3][0] == 10.0);
    for group in &split.groups {
        let moments: f64 = group.interval.unwrap().moments.iter().sum();
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
    let shared =
        |samples| BlurMode::Supersample { samples, pixel_samples: Some(4), interleave: Interleave::Two }.to_string();
    assert_eq!(shared(5), "supersample:5+pixel-samples=4+interleave=2");
    assert_eq!(shared(4), "supersample:4+interleave=2");
}
