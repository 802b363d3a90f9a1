//! The metrics against programs that this one does not use (tests/data/compare/make.py names them).

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use serde_json::Value;
use splatblur::compare::{Comparison, Metric, flip};

use crate::support::pairs::{PAIRS, data, pair};

fn expected() -> Value {
    serde_json::from_slice(&std::fs::read(data("expected.json")).unwrap()).unwrap()
}

/// Tolerance: the rounding of f32 planes; the largest deviation measured is 4.3e-7 (SSIM of `render`), 5.7e-8 of FLIP.
#[test]
fn metrics_agree_with_other_programs() {
    let expected = expected();
    for (name, extension) in PAIRS {
        let [a, b] = pair((name, extension));
        let found = Comparison::new(&a, &b, &Metric::ALL).unwrap();
        let truth = &expected[name];
        for metric in Metric::ALL.into_iter().filter(|&m| m != Metric::NonFinite) {
            let (value, wanted) = (found.value(metric).unwrap(), truth[metric.name()].as_f64().unwrap());
            println!("{name} {}: {value:.9}, {:+.1e}", metric.name(), value - wanted);
            assert!((value - wanted).abs() <= 1e-6, "{name} {}: {value}, expected {wanted}", metric.name());
        }
        for c in 0..3 {
            let wanted = truth["bias_rgb"][c].as_f64().unwrap();
            assert!((found.colour.bias[c] - wanted).abs() <= 1e-7, "{name} bias {c}");
        }
        let worst = [found.colour.worst.x, found.colour.worst.y].map(Value::from);
        assert_eq!(truth["worst_xy"], Value::from(worst.to_vec()), "{name}");
    }
}

#[test]
fn flip_agrees_pixel_by_pixel() {
    let expected = expected();
    for of in PAIRS {
        let [a, b] = pair(of);
        let map = flip::map(&a, &b).unwrap();
        let row = expected[of.0]["flip_row"].as_array().unwrap();
        assert_eq!(row.len(), a.width as usize);
        let start = (a.height / 2) as usize * row.len();
        let off = map[start..].iter().zip(row).map(|(v, w)| (f64::from(*v) - w.as_f64().unwrap()).abs());
        let worst = off.fold(0.0, f64::max);
        println!("{}: worst pixel of the middle row off by {worst:.1e}", of.0);
        assert!(worst <= 1e-5, "{}: {worst}", of.0);
    }
}
