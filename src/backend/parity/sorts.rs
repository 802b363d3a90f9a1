//! The sort of depths against the standard library's stable sort.

use super::harness::read;
use super::{cases, gpu_or_skip};
use crate::backend::gpu::Gpu;
use crate::backend::gpu::layout::WORKGROUP_ITEMS;
use crate::backend::gpu::passes::Variant;
use crate::backend::gpu::slots::Slot;
use crate::backend::gpu::upload::Placed;
use crate::math::random::Random;

/// The places of `keys` in their order, by the device.
fn sorted(gpu: &mut Gpu, keys: &[u32]) -> Vec<u32> {
    let n = keys.len();
    let slots: Vec<u32> = (0..n as u32).collect();
    let totals = [(n as u32).div_ceil(WORKGROUP_ITEMS), 1, 1, n as u32];
    let frame = cases::all()[0].frame();
    let prepared = gpu.prepare(&frame).unwrap();
    gpu.make_room_to_sort(n as u64);
    for (slot, numbers) in [(Slot::Keys, keys), (Slot::List, &slots), (Slot::Totals, &totals)] {
        gpu.state.device.write(&gpu.state.buffers[slot], 0, bytemuck::cast_slice(numbers));
    }
    gpu.recorded(&prepared, |recorder| recorder.sort(false, &Placed::default())).unwrap();
    read(gpu, &gpu.state.buffers[Slot::List], n)
}

/// Sorts keys that are hard on a sort.
fn check(gpu: &mut Gpu, counts: &[u32]) -> Result<(), String> {
    let mut random = Random(1);
    for &n in counts {
        let mut number = || (f64::from(random.next()) * 4_294_967_296.0) as u32;
        let sets: [(&str, Vec<u32>); 7] = [
            ("random", (0..n).map(|_| number()).collect()),
            ("equal", vec![0x8765_4321; n as usize]),
            ("rising", (0..n).map(|i| i * 14_000).collect()),
            ("falling", (0..n).map(|i| u32::MAX - i).collect()),
            ("few", (0..n).map(|_| number() >> 30 << 30).collect()),
            ("close", (0..n).map(|_| 0xbf80_0000 + (number() >> 22)).collect()),
            ("ends", (0..n).map(|i| if i % 3 == 0 { u32::MAX } else { i % 2 }).collect()),
        ];
        for (name, keys) in sets {
            let mut want: Vec<u32> = (0..n).collect();
            want.sort_by_key(|&place| keys[place as usize]);
            if sorted(gpu, &keys) != want {
                return Err(format!("{n} keys, {name}"));
            }
        }
    }
    Ok(())
}

#[test]
fn depths_are_sorted_and_ties_stay_in_order() {
    let Some(mut gpu) = gpu_or_skip("depths_are_sorted_and_ties_stay_in_order") else { return };
    let counts = [1, 2, 63, 64, 65, 1023, 1024, 1025, 5000, 100_000, 300_001];
    let has_subgroups = gpu.state.device.form.subgroups;
    for subgroups in [false, has_subgroups] {
        gpu.state.device.form.subgroups = subgroups;
        check(&mut gpu, &counts).unwrap_or_else(|what| panic!("subgroups {subgroups}: {what}"));
    }
}

#[test]
#[ignore = "deep: broken programs"]
fn broken_sorts_are_noticed() {
    static BROKEN: [[(&str, &str); 1]; 10] = [
        [("place += select(0u, 1u, digits[before] == digit)", "place += select(0u, 1u, digits[before] > digit)")],
        [("place += entries", "place += 0u * entries")],
        [("place += digit_totals[digit]", "place += 1u")],
        [("(sorted_keys[i] >> SHIFT)", "(sorted_keys[i] >> (SHIFT & 15u))")],
        [("histogram[at] = before + result.before.x", "histogram[at] = result.before.x")],
        [("sum += scanned[lane - distance]", "sum += scanned[lane]")],
        [("if other == lane / size { before += total; }", "")],
        [("scanned[run * size + place] = before_in_run", "scanned[run * size + place] = own")],
        [("sums_of_runs[run] = before_in_run + own", "sums_of_runs[run] = before_in_run")],
        [("atomicAdd(&runs_taken, 1u)", "atomicAdd(&runs_taken, 2u) / 4u")],
    ];
    let Some(mut gpu) = gpu_or_skip("broken_sorts_are_noticed") else { return };
    check(&mut gpu, &[1025]).unwrap_or_else(|what| panic!("{what}"));
    let has_subgroups = gpu.state.device.form.subgroups;
    let intact = std::mem::take(&mut gpu.state.pipelines);
    for pair in &BROKEN {
        let mut having = Variant::all().into_iter().filter(|variant| variant.wgsl().contains(pair[0].0)).peekable();
        assert!(having.peek().is_some(), "no program has {pair:?}");
        gpu.state.pipelines = intact.with(pair);
        // A scan has two forms.
        let subgroups = having.all(|variant| variant.form.subgroups);
        if subgroups && !has_subgroups {
            continue;
        }
        gpu.state.device.form.subgroups = subgroups;
        // The last has more than 256 workgroups.
        let Err(what) = check(&mut gpu, &[1025, 300_000]) else { panic!("{pair:?} was not noticed") };
        eprintln!("{pair:?}: {what}");
    }
}
