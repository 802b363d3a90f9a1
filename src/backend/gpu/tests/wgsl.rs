//! Programs are valid, and structs have the same layout on both sides.

use std::collections::BTreeSet;
use std::mem::offset_of;

use naga::front::wgsl;
use naga::proc::Layouter;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};

use crate::backend::cpu::transparent::project::{FAINTEST_DEPTH, LEAST_REACH, MOST_DEPTH};
use crate::backend::gpu::layout::{
    CaptureSegment, DIGIT_BITS, DeviceBackground, DeviceGaussian, Light, Segment, Status, TILE, Travel, View, WIDEST,
    WORKGROUP_ITEMS,
};
use crate::backend::gpu::programs::Program;
use crate::frame::Blocks;
use crate::layout::{EwaSplat, FLAG_BACK, FLAG_CROSSING, FLAG_LOW_PASS, FilteredSplat, Splat, SweptFilter, SweptSplat};

fn module(program: Program) -> Module {
    wgsl::parse_str(program.wgsl()).unwrap_or_else(|e| panic!("{}", e.emit_to_string(program.wgsl())))
}

#[test]
fn programs_are_valid() {
    for program in Program::ALL {
        let module = module(program);
        let valid = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
        let info = valid.unwrap_or_else(|e| panic!("{}: {e:?}", program.entry()));
        // The table names the buffers that the program uses, and no others.
        let index = module.entry_points.iter().position(|entry| entry.name == program.entry()).unwrap();
        let uses = info.get_entry_point(index);
        let (read, written) = program.buffers();
        let mut reached = BTreeSet::new();
        for (handle, global) in module.global_variables.iter() {
            let Some(binding) = &global.binding else { continue };
            if binding.group == 1 && !uses[handle].is_empty() {
                let AddressSpace::Storage { access } = global.space else { panic!("{:?}", global.name) };
                reached.insert((binding.binding, access.contains(StorageAccess::STORE)));
            }
        }
        let table =
            read.iter().map(|&slot| (slot as u32, false)).chain(written.iter().map(|&slot| (slot as u32, true)));
        assert_eq!(reached, table.collect(), "{}", program.entry());
        assert!(reached.len() <= 8, "{}: more buffers than every device has", program.entry());
    }
}

/// Name and offset of each member, and the size.
fn layout(module: &Module, name: &str) -> (Vec<(String, usize)>, usize) {
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).unwrap();
    let (handle, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).unwrap();
    let TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
    assert_eq!(layouter[handle].to_stride(), *span);
    (members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize)).collect(), *span as usize)
}

macro_rules! assert_same_layout {
    ($module:expr, $ty:ident { $($field:ident),+ $(,)? }) => {
        let rust = vec![$((stringify!($field).to_owned(), offset_of!($ty, $field))),+];
        assert_eq!(layout(&$module, stringify!($ty)), (rust, size_of::<$ty>()));
    };
}

