//! Tests of single curves: infinity rules, modes, steps, units, limits.

use super::*;

fn curve(tangent: Tangent, pre: Infinity, post: Infinity, points: &[(f64, f64)]) -> Curve {
    let raw = points.iter().map(|&p| RawKey { point: p.into(), inward: tangent, outward: tangent }).collect();
    let options = Options { weighted: false, pre, post, factor: DVec2::ONE };
    Curve::new(raw, &options).expect("has keys")
}

/// Two straight segments through (1, 0), (3, 4), (5, 6). The value at 2 is 2, at 4 it is 5.
fn bent(rule: Infinity) -> Curve {
    curve(Tangent::Linear, rule, rule, &[(1.0, 0.0), (3.0, 4.0), (5.0, 6.0)])
}

#[track_caller]
fn values(curve: &Curve, mode: Interpolation, expected: &[(f64, f64)]) {
    for &(t, v) in expected {
        let found = curve.at(t, mode);
        assert!((found - v).abs() < 1e-12, "at {t}: {found}, expected {v}");
    }
}

#[test]
fn no_keys_are_no_curve_and_one_key_is_constant() {
    let options = Options { weighted: false, pre: Infinity::Linear, post: Infinity::Cycle, factor: DVec2::ONE };
    assert!(Curve::new(Vec::new(), &options).is_none());
    for rule in [Infinity::Linear, Infinity::Cycle, Infinity::CycleRelative, Infinity::Oscillate] {
        let one = curve(Tangent::Fixed(DVec2::ONE), rule, rule, &[(3.0, 7.0)]);
        values(&one, Interpolation::Maya, &[(-9.0, 7.0), (3.0, 7.0), (1e9, 7.0)]);
        values(&one, Interpolation::Spline, &[(-9.0, 7.0), (3.0, 7.0), (1e9, 7.0)]);
    }
}

#[test]
fn keys_are_sorted_and_the_later_of_equal_times_counts() {
    let c = curve(
        Tangent::Linear,
        Infinity::Constant,
        Infinity::Constant,
        &[(5.0, 9.0), (1.0, 0.0), (3.0, 1.0), (5.0, 6.0), (3.0, 4.0)],
    );
    assert_eq!(c.keys().len(), 3);
    values(&c, Interpolation::Maya, &[(1.0, 0.0), (2.0, 2.0), (3.0, 4.0), (4.0, 5.0), (5.0, 6.0)]);
}

#[test]
fn steepness_is_that_of_the_segments_in_the_range() {
    let maya = Interpolation::Maya;
    let c = bent(Infinity::Constant);
    let ranges = [(1.5, 2.5, 2.0), (3.5, 4.5, 1.0), (2.5, 3.5, 2.0), (5.5, 9.0, 0.0)];
    for (from, to, steepest) in ranges {
        assert_eq!(c.steepness(from, to, maya), steepest, "{from}..{to}");
    }
    // A value that is held jumps at the end of its segment, or at the beginning.
    let points = [(1.0, 0.0), (3.0, 4.0), (5.0, 6.0)];
    for (tangent, jumps) in [(Tangent::Step, 2.9..3.1), (Tangent::StepNext, 0.9..1.1)] {
        let c = curve(tangent, Infinity::Constant, Infinity::Constant, &points);
        assert_eq!(c.steepness(1.5, 2.5, maya), 0.0, "{tangent:?}");
        assert_eq!(c.steepness(jumps.start, jumps.end, maya), f64::INFINITY, "{tangent:?}");
    }
}

#[test]
fn infinity_rules_follow_the_table() {
    let maya = Interpolation::Maya;
    values(&bent(Infinity::Constant), maya, &[(-3.5, 0.0), (0.0, 0.0), (6.0, 6.0), (100.0, 6.0)]);
    // The period is 4: the times 6, 10 stand for 2, and 0, -4 for 4.
    values(&bent(Infinity::Cycle), maya, &[(6.0, 2.0), (10.0, 2.0), (8.0, 5.0), (0.0, 5.0), (-4.0, 5.0), (-2.0, 2.0)]);
    values(&bent(Infinity::CycleRelative), maya, &[(6.0, 8.0), (10.0, 14.0), (0.0, -1.0), (-4.0, -7.0)]);
    // Mirrored: the time 6 stands for 4, 8 and 10 for 2; 0 stands for 2, -2 and -4 for 4.
    values(&bent(Infinity::Oscillate), maya, &[(6.0, 5.0), (8.0, 2.0), (10.0, 2.0), (12.0, 5.0)]);
    values(&bent(Infinity::Oscillate), maya, &[(0.0, 2.0), (-2.0, 5.0), (-4.0, 5.0), (-6.0, 2.0)]);
}

