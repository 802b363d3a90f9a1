//! Parity with the CPU, pass by pass, slot by slot: each pass is fed the CPU's results of the passes before it.

use super::cases::{self, Case};
use super::compare::Tally;
use super::gpu_or_skip;
use super::harness::{Harness, Host, NONE, PIXELS, Pass, UNWANTED, planes_of};
use super::splat_twins::{Context, Restored};
use crate::backend::gpu::Gpu;
use crate::plan::SplatPass;

fn visibility(harness: &Harness<'_>, host: &Host) -> Result<(), String> {
    let thresholds: Vec<f32> = harness.read(&harness.gpu.state.buffers.thresholds, host.thresholds.len() * PIXELS);
    let mut tally = Tally::default();
    for (pixel, (got, want)) in thresholds.iter().zip(host.thresholds.iter().flatten()).enumerate() {
        let want = want.min(NONE);
        tally.floats(&[*got], &[want], want, || format!("pixel {pixel}"));
    }
    tally.check("thresholds")
}

fn attribute(harness: &Harness<'_>, host: &Host) -> Result<(), String> {
    let channels = harness.prepared.channels.count;
    let sums: Vec<f32> = harness.read(&harness.gpu.state.buffers.sums, host.sums.len() * channels * PIXELS);
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

fn resolve(harness: &Harness<'_>, host: &Host) -> Result<(), String> {
    let planes = harness.prepared.planes.count;
    let film: Vec<f32> = harness.read(&harness.gpu.state.buffers.film, host.film.len() * planes * PIXELS);
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

/// Static objects, and what a group restores of them.
fn layer(harness: &mut Harness<'_>, host: &Host) -> Result<(), String> {
    let restored: Vec<Restored> = harness.restored(host);
    let channels = harness.prepared.channels.count;
    let planes = |sums: &[Vec<f32>], nearest: &[f32]| {
        let least = nearest.iter().map(|depth| depth.min(NONE)).collect();
        [sums, &[least]].concat()
    };
    let of_layer = |tile: &Restored| planes(&planes_of(&tile.layer), &tile.nearest);
    let thresholds: Vec<f32> = restored.iter().flat_map(|tile| &tile.layer_thresholds).map(|t| t.min(NONE)).collect();

    harness.static_layer();
    let buffers = &harness.gpu.state.buffers;
    let mut tally = Tally::default();
    for (pixel, (got, want)) in
        harness.read(&buffers.layer_thresholds, thresholds.len()).iter().zip(&thresholds).enumerate()
    {
        tally.floats(&[*got], &[*want], *want, || format!("layer's pixel {pixel}"));
    }
    let sums: Vec<f32> = harness.read(&buffers.layer_sums, restored.len() * (channels + 1) * PIXELS);
    for (tile, (got, want)) in sums.chunks((channels + 1) * PIXELS).zip(&restored).enumerate() {
        if want.layer_thresholds[0] == UNWANTED {
            continue;
        }
        for (channel, (got, of_channel)) in got.chunks(PIXELS).zip(of_layer(want)).enumerate() {
            for pixel in 0..PIXELS {
                let scale = want.layer.channels[0][pixel].max(of_channel[pixel].abs());
                let at = || format!("layer's tile {tile}, pixel {pixel}, channel {channel}");
                tally.floats(&[got[pixel]], &[of_channel[pixel]], scale, at);
            }
        }
    }
    tally.check("layer")?;

    harness.feed(host, Pass::Splat(SplatPass::Attribute));
    harness.write(&harness.gpu.state.buffers.layer_thresholds, &thresholds);
    let sums: Vec<f32> = restored.iter().flat_map(of_layer).flatten().collect();
    harness.write(&harness.gpu.state.buffers.layer_sums, &sums);
    harness.restore();
    // Nothing is rounded: to the bit.
    let buffers = &harness.gpu.state.buffers;
    let limits: Vec<f32> = restored.iter().flat_map(|tile| &tile.limits).map(|limit| limit.max(UNWANTED)).collect();
    if harness.read::<f32>(&buffers.limits, limits.len()) != limits {
        return Err("other limits".into());
    }
    let sums: Vec<f32> = restored.iter().flat_map(|tile| planes_of(&tile.sums)).flatten().collect();
    let got: Vec<f32> = harness.read(&buffers.sums, sums.len());
    let same = |(got, want): (&[f32], &[f32])| got == want;
    let mut tiles = got.chunks(channels * PIXELS).zip(sums.chunks(channels * PIXELS)).zip(&restored);
    match tiles.position(|(sums, tile)| tile.layer_thresholds[0] != UNWANTED && !same(sums)) {
        None => Ok(()),
        Some(tile) => Err(format!("other sums restored in tile {tile}")),
    }
}

/// All passes of the first group of a case; the first that differs.
pub(super) fn check(gpu: &mut Gpu, case: &Case) -> Result<(), String> {
    let frame = case.frame();
    let context = Context::of(&frame);
    let Some(mut harness) = Harness::new(gpu, &frame, &context) else { return Ok(()) };
    let host = harness.host();
    for pass in [Pass::Project, Pass::Bin].into_iter().chain(SplatPass::ORDER.map(Pass::Splat)) {
        harness.feed(&host, pass);
        harness.run(pass);
        let compared = match pass {
            Pass::Project => host.slots.compare_splats(&harness),
            Pass::Bin => host.slots.compare_lists(&harness),
            Pass::Splat(SplatPass::Visibility) => visibility(&harness, &host),
            Pass::Splat(SplatPass::Attribute) => attribute(&harness, &host),
            Pass::Splat(SplatPass::Resolve) => resolve(&harness, &host),
            Pass::Map(_) | Pass::MakeKernels | Pass::Sweep(_) | Pass::Filter | Pass::Ewa(_) => {
                unreachable!("not a pass of splats")
            }
        };
        compared.map_err(|what| format!("{}: {pass:?}: {what}", case.name))?;
    }
    if harness.prepared.schedule.cached_slots > 0 {
        layer(&mut harness, &host).map_err(|what| format!("{}: {what}", case.name))?;
    }
    Ok(())
}

#[test]
fn passes_agree() {
    let Some(mut gpu) = gpu_or_skip("passes_agree") else { return };
    for case in cases::all() {
        eprintln!("{}:", case.name);
        check(&mut gpu, &case).unwrap_or_else(|what| panic!("{what}"));
    }
}

/// The comparison is worth something only where there is something to compare.
#[test]
fn cases_take_the_branches() {
    let Some(mut gpu) = gpu_or_skip("cases_take_the_branches") else { return };
    let (mut visible, mut wide, mut uncovered, mut partly) = (0, 0, 0, 0);
    let [mut restored, mut recomputed, mut hidden, mut unwanted] = [0; 4];
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
        if harness.prepared.schedule.cached_slots > 0 {
            for tile in harness.restored(&host) {
                let weights = tile.layer.channels[0].iter().zip(&tile.sums.channels[0]).zip(&tile.limits);
                for ((before, after), limit) in weights.filter(|((before, _), _)| **before > 0.0) {
                    restored += usize::from(after == before);
                    recomputed += usize::from(*limit > 0.0);
                    hidden += usize::from(*after == 0.0 && *limit < 0.0);
                }
            }
        }
    }
    assert!(restored > 100 && recomputed > 20, "{restored} {recomputed}");
    assert!(hidden > 20 && unwanted > 1000, "{hidden} {unwanted}");
    assert!(visible > 3000 && wide > 5 && uncovered > 5000 && partly > 100, "{visible} {wide} {uncovered} {partly}");
}
