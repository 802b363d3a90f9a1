//! Programs in the languages of Metal and Direct3D, and their memory on the smallest device.

use naga::back::pipeline_constants::process_overrides;
use naga::back::{PipelineConstants, hlsl, msl};
use naga::proc::Layouter;
use naga::{AddressSpace, Module, ShaderStage};

use super::{module, validator};
use crate::backend::gpu::passes::{KernelKind, Program, Variant};

/// Bytes of workgroup memory that every device has (the default limit of WebGPU).
const WORKGROUP_BYTES: u32 = 16 << 10;

/// What changes the size of arrays, or which branches there are.
const SETS: [&[(&str, f64)]; 3] = [
    &[],
    &[("FILTERED", 1.0), ("LAYERS", 4.0), ("NEAREST", 1.0), ("NORMAL", 4.0), ("PHONG", 1.0), ("FACE", 64.0)],
    &[("FILTERED", 1.0), ("LAYERS", 2.0), ("PEEL", 1.0), ("DEPTH", 4.0), ("VELOCITY", 5.0), ("GOURAUD", 1.0)],
];

/// A module whose constants are chosen.
fn chosen(program: Variant, set: &[(&str, f64)], write: impl FnOnce(&Module, &naga::valid::ModuleInfo)) {
    let module = module(program);
    let validate = |module: &Module| {
        let valid = validator(program).validate(module);
        valid.unwrap_or_else(|e| panic!("{}: {e:?}", program.entry()))
    };
    let info = validate(&module);
    let has = |name: &str| module.overrides.iter().any(|(_, constant)| constant.name.as_deref() == Some(name));
    let mut constants: PipelineConstants =
        set.iter().filter(|(name, _)| has(name)).map(|&(name, value)| (name.to_owned(), value)).collect();
    // A kind of kernels is always filtered, or never.
    if matches!(program.program, Program::Project | Program::Visibility | Program::Attribute) {
        let filtered = program.kernel == KernelKind::Filtered;
        constants.insert("FILTERED".to_owned(), f64::from(u8::from(filtered)));
    }
    let entry = Some((ShaderStage::Compute, program.entry()));
    let (module, info) = process_overrides(&module, &info, entry, &constants).unwrap();
    write(&module, &info);
}

#[test]
fn programs_are_written_for_metal_and_direct3d() {
    for program in Variant::all() {
        let entry_point = Some((ShaderStage::Compute, program.entry().to_owned()));
        for set in SETS {
            chosen(program, set, |module, info| {
                // Metal 2.1 has all that programs use; wgpu takes the newest that a device has.
                let options = msl::Options { lang_version: (2, 1), ..msl::Options::default() };
                let of_entry = msl::PipelineOptions { entry_point: entry_point.clone(), ..Default::default() };
                let (text, _) = msl::write_string(module, info, &options, &of_entry)
                    .unwrap_or_else(|e| panic!("{} for Metal: {e}", program.entry()));
                assert!(text.contains("kernel void"), "{}", program.entry());
                let mut options = hlsl::Options::default();
                if program.form.subgroups {
                    options.shader_model = hlsl::ShaderModel::V6_0;
                }
                let mut text = String::new();
                let of_entry = hlsl::PipelineOptions { entry_point: entry_point.clone() };
                hlsl::Writer::new(&mut text, &options, &of_entry)
                    .write(module, info, None)
                    .unwrap_or_else(|e| panic!("{} for Direct3D: {e}", program.entry()));
                assert!(text.contains("numthreads"), "{}", program.entry());
            });
        }
    }
}

#[test]
fn programs_take_no_more_workgroup_memory_than_every_device_has() {
    for program in Variant::all() {
        for set in SETS {
            chosen(program, set, |module, _| {
                let mut layouter = Layouter::default();
                layouter.update(module.to_ctx()).unwrap();
                let of_workgroup =
                    module.global_variables.iter().filter(|(_, var)| var.space == AddressSpace::WorkGroup);
                let bytes: u32 = of_workgroup.map(|(_, var)| layouter[var.ty].size.next_multiple_of(16)).sum();
                assert!(bytes <= WORKGROUP_BYTES, "{}: {bytes} bytes of workgroup memory", program.entry());
            });
        }
    }
}
