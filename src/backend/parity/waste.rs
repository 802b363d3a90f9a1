//! Bounds of filtered splats waste no more on the device than on the CPU: pixels within them, over those that they
//! cover.

use glam::DVec3;

use super::cases::{ball, object, scene};
use super::gpu_or_skip;
use super::harness::{Harness, Pass};
use super::mutants::{Mutant, all_are_noticed};
use super::paint_twins::PaintTwins;
use super::posed::{Context, whole};
use crate::backend::Waste;
use crate::backend::cpu::paint::{PaintGroup, RasterRays, waste_of};
use crate::backend::cpu::waste::whole as all_pixels;
use crate::backend::gpu::Gpu;
use crate::backend::gpu::layout::TILE;
use crate::backend::gpu::slots::Slot;
use crate::frame::Frame;
use crate::layout::EwaSplat;
use crate::math::random::Random;
use crate::options::{BlurMode, RenderOptions};

/// At most so many times the CPU's waste.
const MOST: f64 = 1.05;

/// The waste of the surfels of a frame, on the device and on the CPU; `None` where it has none.
fn wastes(gpu: &mut Gpu, frame: &Frame) -> Option<[Waste; 2]> {
    assert!(frame.has_filtered_kernels(), "splats of full EWA are read");
    let context = Context::of(frame);
    let mut harness = Harness::new(gpu, frame)?;
    harness.run(Pass::Project);
    let buffers = &harness.gpu.state.buffers;
    let slots = harness.batch.slots as usize;
    let touched: Vec<u32> = harness.read(&buffers[Slot::Touched], slots);
    let splats: Vec<EwaSplat> = harness.read(&buffers[Slot::Splats], slots);
    let devices = splats.into_iter().zip(touched).filter(|(_, touched)| *touched > 0).map(|(splat, _)| splat).collect();
    let position = &frame.rasters[0].positions[0];
    let scope = context.scope(frame, position, &position.groups[0], whole(position));
    let twins = PaintTwins { group: PaintGroup::new(scope), edge: TILE as usize };
    let cpus = twins.project().into_iter().flat_map(|posed| posed.splats).collect();
    // Depths are known around the pixels, too.
    let (raster, mut band) = (&position.raster, whole(position));
    band.pixels = band.pixels.widened(raster.apron() as i32, raster.size);
    let rays = RasterRays::new(frame.near, raster);
    Some([devices, cpus].map(|splats: Vec<EwaSplat>| waste_of(&splats, &all_pixels(&band), &rays)))
}

/// Balls of surfels, large and small on the screen, before and behind each other.
fn check(gpu: &mut Gpu, seed: u64) -> Result<(), String> {
    let mut random = Random(seed);
    let mut at = || 2.0 * DVec3::new(random.next().into(), random.next().into(), -2.0 * f64::from(random.next()));
    let objects = [300, 3_000, 30_000].map(|surfels| object(ball(surfels, seed, false), at() - DVec3::ONE));
    let scene = scene(objects.into(), [320, 180]);
    let frame = Frame::new(&scene, 0, BlurMode::Still { pixel_samples: 1 }, &RenderOptions::default());
    let [device, cpu] = wastes(gpu, &frame).unwrap();
    for (pass, device, cpu) in
        [("visibility", device.visibility, cpu.visibility), ("attribute", device.attribute, cpu.attribute)]
    {
        let [device, cpu] = [device, cpu].map(|pixels| pixels.waste().unwrap());
        eprintln!("{seed}, {pass}: {device:.4}, on the CPU {cpu:.4}");
        if device > MOST * cpu {
            return Err(format!("{pass}: {device:.4}, on the CPU {cpu:.4}"));
        }
    }
    Ok(())
}

#[test]
fn bounds_waste_no_more_than_the_cpus() {
    let Some(mut gpu) = gpu_or_skip("bounds_waste_no_more_than_the_cpus") else { return };
    for seed in 1..=3 {
        check(&mut gpu, seed).unwrap_or_else(|what| panic!("{seed}: {what}"));
    }
}

/// Wider bounds change no picture.
static WIDER: [Mutant; 2] = [
    ([("ux * u.z + vx * v.z, 1.0 / d22, 0.0)", "ux * u.z + vx * v.z, 1.0 / d22, 4.0)")], "balls"),
    ([("disc + reach);", "2.0 * (disc + reach)) + reach;")], "balls"),
];

#[test]
#[ignore = "deep: broken programs"]
fn wider_bounds_are_noticed() {
    let Some(mut gpu) = gpu_or_skip("wider_bounds_are_noticed") else { return };
    all_are_noticed(&mut gpu, &WIDER, |gpu, _| check(gpu, 1));
}
