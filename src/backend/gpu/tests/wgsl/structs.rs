//! Structs in buffers have the same layout on both sides.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::offset_of;

use naga::proc::Layouter;
use naga::{AddressSpace, Handle, Module, Type, TypeInner};

use super::module;
use crate::backend::gpu::layout::{
    CaptureSegment, DeviceBackground, DeviceGaussian, Light, Segment, Status, Totals, View,
};
use crate::backend::gpu::passes::Variant;
use crate::layout::{EwaSplat, FilteredSplat, Splat, SweptFilter, SweptSplat};

/// Name and offset of each field in bytes, and the size.
#[derive(Clone, Debug, PartialEq)]
struct Layout {
    fields: Vec<(String, usize)>,
    size: usize,
}

/// The layout of a Rust struct, under its name. Fields that only pad it are left out.
macro_rules! layout {
    ($ty:ident { $($field:ident),+ $(,)? }) => {
        (stringify!($ty), Layout {
            fields: vec![$((stringify!($field).to_owned(), offset_of!($ty, $field))),+],
            size: size_of::<$ty>(),
        })
    };
}

/// The structs that the host shares with programs, by their names in WGSL. A name stands twice where programs have two
/// structs of that name.
#[allow(clippy::too_many_lines, reason = "a list of fields")]
fn shared() -> Vec<(&'static str, Layout)> {
    let mut shared = vec![
        layout!(Splat { reference, inverse_depth, u, v, centre_depth, bounds, surfel, flags }),
        layout!(View {
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
            round_tiles,
            first_place,
            opaque_scale,
            flags,
            rest,
            environment,
            pixel,
            strip,
            first,
            views,
            number,
            first_tile,
            first_slot,
            same_film,
            film_tile,
            first_segment,
            first_moment,
            walks,
            stretch,
            epsilon,
            casters
        }),
        layout!(Segment {
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
            flags,
            centre,
            motion,
            elapsed,
            advance,
            turn,
            pace,
            columns,
            view,
            middle,
            axes
        }),
        layout!(Light { vector, colour }),
        layout!(Status {
            most_entries,
            splats_low,
            splats_high,
            left_out_low,
            left_out_high,
            longest,
            chain_low,
            chain_high,
            walks,
            filled,
            last_walks,
            last_longest,
            last_tiles
        }),
        layout!(SweptSplat { reference, inverse_depth, u, v, u_rate, v_rate, motion, ends, bounds, surfel, flags }),
        layout!(EwaSplat { disc, u, v, shrink, p, peak, weight, crossing, listed_bounds, filtered_bounds }),
        layout!(CaptureSegment {
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
            view,
            unused
        }),
        layout!(DeviceGaussian {
            reference,
            along,
            slope,
            across,
            peak,
            colour,
            depth,
            velocity,
            bounds,
            index,
            layer
        }),
        layout!(DeviceBackground { colour, shown }),
        layout!(Totals { groups, entries, wide, columns, rows, layers }),
        layout!(SweptFilter { inverse_depth, u, v, u_rate, v_rate, k, peak, weight, coverage }),
    ];
    // Programs name a kernel in motion alike, with its filter and without: the fields of the kernel, then the filter.
    let mut filtered =
        layout!(SweptSplat { reference, inverse_depth, u, v, u_rate, v_rate, motion, ends, bounds, surfel, flags }).1;
    filtered.fields.push(("filtered".to_owned(), offset_of!(FilteredSplat, filtered)));
    filtered.size = size_of::<FilteredSplat>();
    shared.push(("SweptSplat", filtered));
    shared
}

/// The layout of a struct of a program.
fn layout(module: &Module, handle: Handle<Type>) -> Layout {
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).unwrap();
    let TypeInner::Struct { members, span } = &module.types[handle].inner else { panic!("no struct") };
    assert_eq!(layouter[handle].to_stride(), *span);
    let fields = members.iter().map(|member| (member.name.clone().unwrap(), member.offset as usize)).collect();
    Layout { fields, size: *span as usize }
}

/// The structs that lie in a buffer, and those within them.
fn in_buffers(module: &Module) -> BTreeSet<Handle<Type>> {
    let in_memory = |space| matches!(space, AddressSpace::Uniform | AddressSpace::Storage { .. });
    let globals = module.global_variables.iter().filter(|(_, global)| in_memory(global.space));
    let mut waiting: Vec<Handle<Type>> = globals.map(|(_, global)| global.ty).collect();
    let mut found = BTreeSet::new();
    while let Some(handle) = waiting.pop() {
        match &module.types[handle].inner {
            TypeInner::Array { base, .. } => waiting.push(*base),
            TypeInner::Struct { members, .. } => {
                found.insert(handle);
                waiting.extend(members.iter().map(|member| member.ty));
            }
            _ => {}
        }
    }
    found
}

#[test]
fn structs_lie_where_the_host_puts_them() {
    let shared = shared();
    let mut met = BTreeMap::new();
    for program in Variant::all() {
        let module = module(program);
        for handle in in_buffers(&module) {
            let name = module.types[handle].name.clone().unwrap();
            let own = layout(&module, handle);
            let hosts = || shared.iter().enumerate().filter(|(_, (host, _))| *host == name);
            let same = hosts().find(|(_, (_, layout))| *layout == own).map(|(index, _)| index);
            let Some(index) = same else {
                let hosts: Vec<_> = hosts().map(|(_, (_, layout))| layout).collect();
                panic!("{name} of {} is {own:?}, but the host has {hosts:?}", program.entry());
            };
            met.entry(name).or_insert_with(BTreeSet::new).insert(index);
        }
    }
    // No row is left over.
    let rows: BTreeSet<usize> = met.values().flatten().copied().collect();
    assert_eq!(rows.len(), shared.len(), "{met:?}");
}

/// Programs of pass `bin` read bounds and flags alone, and take all kernels for splats.
#[test]
fn kernels_can_be_taken_for_splats() {
    // The list of a filtered kernel is made of the bounds of its second half, and its flags are those of the first.
    assert_eq!(size_of::<EwaSplat>(), 2 * size_of::<Splat>());
    assert_eq!(offset_of!(EwaSplat, listed_bounds), size_of::<Splat>() + offset_of!(Splat, bounds));
    assert_eq!(offset_of!(EwaSplat, disc), 0);
    assert_eq!(size_of::<SweptSplat>(), 2 * size_of::<Splat>());
    let (of_splat, of_swept) = (offset_of!(Splat, bounds), offset_of!(SweptSplat, bounds));
    assert_eq!(size_of::<Splat>() - of_splat, size_of::<SweptSplat>() - of_swept);
    let (of_splat, of_swept) = (offset_of!(Splat, flags), offset_of!(SweptSplat, flags));
    assert_eq!(size_of::<Splat>() - of_splat, size_of::<SweptSplat>() - of_swept);
    assert_eq!(size_of::<FilteredSplat>(), 3 * size_of::<Splat>());
    assert_eq!(offset_of!(FilteredSplat, splat), 0);
    assert_eq!(offset_of!(DeviceGaussian, bounds), offset_of!(Splat, bounds));
}