#[test]
fn linear_infinity_follows_the_outward_tangent() {
    // Maya's linear tangents have no direction outwards; spline ones do.
    values(&bent(Infinity::Linear), Interpolation::Maya, &[(0.0, 0.0), (7.0, 6.0)]);
    let spline = curve(Tangent::Spline, Infinity::Linear, Infinity::Linear, &[(1.0, 0.0), (3.0, 4.0), (5.0, 6.0)]);
    values(&spline, Interpolation::Maya, &[(0.0, -2.0), (7.0, 8.0)]);
    // The other modes continue along the last chord, unless it is a step.
    values(&bent(Infinity::Linear), Interpolation::Linear, &[(0.0, -2.0), (7.0, 8.0)]);
    values(&bent(Infinity::Linear), Interpolation::Spline, &[(0.0, -2.0), (7.0, 8.0)]);
    let step = curve(Tangent::Step, Infinity::Linear, Infinity::Linear, &[(1.0, 0.0), (3.0, 4.0)]);
    values(&step, Interpolation::Linear, &[(0.0, 0.0), (7.0, 4.0)]);
}

#[test]
fn far_away_times_keep_their_fraction() {
    let c = bent(Infinity::Cycle);
    values(&c, Interpolation::Maya, &[(1e8 + 2.25, 2.5), (-1e8 + 2.25, 2.5)]);
    let relative = bent(Infinity::CycleRelative);
    let found = relative.at(1e8 + 2.25, Interpolation::Maya);
    assert!((found - (2.5 + 6.0 * 1e8 / 4.0)).abs() < 1e-6, "{found}");
    let swing = bent(Infinity::Oscillate);
    values(&swing, Interpolation::Maya, &[(1e8 + 2.25, 2.5), (1e8 + 6.25, 4.75), (-1e8 + 2.25, 2.5)]);
    for t in [1e300, -1e300, f64::INFINITY, f64::NAN] {
        assert!(relative.at(t, Interpolation::Maya).is_finite());
    }
    // A cycle of very many, very short periods.
    let short = curve(Tangent::Linear, Infinity::CycleRelative, Infinity::Linear, &[(0.0, 0.0), (1e-300, 1e30)]);
    assert!(short.at(-1e18, Interpolation::Maya).is_finite());
    assert!(short.at(1e18, Interpolation::Linear).is_finite());
}

#[test]
fn relative_cycles_do_not_slip_at_their_seams() {
    // The period 0.1 is no binary fraction, so count and remainder must agree at every seam.
    let c = curve(Tangent::Linear, Infinity::CycleRelative, Infinity::CycleRelative, &[(0.0, 0.0), (0.1, 1.0)]);
    for i in -2000..2000 {
        let t = f64::from(i) * 0.1;
        assert!((c.at(t, Interpolation::Maya) - t * 10.0).abs() < 1e-9, "{t}");
    }
}

#[test]
fn steps_hold_in_every_mode() {
    for mode in [Interpolation::Maya, Interpolation::Linear, Interpolation::Spline] {
        let points = [(1.0, 5.0), (3.0, 7.0), (6.0, 2.0)];
        let step = curve(Tangent::Step, Infinity::Constant, Infinity::Constant, &points);
        values(&step, mode, &[(1.0, 5.0), (2.999, 5.0), (3.0, 7.0), (5.9, 7.0), (6.0, 2.0), (9.0, 2.0)]);
        let next = curve(Tangent::StepNext, Infinity::Constant, Infinity::Constant, &points);
        values(&next, mode, &[(1.0, 5.0), (1.001, 7.0), (3.0, 7.0), (3.001, 2.0), (6.0, 2.0)]);
        // A time that differs from a key by one rounding counts as the key.
        assert_eq!(step.at(3.0f64.next_down(), mode), 7.0);
        assert_eq!(next.at(1.0f64.next_up(), mode), 5.0);
        assert_eq!(step.at(6.0f64.next_up(), mode), 2.0);
        assert_eq!(next.at(1.0f64.next_down(), mode), 5.0);
    }
}

#[test]
fn linear_mode_ignores_tangents() {
    let flat = curve(Tangent::Flat, Infinity::Cycle, Infinity::Cycle, &[(1.0, 0.0), (3.0, 4.0), (5.0, 6.0)]);
    values(&flat, Interpolation::Linear, &[(1.5, 1.0), (2.0, 2.0), (4.5, 5.5), (6.0, 2.0), (0.0, 5.0)]);
}

