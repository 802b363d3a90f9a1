use proptest::prelude::*;

use super::*;

fn picture(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [f32; 4]) -> Picture {
    let rgba = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
    Picture { width, height, rgba, layers: Vec::new() }
}

/// Something with detail, repeatable, in [0, 1).
fn noise(width: u32, height: u32, seed: u32) -> Picture {
    picture(width, height, |x, y| {
        [0, 1, 2, 3].map(|c| {
            let mut h =
                x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b) ^ (c + 4 * seed).wrapping_mul(0xc2b2_ae35);
            h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
            h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
            (h >> 8) as f32 / (1 << 24) as f32
        })
    })
}

#[test]
fn equal_pictures_have_no_error() {
    let a = noise(40, 20, 1);
    let errors = Comparison::new(&a, &a, &Metric::ALL).unwrap();
    for metric in Metric::ALL {
        let expected = match metric {
            Metric::Psnr => f64::INFINITY,
            Metric::Ssim => 1.0,
            _ => 0.0,
        };
        assert_eq!(errors.value(metric), Some(expected), "{}", metric.name());
    }
}

#[test]
fn known_differences() {
    let b = picture(4, 2, |_, _| [0.5, 0.0, 0.0, 1.0]);
    // Two of eight pixels: red brighter by 0.25; alpha less by 1/2 in one of them.
    let mut a = b.clone();
    a.rgba[5][0] = 0.75;
    a.rgba[6] = [0.75, 0.0, 0.0, 0.5];
    let errors = Comparison::new(&a, &b, &[]).unwrap();
    assert_eq!(errors.colour.mse, 2.0 * 0.0625 / 24.0);
    assert_eq!(errors.colour.relative_mse, 2.0 * 0.0625 / 0.26 / 24.0);
    assert_eq!(errors.colour.mae, 0.5 / 24.0);
    assert_eq!(errors.colour.bias, [0.0625, 0.0, 0.0]);
    assert_eq!(errors.colour.worst, Worst { frame: 0, x: 1, y: 1, difference: 0.25 });
    assert_eq!(
        errors.alpha,
        AlphaErrors {
            mse: 0.25 / 8.0,
            mae: 0.5 / 8.0,
            bias: -0.5 / 8.0,
            worst: Worst { frame: 0, x: 2, y: 1, difference: 0.5 }
        }
    );
    // Encoded: 0.735357 and 0.880825 (IEC 61966-2-1).
    assert!((errors.gamma_mse - 2.0 * (0.880_825_f64 - 0.735_357).powi(2) / 24.0).abs() < 1e-7);
    assert_eq!(errors.value(Metric::Bias), Some(0.0625));
    assert_eq!((errors.value(Metric::Ssim), errors.value(Metric::Flip)), (None, None));
    // The other way round only signs and the relative error change.
    let back = Comparison::new(&b, &a, &[]).unwrap();
    assert_eq!((back.colour.bias[0], back.value(Metric::Bias)), (-0.0625, Some(0.0625)));
    assert_eq!(back.alpha.bias, 0.0625);
}

#[test]
fn display_metrics_do_not_see_what_a_screen_cannot_show() {
    let b = picture(12, 12, |_, _| [1.0, 0.0, 0.5, 1.0]);
    let a = picture(12, 12, |_, _| [7.0, -0.5, 0.5, 1.0]);
    let errors = Comparison::new(&a, &b, &Metric::ALL).unwrap();
    assert_eq!((errors.gamma_mse, errors.ssim, errors.flip), (0.0, Some(1.0), Some(0.0)));
    assert!(errors.colour.mse > 1.0);
}

#[test]
fn one_value_that_is_not_finite_spoils_its_kind() {
    let b = noise(16, 12, 1);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for channel in 0..4 {
            // In both pictures, too: infinity minus infinity is not 0.
            for both in [false, true] {
                let (mut a, mut c) = (b.clone(), b.clone());
                a.rgba[37][channel] = bad;
                if both {
                    c.rgba[37][channel] = bad;
                }
                let errors = Comparison::new(&a, &c, &Metric::ALL).unwrap();
                assert_eq!(errors.non_finite, [1, u64::from(both)]);
                for metric in Metric::ALL {
                    let value = errors.value(metric).unwrap();
                    let name = metric.name();
                    if metric == Metric::NonFinite {
                        assert_eq!(value, 1.0 + f64::from(u8::from(both)));
                    } else if name.starts_with("alpha") == (channel == 3) {
                        assert!(value.is_nan(), "{name} of {bad} in channel {channel}: {value}");
                        assert!(!metric.within(value, f64::INFINITY) && !metric.within(value, f64::NEG_INFINITY));
                    } else {
                        assert!(value.is_finite() || metric == Metric::Psnr, "{name}: {value}");
                    }
                }
                let worst = if channel == 3 { errors.alpha.worst } else { errors.colour.worst };
                assert_eq!((worst.x, worst.y), (37 % 16, 37 / 16));
            }
        }
    }
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let (a, b) = (noise(8, 4, 1), noise(4, 8, 1));
    assert_eq!(Comparison::new(&a, &b, &[]), Err(CompareError::Sizes { a: (8, 4), b: (4, 8) }));
    assert_eq!(flip::map(&a, &b), Err(CompareError::Sizes { a: (8, 4), b: (4, 8) }));
    let small = Comparison::new(&a, &a, &[Metric::Ssim]);
    assert_eq!(small, Err(CompareError::Small { width: 8, height: 4 }));
    assert!(small.unwrap_err().to_string().contains("at least 11 x 11"));
    let nothing = Picture { width: 0, height: 0, rgba: Vec::new(), layers: Vec::new() };
    assert!(Comparison::new(&nothing, &nothing, &[]).is_err());
    let torn = Picture { width: 3, ..noise(2, 2, 1) };
    assert!(Comparison::new(&torn, &torn, &[]).is_err());
    assert_eq!(Comparison::pooled(&[]), Err(CompareError::Nothing));
}

