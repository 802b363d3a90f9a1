//! Curves over two logarithmic axes, as SVG for the page.

use std::fmt::Write as _;

/// Points that a line joins.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What the line is.
    pub name: String,
    /// x, y, both > 0, and the name of the point. Others are left out.
    pub points: Vec<(f64, f64, String)>,
}

/// Number of colours that the page has for series: `--s0` and so on.
pub const COLOURS: usize = 8;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 360.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 46.0;

/// A logarithmic axis.
struct Axis {
    low: f64,
    high: f64,
}

impl Axis {
    /// Around all values, with some room; `None` where there is none.
    fn around(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (low, high) =
            values.map(f64::log10).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        if low > high {
            return None;
        }
        // A single value gets a third of a decade on both sides.
        let room = ((high - low) * 0.08).max(if high - low < 0.1 { 0.33 } else { 0.0 });
        Some(Self { low: low - room, high: high + room })
    }

    /// 0..=1 along the axis.
    fn share(&self, value: f64) -> f64 {
        (value.log10() - self.low) / (self.high - self.low)
    }

    /// Round numbers inside; a longer axis has fewer of them for each decade.
    fn ticks(&self) -> Vec<f64> {
        let steps: &[f64] = match self.high - self.low {
            decades if decades > 2.5 => &[1.0],
            decades if decades > 0.9 => &[1.0, 2.0, 5.0],
            _ => &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0],
        };
        (self.low.floor() as i32..=self.high.ceil() as i32)
            .flat_map(|decade| steps.iter().map(move |step| step * 10_f64.powi(decade)))
            .filter(|tick| (0.0..=1.0).contains(&self.share(*tick)))
            .collect()
    }
}

/// The chart. `floor`: a dashed line, and what to call it.
pub fn log_log(x_name: &str, y_name: &str, series: &[Series], floor: Option<(f64, &str)>) -> String {
    let drawn = |x: f64, y: f64| x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite();
    let points = || series.iter().flat_map(|s| &s.points).filter(|(x, y, _)| drawn(*x, *y));
    let floor = floor.filter(|(value, _)| *value > 0.0 && value.is_finite());
    let x_axis = Axis::around(points().map(|p| p.0));
    let y_axis = Axis::around(points().map(|p| p.1).chain(floor.map(|f| f.0)));
    let mut svg = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{} against {}\">",
        escape(y_name),
        escape(x_name)
    );
    let (Some(x_axis), Some(y_axis)) = (x_axis, y_axis) else {
        return svg + "<text x=\"280\" y=\"180\" text-anchor=\"middle\">no positive values</text></svg>";
    };
    let px = |v: f64| LEFT + x_axis.share(v) * (WIDTH - LEFT - RIGHT);
    let py = |v: f64| HEIGHT - BOTTOM - y_axis.share(v) * (HEIGHT - TOP - BOTTOM);
    let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
    // Writing to a string cannot fail.
    for tick in x_axis.ticks() {
        let x = px(tick);
        let _ = write!(
            svg,
            "<path class=\"grid\" d=\"M{x:.1} {TOP}V{bottom}\"/>\
             <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            bottom + 16.0,
            label(tick)
        );
    }
    for tick in y_axis.ticks() {
        let y = py(tick);
        let _ = write!(
            svg,
            "<path class=\"grid\" d=\"M{LEFT} {y:.1}H{right}\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 6.0,
            y + 4.0,
            label(tick)
        );
    }
    let _ = write!(
        svg,
        "<path class=\"axis\" d=\"M{LEFT} {TOP}V{bottom}H{right}\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
         <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        f64::midpoint(LEFT, right),
        HEIGHT - 8.0,
        escape(x_name),
        f64::midpoint(TOP, bottom),
        escape(y_name)
    );
    if let Some((value, name)) = floor {
        let y = py(value);
        let _ = write!(
            svg,
            "<path class=\"floor\" d=\"M{LEFT} {y:.1}H{right}\"/>\
             <text class=\"floor-name\" x=\"{right}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            y - 4.0,
            escape(name)
        );
    }
    for (i, series) in series.iter().enumerate() {
        let colour = i % COLOURS;
        let mut points: Vec<_> = series.points.iter().filter(|(x, y, _)| drawn(*x, *y)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let line: Vec<String> = points.iter().map(|(x, y, _)| format!("{:.1},{:.1}", px(*x), py(*y))).collect();
        // Where there are more series than colours, the later ones are dashed.
        let dash = if i >= COLOURS { " stroke-dasharray=\"5 3\"" } else { "" };
        let _ = write!(svg, "<polyline points=\"{}\" style=\"stroke:var(--s{colour})\"{dash}/>", line.join(" "));
        for (x, y, name) in points {
            let _ = write!(
                svg,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"4\" style=\"fill:var(--s{colour})\">\
                 <title>{}: {x_name} {}, {y_name} {}</title></circle>",
                px(*x),
                py(*y),
                escape(name),
                label(*x),
                label(*y),
                x_name = escape(x_name),
                y_name = escape(y_name)
            );
        }
    }
    svg + "</svg>"
}

/// Three significant digits, without needless zeros.
fn label(value: f64) -> String {
    if (1e-4..1e5).contains(&value) {
        let digits = (2 - value.log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{value:.0e}")
    }
}

/// Text for XML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
