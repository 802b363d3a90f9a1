//! Numbers for people.

/// Three significant digits.
pub(super) fn figure(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        format!("{value}")
    } else if (1e-4..1e5).contains(&value.abs()) {
        let digits = (2 - value.abs().log10().floor() as i32).max(0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.2e}")
    }
}

/// A share, 0 to 1, in per cent.
pub(super) fn percent(share: f64) -> String {
    // A few wrong values must not be rounded away, nor a few pixels.
    match format!("{:.2} %", share * 100.0).as_str() {
        "100.00 %" if share < 1.0 => "99.99 %".to_owned(),
        "0.00 %" if share > 0.0 => "< 0.01 %".to_owned(),
        text => text.to_owned(),
    }
}