#[test]
fn structs_lie_where_the_host_puts_them() {
    let module = module(Program::SumAttributes);
    assert_same_layout!(module, Splat { reference, inverse_depth, u, v, centre_depth, bounds, surfel, flags });
    assert_same_layout!(
        module,
        View {
            axis,
            offset,
            pixels,
            tiles,
            first_tile_row,
            slots,
            near,
            most_inverse_depth,
            low_pass,
            low_pass_scale,
            focal,
            stride,
            weight,
            entry_capacity,
            camera,
            material,
            first_light,
            lights,
            resumes,
            first_turn,
            last_turn,
            slope,
            blocks,
            corner,
            map_corner,
            map_tiles,
            sigma,
            footprint,
            first_place,
            surfels,
            opaque_scale,
            ends,
            environment,
            pixel,
            strip,
            first
        }
    );
    assert_same_layout!(
        module,
        Segment {
            screen,
            rate,
            normal,
            world,
            material,
            epsilon,
            handedness,
            weight,
            share,
            first_slot,
            first_surfel,
            surfels,
            buffer_surfels,
            buffer_start,
            index,
            first_light,
            flags
        }
    );
    assert_same_layout!(module, Travel { centre, motion, elapsed, advance, turn, pace, columns });
    assert_same_layout!(module, Light { vector, colour });
    let module = self::module(Program::BinScan);
    assert_same_layout!(module, Status { most_entries, splats_low, splats_high, left_out_low, left_out_high });
    let module = self::module(Program::PublishedSweep);
    assert_same_layout!(
        module,
        SweptSplat { reference, inverse_depth, u, v, u_rate, v_rate, motion, ends, bounds, surfel, flags }
    );
    let module = self::module(Program::Sweep);
    assert_same_layout!(module, SweptFilter { inverse_depth, u, v, u_rate, v_rate, k, peak, weight, coverage });
    assert_eq!(size_of::<FilteredSplat>(), 3 * size_of::<Splat>());
    assert_eq!(offset_of!(FilteredSplat, filtered), size_of::<SweptSplat>());
    let module = self::module(Program::EwaProject);
    assert_same_layout!(
        module,
        EwaSplat { disc, u, v, shrink, p, peak, weight, crossing, listed_bounds, filtered_bounds }
    );
    // The list of a filtered kernel is made of the bounds of its second half, and its flags are those of the first.
    assert_eq!(size_of::<EwaSplat>(), 2 * size_of::<Splat>());
    assert_eq!(offset_of!(EwaSplat, listed_bounds), size_of::<Splat>() + offset_of!(Splat, bounds));
    assert_eq!(offset_of!(EwaSplat, disc), 0);
    // Programs that read bounds and flags alone take a kernel in motion for two splats.
    assert_eq!(size_of::<SweptSplat>(), 2 * size_of::<Splat>());
    let (of_splat, of_swept) = (offset_of!(Splat, bounds), offset_of!(SweptSplat, bounds));
    assert_eq!(size_of::<Splat>() - of_splat, size_of::<SweptSplat>() - of_swept);
    let (of_splat, of_swept) = (offset_of!(Splat, flags), offset_of!(SweptSplat, flags));
    assert_eq!(size_of::<Splat>() - of_splat, size_of::<SweptSplat>() - of_swept);
}

#[test]
fn structs_of_captures_lie_where_the_host_puts_them() {
    let module = self::module(Program::GaussianProject);
    assert_same_layout!(
        module,
        CaptureSegment {
            screen,
            rate,
            centre,
            motion,
            eye,
            near,
            field,
            dilation,
            opacity,
            low,
            high,
            tint,
            first_slot,
            count,
            first_index,
            flags,
            harmonics_each,
            harmonics_used,
            area,
            layer,
            normal,
            world,
            material,
            first_light,
            lights,
            unused
        }
    );
    assert_same_layout!(
        module,
        DeviceGaussian { reference, along, slope, across, peak, colour, depth, velocity, bounds, index, layer }
    );
    // Pass `bin` takes it for a splat.
    assert_eq!(offset_of!(DeviceGaussian, bounds), offset_of!(Splat, bounds));
    let module = self::module(Program::TransparentResolve);
    assert_same_layout!(module, DeviceBackground { colour, shown });
}

#[test]
fn constants_are_the_hosts() {
    let bin = Program::BinScan.wgsl();
    for line in [
        format!("const TILE: u32 = {TILE}u;"),
        format!("const TILE_PIXELS: u32 = {}u;", TILE * TILE),
        format!("const WIDEST: u32 = {WIDEST}u;"),
        format!("const WORKGROUP_ITEMS: u32 = {WORKGROUP_ITEMS}u;"),
        format!("const DIGITS: u32 = {}u;", 1 << DIGIT_BITS),
    ] {
        assert!(bin.contains(&line), "{line}");
    }
    let cut = format!("const FAINTEST_DEPTH: f32 = {FAINTEST_DEPTH:?};\nconst LEAST_REACH: f32 = {LEAST_REACH:?};");
    let most = format!("const MOST_DEPTH: f32 = {MOST_DEPTH:?};");
    assert!(Program::Composite.wgsl().contains(&cut), "{cut}");
    assert!([cut, most].iter().all(|text| Program::GaussianProject.wgsl().contains(text)));
    let gathered = format!("const GATHERED: u32 = {WORKGROUP_ITEMS}u;");
    assert!(Program::Gather.wgsl().contains(&gathered), "{gathered}");
    let block = format!("const BLOCK: u32 = {}u;", Blocks::EDGE);
    assert!(bin.contains(&block), "{block}");
    for (name, flag) in [("BACK", FLAG_BACK), ("LOW_PASS", FLAG_LOW_PASS), ("CROSSING", FLAG_CROSSING)] {
        assert!(Program::Sweep.wgsl().contains(&format!("const FLAG_{name}: u32 = {flag}u;")), "{name}");
    }
}
