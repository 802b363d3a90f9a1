//! Buffers that are too small: lists are grown, work is split, and the picture stays the same to the bit.

use super::captures::captures;
use super::cases;
use super::gpu_or_skip;
use super::pictures::render;
use super::shared_rest;
use super::sweeps;
use crate::backend::BackendError;
use crate::backend::gpu::Gpu;
use crate::film::Picture;

fn picture(gpu: &mut Gpu, case: &cases::Case) -> Picture {
    render(gpu, case).picture
}

#[test]
#[ignore = "deep: small buffers"]
fn small_buffers_change_nothing() {
    let Some(mut roomy) = gpu_or_skip("small_buffers_change_nothing") else { return };
    let cases = cases::all();
    let wanted: Vec<Picture> = cases.iter().map(|case| picture(&mut roomy, case)).collect();
    let (mut batches, mut bands) = (roomy.beside(), roomy.beside());
    let mut rounds = [1, 3].map(|groups| {
        let mut gpu = roomy.beside();
        gpu.most_groups = groups;
        gpu
    });
    for (case, want) in cases.iter().zip(wanted) {
        // Lists outgrow their buffers, which are grown.
        let mut small = roomy.beside();
        small.first_entries = 1;
        assert_eq!(picture(&mut small, case), want, "{}: lists of one entry", case.name);
        assert_eq!(picture(&mut small, case), want, "{}: again", case.name);

        // Groups pass one by one, and three at a time.
        for gpu in &mut rounds {
            assert_eq!(picture(gpu, case), want, "{}: rounds of {} groups", case.name, gpu.most_groups);
        }

        // Surfels pass in many batches.
        batches.most_slots = 100;
        assert_eq!(picture(&mut batches, case), want, "{}: batches of 100", case.name);

        // A binding holds a few tiles.
        bands.most_bytes = 160 << 10;
        assert_eq!(picture(&mut bands, case), want, "{}: bindings of 160 KiB", case.name);
    }
}

/// The least memory with which a frame can be rendered, and half as much again, hold all that it takes.
#[test]
fn a_frame_takes_what_it_may_take() {
    let Some(mut counting) = gpu_or_skip("a_frame_takes_what_it_may_take") else { return };
    let mut rounds = 0;
    let all = cases::all().into_iter().chain(cases::swept()).chain(sweeps::own());
    for mut case in all.chain(shared_rest::cases()) {
        (case.scene.image.width, case.scene.image.height) = (1600, 400);
        let mut frame = case.frame();
        let mut take = |memory: u64| {
            let mut gpu = gpu_or_skip("a_frame_takes_what_it_may_take")?;
            gpu.most_slots = u64::MAX;
            frame.memory = memory;
            Some(gpu.fill(&frame))
        };
        let Some(refused) = take(0) else { return };
        let Err(BackendError::Memory { needed, .. }) = refused else { panic!("{}: {refused:?}", case.name) };
        for memory in [needed, needed + needed / 2] {
            let Some(taken) = take(memory) else { return };
            let taken = taken.unwrap_or_else(|e| panic!("{}: {e}", case.name));
            assert!(taken <= memory, "{}: {taken} bytes of {memory}", case.name);
            // Nor is much left of the memory.
            assert!(taken > memory / 10 * 9, "{}: {taken} bytes of {memory}", case.name);
        }
        // There is room for rounds.
        let Some(taken) = take(8 * needed) else { return };
        let taken = taken.unwrap_or_else(|e| panic!("{}: {e}", case.name));
        assert!(taken <= 8 * needed, "{}: {taken} bytes of {}", case.name, 8 * needed);
        (frame.memory, rounds) = (8 * needed, rounds + usize::from(counting.groups_of_a_round(&frame) > 1));
    }
    assert!(rounds > 5, "{rounds} cases have rounds");
}

#[test]
fn tiles_keep_to_the_limit_of_a_binding() {
    let Some(roomy) = gpu_or_skip("tiles_keep_to_the_limit_of_a_binding") else { return };
    for case in cases::all().into_iter().chain(cases::swept()).chain(captures()) {
        let mut gpu = roomy.beside();
        // A row of tiles always fits.
        let frame = case.frame();
        let few = case.options.look.aovs.is_empty() && !frame.has_see_through();
        gpu.most_bytes = if few { 64 << 10 } else { 1 << 20 };
        gpu.fill(&frame).unwrap_or_else(|e| panic!("{}: {e}", case.name));
        let bytes = gpu.most_bytes_of_tiles();
        assert!(bytes <= gpu.most_bytes, "{}: {bytes}", case.name);
    }
}

/// Loops that end early: lists are cut until they are short, those of what is at rest with them.
#[test]
fn lists_that_are_too_long_split_the_batches() {
    let Some(mut roomy) = gpu_or_skip("lists_that_are_too_long_split_the_batches") else { return };
    for case in &shared_rest::cases()[..2] {
        let want = picture(&mut roomy, case);
        let mut gpu = roomy.beside();
        gpu.most_turns = 160;
        assert_eq!(picture(&mut gpu, case), want, "{}", case.name);
        assert!(gpu.most_surfel_slots < u64::MAX, "{}: no batch was split", case.name);
    }
}

#[test]
fn lists_that_cannot_grow_split_the_batches() {
    let Some(mut roomy) = gpu_or_skip("lists_that_cannot_grow_split_the_batches") else { return };
    let case = cases::large_splats();
    let want = picture(&mut roomy, &case);
    let mut gpu = roomy.beside();
    let before = gpu.most_slots;
    gpu.most_entries = 300;
    assert_eq!(picture(&mut gpu, &case), want);
    assert!(gpu.most_slots < before, "no batch was split");
}