#[test]
fn spline_mode_is_a_catmull_rom_for_uneven_keys() {
    // The keys lie on a parabola, which is symmetric about the inner segment's keys only by luck. The truth is a
    // Hermite made by hand.
    let c =
        curve(Tangent::Flat, Infinity::Constant, Infinity::Constant, &[(0.0, 1.0), (1.0, 3.0), (4.0, 2.0), (6.0, 7.0)]);
    let (m0, m1) = ((2.0 - 1.0) / 4.0, (7.0 - 3.0) / 5.0);
    let by_hand = Segment {
        start: DVec2::new(1.0, 3.0),
        out: DVec2::new(1.0, m0),
        end: DVec2::new(4.0, 2.0),
        inward: DVec2::new(1.0, m1),
    };
    for i in 0..=30 {
        let t = 1.0 + f64::from(i) / 10.0;
        assert!((c.at(t, Interpolation::Spline) - by_hand.hermite(t)).abs() < 1e-13);
    }
    // At the end the slope is the chord's.
    let h = 1e-6;
    assert!(((c.at(h, Interpolation::Spline) - 1.0) / h - 2.0).abs() < 1e-4);
    // Two keys give a straight line.
    let two = curve(Tangent::Flat, Infinity::Constant, Infinity::Constant, &[(0.0, 1.0), (4.0, 3.0)]);
    values(&two, Interpolation::Spline, &[(1.0, 1.5), (3.0, 2.5)]);
}

#[test]
fn a_step_does_not_bend_the_spline_beside_it() {
    let key = |t: f64, v: f64, outward| RawKey { point: DVec2::new(t, v), inward: Tangent::Auto, outward };
    let raw = vec![
        key(0.0, 50.0, Tangent::Step),
        key(1.0, 0.0, Tangent::Auto),
        key(2.0, 1.0, Tangent::Step),
        key(3.0, 90.0, Tangent::Auto),
    ];
    let options = Options { weighted: false, pre: Infinity::Constant, post: Infinity::Constant, factor: DVec2::ONE };
    let c = Curve::new(raw, &options).expect("has keys");
    values(&c, Interpolation::Spline, &[(0.5, 50.0), (1.25, 0.25), (1.75, 0.75), (2.5, 1.0), (3.0, 90.0)]);
}

#[test]
fn units_scale_time_value_and_tangents() {
    let raw = |t| {
        vec![
            RawKey { point: DVec2::ZERO, inward: t, outward: t },
            RawKey { point: DVec2::new(2.0, 3.0), inward: t, outward: t },
        ]
    };
    for weighted in [false, true] {
        let build = |factor| {
            let options = Options { weighted, pre: Infinity::Linear, post: Infinity::Linear, factor };
            Curve::new(raw(Tangent::Fixed(DVec2::new(1.5, 4.0))), &options).expect("has keys")
        };
        let (plain, scaled) = (build(DVec2::ONE), build(DVec2::new(10.0, 100.0)));
        for i in -10..40 {
            let t = f64::from(i) / 10.0;
            let (a, b) = (plain.at(t, Interpolation::Maya), scaled.at(t * 10.0, Interpolation::Maya));
            assert!((a * 100.0 - b).abs() < 1e-9, "{weighted} {t}: {a} {b}");
        }
    }
}

#[test]
fn steep_and_crowded_keys_stay_finite() {
    let vertical = Tangent::Fixed(DVec2::new(0.0, 1e30));
    let points = [(0.0, -1e30), (5e-324, 1e30), (1.0, -1e30), (1e30, 1e30)];
    for rule in [Infinity::Linear, Infinity::CycleRelative, Infinity::Oscillate] {
        for tangent in [vertical, Tangent::Auto, Tangent::AutoEase, Tangent::Spline, Tangent::Plateau] {
            let raw: Vec<_> =
                points.iter().map(|&p| RawKey { point: p.into(), inward: tangent, outward: tangent }).collect();
            for weighted in [false, true] {
                let factor = DVec2::new(1e-3, 1e5);
                let c = Curve::new(raw.clone(), &Options { weighted, pre: rule, post: rule, factor });
                let c = c.expect("has keys");
                for t in [-1e30, -1.0, 0.0, 1e-200, 0.5, 2.0, 1e17, 1e29] {
                    for mode in [Interpolation::Maya, Interpolation::Linear, Interpolation::Spline] {
                        assert!(c.at(t, mode).is_finite(), "{tangent:?} {t} {mode:?}");
                    }
                }
            }
        }
    }
}
