//! Whole pictures of cases: against the CPU's, and against those of buffers that are too small.

use super::cases::Case;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::Gpu;
use crate::backend::{Backend, Rendered};
use crate::film::Picture;
use crate::renderer::render_checked;
use crate::time::FrameNumber;

/// Share of values that may differ: those for which a rounded value decides. At a cut-off a splat may fall on the other
/// side. On the software device that was seen at no value of captures.
pub(super) const BUDGET: f64 = 1e-3;
/// Largest difference of a value, relative to the larger of 1 and the value. Measured on the software device: 4.8e-7
/// with captures alone, 1.6e-5 with volumes, whose kernels the CPU steps along columns.
const TOLERANCE: f32 = 1e-4;

pub(super) fn render(backend: &mut dyn Backend, case: &Case) -> Rendered {
    let rendered = render_checked(backend, &case.scene, FrameNumber::from(0), &case.options);
    rendered.unwrap_or_else(|e| panic!("{}: {e}", case.name))
}

/// All values of a picture.
pub(super) fn values(picture: &Picture) -> Vec<f32> {
    let layers = picture.layers.iter().flat_map(|layer| layer.planes.iter().flatten());
    picture.rgba.iter().flatten().chain(layers).copied().collect()
}

/// The picture of the device against the CPU's.
pub(super) fn look_the_same(name: &str, got: &Picture, want: &Picture) -> Result<(), String> {
    let (got, want) = (values(got), values(want));
    let difference = |(g, w): (&f32, &f32)| if g == w { 0.0 } else { (g - w).abs() / w.abs().max(1.0) };
    let differences: Vec<f32> = got.iter().zip(&want).map(difference).collect();
    let worst = differences.iter().copied().fold(0.0, f32::max);
    let differing = differences.iter().filter(|&&d| d >= TOLERANCE || d.is_nan()).count();
    let covered = want.iter().filter(|&&v| v != 0.0 && v.is_finite()).count();
    eprintln!("{name}: worst {worst:.1e}, {differing} of {} values differ, {covered} not 0", want.len());
    assert!(got.len() == want.len() && covered > 0, "{name}: nothing to compare");
    if differing as f64 > BUDGET * want.len() as f64 {
        return Err(format!("{name}: {differing} of {} values differ, worst {worst:.1e}", want.len()));
    }
    Ok(())
}

/// Colours and coverages alone, which may differ by `most` at no pixel.
pub(super) fn pixels_agree(name: &str, got: &Picture, want: &Picture, most: f32) -> Result<(), String> {
    let pairs = got.rgba.iter().flatten().zip(want.rgba.iter().flatten());
    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    eprintln!("{name}: worst {worst:.1e}");
    if worst > most { Err(format!("{name}: pixels differ by {worst}")) } else { Ok(()) }
}

/// Pictures are the CPU's, and buffers that are too small do not change them.
pub(super) fn are_the_cpus(roomy: &mut Gpu, cases: &[Case]) {
    let (mut batches, mut bands) = (roomy.beside(), roomy.beside());
    (batches.most_slots, bands.most_bytes) = (100, 256 << 10);
    for (number, case) in cases.iter().enumerate() {
        let got = render(roomy, case).picture;
        let want = render(&mut Cpu::default(), case).picture;
        look_the_same(case.name, &got, &want).unwrap_or_else(|what| panic!("{what}"));
        // Each takes seconds, so the two kinds of small buffers take turns.
        let (small, kind) =
            if number % 2 == 0 { (&mut batches, "batches of 100") } else { (&mut bands, "small bindings") };
        assert_eq!(render(small, case).picture, got, "{}: {kind}", case.name);
    }
}
