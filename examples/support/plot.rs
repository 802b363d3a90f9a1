//! A log-log plot as SVG, for docs: mid-tone colours and no ground, so that it reads on light and on dark pages.

use std::fmt::Write as _;

/// One panel: a name, and named series of (colour, marker, values, note).
pub struct Panel {
    pub name: String,
    pub series: Vec<Series>,
}

/// Values over the plot's common x.
pub struct Series {
    pub name: String,
    pub note: String,
    pub values: Vec<f64>,
}

const WIDTH: f64 = 300.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 62.0;
const TOP: f64 = 34.0;
/// By series: colour, dashes, marker as a path about its centre.
const STYLES: [(&str, &str, &str); 3] = [
    ("#2f81d0", "none", "m-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z"),
    ("#d9772a", "7 4", "m-4 -4h8v8h-8z"),
    ("#7d8f2f", "2 3", "m0 -5l5 9h-10z"),
];
const GREY: &str = "#7a828c";

/// Panels side by side, the same axes in each; `x` in doublings, `range` of y in powers of ten.
pub fn log_log(title: &str, [x_name, y_name]: [&str; 2], x: &[u64], range: [f64; 2], panels: &[Panel]) -> String {
    let (first, last) = ((x[0] as f64).ln(), (x[x.len() - 1] as f64).ln());
    let column = |n: u64, panel: usize| {
        LEFT + panel as f64 * (WIDTH + 22.0) + 14.0 + (WIDTH - 28.0) * ((n as f64).ln() - first) / (last - first)
    };
    let row = |y: f64| TOP + HEIGHT * (range[1].log10() - y.log10()) / (range[1] / range[0]).log10();
    let (w, h) = (LEFT + panels.len() as f64 * (WIDTH + 22.0), TOP + HEIGHT + 46.0);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" \
         font-family=\"sans-serif\" font-size=\"13\" fill=\"{GREY}\">\n<title>{title}</title>\n"
    );
    let middle = TOP + HEIGHT / 2.0;
    let _ =
        writeln!(out, "<text transform=\"translate(16 {middle}) rotate(-90)\" text-anchor=\"middle\">{y_name}</text>");
    for (number, panel) in panels.iter().enumerate() {
        let left = LEFT + number as f64 * (WIDTH + 22.0);
        let _ = writeln!(
            out,
            "<text x=\"{}\" y=\"22\" text-anchor=\"middle\" font-size=\"15\">{}</text>\n\
             <rect x=\"{left}\" y=\"{TOP}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"none\" stroke=\"{GREY}\"/>",
            left + WIDTH / 2.0,
            panel.name
        );
        let decades = range[0].log10().floor() as i32..=range[1].log10().ceil() as i32;
        for (decade, step) in decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|step| (decade, step))) {
            let y = step * 10_f64.powi(decade);
            if y < range[0] || y > range[1] {
                continue;
            }
            let at = row(y);
            let _ = writeln!(
                out,
                "<path d=\"M{left} {at:.1}h{WIDTH}\" stroke=\"{GREY}\" stroke-opacity=\"{}\"/>",
                if step == 1.0 { 0.5 } else { 0.2 }
            );
            if number == 0 {
                let _ = writeln!(
                    out,
                    "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{y:.0e}</text>",
                    left - 6.0,
                    at + 4.0
                );
            }
        }
        for &n in x {
            let _ = writeln!(
                out,
                "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{n}</text>",
                column(n, number),
                TOP + HEIGHT + 18.0
            );
        }
        let _ = writeln!(
            out,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{x_name}</text>",
            left + WIDTH / 2.0,
            TOP + HEIGHT + 38.0
        );
        for (line, (series, (colour, dashes, marker))) in panel.series.iter().zip(STYLES).enumerate() {
            let points: Vec<String> = x
                .iter()
                .zip(&series.values)
                .map(|(&n, &y)| format!("{:.1} {:.1}", column(n, number), row(y)))
                .collect();
            let _ = writeln!(
                out,
                "<path d=\"M{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\" stroke-dasharray=\"{dashes}\"/>",
                points.join("L")
            );
            let _ = writeln!(out, "<path d=\"M{}{marker}\" fill=\"{colour}\"/>", points.join(&format!("{marker}M")));
            let (x, y) = (left + 16.0, TOP + HEIGHT - 52.0 + 20.0 * line as f64);
            let _ = writeln!(
                out,
                "<path d=\"M{x} {y}h26\" stroke=\"{colour}\" stroke-width=\"2\" stroke-dasharray=\"{dashes}\"/>\
                 <path d=\"M{} {y}{marker}\" fill=\"{colour}\"/>\n<text x=\"{}\" y=\"{}\">{} {}</text>",
                x + 13.0,
                x + 34.0,
                y + 4.0,
                series.name,
                series.note
            );
        }
    }
    out + "</svg>\n"
}
