//! Parity with the CPU, pass by pass, slot by slot: each pass is fed the CPU's results of the passes before it.

use super::cases::{self, Case};
use super::compare::Tally;
use super::gpu_or_skip;
use super::harness::{Harness, Host, NONE, PIXELS, Pass, UNWANTED, planes_of};
use super::splat_twins::Context;
use crate::backend::gpu::Gpu;
use crate::backend::gpu::lanes::Lanes;
use crate::backend::gpu::slots::Slot;
use crate::plan::PaintPass;

fn visibility(harness: &Harness<'_>, host: &Host<'_>) -> Result<(), String> {
    let want: Vec<f32> = host.depths().collect();
    let depths: Vec<f32> = harness.read(&harness.gpu.state.buffers[Slot::Thresholds], want.len());
    let mut tally = Tally::default();
    for (pixel, (got, want)) in depths.iter().zip(want).enumerate() {
        // Nobody reads the nearest depths of what is not wanted.
        if want == UNWANTED && pixel >= host.thresholds.len() * PIXELS {
            continue;
        }
        let want = want.min(NONE);
        tally.floats(&[*got], &[want], want, || format!("pixel {pixel}"));
    }
    tally.check("thresholds")
}

fn attribute(harness: &Harness<'_>, host: &Host<'_>) -> Result<(), String> {
    let channels = harness.prepared.channels.count;
    let sums: Vec<f32> = harness.read(&harness.gpu.state.buffers[Slot::Sums], host.sums.len() * channels * PIXELS);
    let mut tally = Tally::default();
    for (tile, (got, want)) in sums.chunks(channels * PIXELS).zip(&host.sums).enumerate() {
        let want = planes_of(want);
        for pixel in 0..PIXELS {
            for (channel, want) in want.iter().enumerate() {
                // A sum's rounding goes with the sum of the weights.
                let scale = host.sums[tile].channels[0][pixel].max(want[pixel].abs());
                let at = || format!("tile {tile}, pixel {pixel}, channel {channel}");
                tally.floats(&[got[channel * PIXELS + pixel]], &[want[pixel]], scale, at);
            }
        }
    }
    tally.check("sums")
}

fn resolve(harness: &Harness<'_>, host: &Host<'_>) -> Result<(), String> {
    let planes = harness.prepared.planes.count;
    let film: Vec<f32> = harness.read(&harness.gpu.state.buffers[Slot::Film], host.film.len() * planes * PIXELS);
    let mut tally = Tally::default();
    for (tile, (got, want)) in film.chunks(planes * PIXELS).zip(&host.film).enumerate() {
        for (plane, want) in want.iter().enumerate() {
            for (pixel, want) in want.iter().enumerate() {
                let at = || format!("tile {tile}, pixel {pixel}, plane {plane}");
                tally.floats(&[got[plane * PIXELS + pixel]], &[*want], want.abs(), at);
            }
        }
    }
    tally.check("film")
}

/// All passes of the first group of a case; the first that differs.
pub(super) fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let frame = case.frame();
    let context = Context::of(&frame);
    let Some(mut harness) = Harness::new(gpu, &frame, &context) else { return Ok(()) };
    let host = harness.host();
    for pass in
        [Pass::Project, Pass::Bin].into_iter().chain(PaintPass::order(false).iter().map(|&pass| Pass::Splat(pass)))
    {
        harness.feed(&host, pass);
        harness.run(pass);
        let compared = match pass {
            Pass::Project => host.slots.compare_splats(&harness),
            Pass::Bin => host.slots.compare_lists(&harness),
            Pass::Splat(PaintPass::Visibility) => visibility(&harness, &host),
            Pass::Splat(PaintPass::Attribute) => attribute(&harness, &host),
            Pass::Splat(PaintPass::Resolve) => resolve(&harness, &host),
            _ => unreachable!("not a pass of splats"),
        };
        compared.map_err(|what| format!("{}: {pass:?}: {what}", case.name))?;
    }
    Ok(())
}

#[test]
fn passes_agree() {
    let Some(mut gpu) = gpu_or_skip("passes_agree") else { return };
    for lanes in Lanes::ALL {
        gpu.state.device.lanes = lanes;
        for case in cases::all() {
            eprintln!("{}, by {lanes:?}:", case.name);
            check(&mut gpu, &case).unwrap_or_else(|what| panic!("by {lanes:?}: {what}"));
        }
    }
}

/// The comparison is worth something only where there is something to compare.
#[test]
fn cases_take_the_branches() {
    let Some(mut gpu) = gpu_or_skip("cases_take_the_branches") else { return };
    let (mut visible, mut wide, mut uncovered, mut partly) = (0, 0, 0, 0);
    let mut unwanted = 0;
    for case in cases::all() {
        let frame = case.frame();
        let context = Context::of(&frame);
        let Some(harness) = Harness::new(&mut gpu, &frame, &context) else { continue };
        let host = harness.host();
        visible += host.posed.iter().map(|posed| posed.splats.len()).sum::<usize>();
        wide += host.slots.wide.len();
        let covered = |t: &f32| t.is_finite();
        uncovered += host.thresholds.iter().flatten().filter(|t| !covered(t)).count();
        let weights = host.sums.iter().flat_map(|sums| &sums.channels[0]);
        partly += host.thresholds.iter().flatten().zip(weights).filter(|(t, w)| !covered(t) && **w > 0.0).count();
        unwanted += host.thresholds.iter().flatten().filter(|t| **t == UNWANTED).count();
    }
    assert!(unwanted > 1000, "{unwanted}");
    assert!(visible > 3000 && wide > 5 && uncovered > 5000 && partly > 100, "{visible} {wide} {uncovered} {partly}");
}