#[test]
fn flip_runs_from_nothing_to_all() {
    // FLIP of black against white is 0.970 by the paper's formulas: green and blue are farther apart.
    let [black, white] = [0.0, 1.0].map(|v| picture(32, 32, |_, _| [v, v, v, 1.0]));
    let map = flip::map(&black, &white).unwrap();
    assert!(map.iter().all(|&v| v == map[0]) && (0.9..1.0).contains(&map[0]), "{}", map[0]);
    let [green, blue] = [[0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]].map(|p| picture(32, 32, |_, _| p));
    assert!((flip::mean(&green, &blue).unwrap() - 1.0).abs() < 1e-6);
    // Seen from closer by, noise is better visible.
    let (a, b) = (noise(32, 32, 1), noise(32, 32, 2));
    let near: f32 = flip::map_at(&a, &b, 20.0).unwrap().iter().sum();
    let far: f32 = flip::map_at(&a, &b, 120.0).unwrap().iter().sum();
    assert!(near > far, "{near} {far}");
}

#[test]
fn pooling_averages_errors_before_their_roots() {
    let b = picture(12, 12, |_, _| [0.5, 0.5, 0.5, 1.0]);
    let off = |d: f32| picture(12, 12, move |_, _| [0.5 + d, 0.5 + d, 0.5 + d, 1.0]);
    let frames: Vec<_> =
        [0.0, 0.25, -0.25].iter().map(|&d| Comparison::new(&off(d), &b, &[Metric::Ssim]).unwrap()).collect();
    let all = Comparison::pooled(&frames).unwrap();
    assert_eq!((all.frames, all.pixels), (3, 3 * 144));
    assert!((all.value(Metric::Rmse).unwrap() - (0.125_f64 / 3.0).sqrt()).abs() < 1e-9);
    assert!(all.colour.bias[0].abs() < 1e-9);
    // The first of the equally bad frames.
    assert_eq!(all.colour.worst, Worst { frame: 1, x: 0, y: 0, difference: 0.25 });
    assert_eq!(all.flip, None);
    assert!(all.ssim.is_some_and(|ssim| ssim < 1.0));
    let mut spoiled = frames;
    spoiled.push(Comparison::new(&off(f32::NAN), &b, &[Metric::Ssim]).unwrap());
    let all = Comparison::pooled(&spoiled).unwrap();
    assert!(all.colour.mse.is_nan() && all.ssim.is_some_and(f64::is_nan) && all.colour.worst.frame == 3);
}

#[test]
fn names_are_found_again() {
    for metric in Metric::ALL {
        assert_eq!(Metric::from_name(metric.name()), Some(metric));
    }
    assert_eq!(Metric::from_name("FLIP"), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Any floats and any size: no panic, symmetric where the formula is, in range where there is one.
    #[test]
    fn any_pictures(
        width in 1_u32..20,
        height in 1_u32..20,
        bits in prop::collection::vec(any::<u32>(), 16),
        tame in any::<bool>(),
    ) {
        let value = |i: usize| {
            let v = f32::from_bits(bits[i % bits.len()]);
            if tame { (bits[i % bits.len()] >> 8) as f32 / (1 << 24) as f32 } else { v }
        };
        let make = |step: usize| {
            let rgba = (0..(width * height) as usize).map(|p| [0, 1, 2, 3].map(|c| value(step * p + c))).collect();
            Picture { width, height, rgba, layers: Vec::new() }
        };
        let (a, b) = (make(1), make(3));
        let metrics = if width.min(height) < ssim::WINDOW { vec![Metric::Flip] } else { Metric::ALL.to_vec() };
        let there = Comparison::new(&a, &b, &metrics).unwrap();
        let back = Comparison::new(&b, &a, &metrics).unwrap();
        for metric in Metric::ALL.into_iter().filter(|&m| m != Metric::RelMse) {
            let (x, y) = (there.value(metric), back.value(metric));
            prop_assert_eq!(x.map(f64::to_bits), y.map(f64::to_bits), "{}", metric.name());
        }
        if tame {
            let flip = there.flip.unwrap();
            prop_assert!((0.0..=1.0 + 1e-6).contains(&flip), "{}", flip);
            prop_assert!(there.ssim.is_none_or(|s| (-1.0..=1.0).contains(&s)));
        }
    }
}
