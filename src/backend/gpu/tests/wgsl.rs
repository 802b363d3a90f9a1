//! Programs are valid, and share structs and constants with the host.

mod constants;
mod structs;
mod writers;

use std::collections::BTreeSet;

use naga::front::wgsl;
use naga::valid::{Capabilities, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator};
use naga::{AddressSpace, Expression, Module, StorageAccess};

use crate::backend::gpu::passes::{TABLE, Variant};
use crate::backend::gpu::pipelines::overrides;
use crate::backend::gpu::texts::{FILES, INCLUDES};

fn module(program: Variant) -> Module {
    let text = program.wgsl();
    wgsl::parse_str(&text).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&text)))
}

/// Programs may use what every device has, and those for devices with subgroups their operations.
fn validator(program: Variant) -> Validator {
    if !program.form.subgroups {
        return Validator::new(ValidationFlags::all(), Capabilities::empty());
    }
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::SUBGROUP);
    validator.subgroup_stages(ShaderStages::COMPUTE).subgroup_operations(SubgroupOperationSet::all());
    validator
}

#[test]
fn programs_are_valid() {
    for program in Variant::all() {
        let module = module(program);
        let valid = validator(program).validate(&module);
        let info = valid.unwrap_or_else(|e| panic!("{}: {e:?}", program.entry()));
        // The table names the buffers that the program uses, and no others.
        let index = module.entry_points.iter().position(|entry| entry.name == program.entry()).unwrap();
        let uses = info.get_entry_point(index);
        let row = program.program.row();
        let mut reached = BTreeSet::new();
        for (handle, global) in module.global_variables.iter() {
            let Some(binding) = &global.binding else { continue };
            if binding.group == 1 && !uses[handle].is_empty() {
                let AddressSpace::Storage { access } = global.space else { panic!("{:?}", global.name) };
                reached.insert((binding.binding, access.contains(StorageAccess::STORE)));
            }
        }
        let table = row
            .reads
            .iter()
            .map(|&slot| (slot as u32, false))
            .chain(row.writes.iter().map(|&slot| (slot as u32, true)));
        assert_eq!(reached, table.collect(), "{}", program.entry());
        assert!(reached.len() <= 8, "{}: more buffers than every device has", program.entry());
    }
}

/// A file that no program has is dead, and yet it looks as if it did something.
#[test]
fn programs_have_every_file() {
    let used: BTreeSet<&str> = Variant::all().into_iter().flat_map(Variant::texts).collect();
    for text in files() {
        let begins = text.lines().take(2).collect::<Vec<_>>().join(" ");
        assert!(used.contains(&*text), "a file is in no program: {begins}");
        let includes = text.lines().filter_map(|line| line.strip_prefix(INCLUDES)).flat_map(str::split_whitespace);
        for name in includes.map(|name| format!("{name}.wgsl")) {
            assert!(FILES.iter().any(|(other, _)| *other == name), "{name}, which is not there: {begins}");
        }
    }
    let all = files();
    assert!(FILES.iter().all(|(_, text)| all.iter().any(|other| other == text)), "a file was built in, and is gone");
}

/// Each program names a function of the CPU that is there.
#[test]
fn functions_of_the_cpu_are_there() {
    for row in &TABLE {
        let (file, function) = row.twin;
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/backend/cpu").join(file);
        let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", row.entry));
        assert!(
            ["(", "<"].iter().any(|open| text.contains(&format!("fn {function}{open}"))),
            "{}: {file} has no `{function}`",
            row.entry
        );
    }
}

/// Constants are found by their text: none must be overlooked.
#[test]
fn overrides_are_found() {
    for variant in Variant::all() {
        let module = module(variant);
        let constants = module.overrides.iter().filter(|(_, constant)| {
            constant.init.is_some_and(|init| matches!(module.global_expressions[init], Expression::Literal(_)))
        });
        let mut names: BTreeSet<_> = constants.map(|(_, constant)| constant.name.clone().unwrap()).collect();
        if let Some(some) = variant.program.row().constants {
            assert!(some.iter().all(|name| names.contains(*name)), "{}", variant.entry());
            names.retain(|name| some.contains(&name.as_str()));
        }
        let found: BTreeSet<_> = overrides(variant).into_iter().map(str::to_owned).collect();
        assert_eq!(found, names, "{}", variant.entry());
    }
}

/// The texts of all files in `shaders/`.
fn files() -> Vec<String> {
    let mut folders = vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders")];
    let mut texts = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                texts.push(std::fs::read_to_string(path).unwrap());
            }
        }
    }
    texts
}

/// The names that all files define by this word, `const` or `struct`, at the start of a line.
fn defined(word: &str) -> BTreeSet<String> {
    let name = |line: &str| {
        let rest = line.strip_prefix(word)?.strip_prefix(' ')?;
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_')?;
        Some(rest[..end].to_owned())
    };
    files().iter().flat_map(|text| text.lines().filter_map(name).collect::<Vec<_>>()).collect()
}
