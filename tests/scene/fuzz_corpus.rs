//! Replays `fuzz/corpus/` on stable Rust, through the functions that read files.
//!
//! A name that begins with `ok-` must be read, one that begins with `bad-` must be refused; others (what a fuzzer
//! found) may be either, but nothing may panic or take long. A new reader gets a row here, a target in `fuzz/` and a
//! directory of seeds.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, reason = "tests may stop and report")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use splatblur::{anim, image, model, scene_file};

use crate::support;

/// Most that one small file may take to be read or refused: no file is a hang. The clock counts other tests, too.
const PATIENCE: Duration = Duration::from_secs(10);

/// Reads a whole file.
type Read = fn(&Path) -> anyhow::Result<()>;

/// Target (a folder of the corpus), extension that the file is read under, reader.
const TARGETS: [(&str, &str, Read); 21] = [
    ("anim", "anim", |path| read_animation(path)),
    ("bin", "bin", |path| read_model(path)),
    ("e57", "e57", |path| read_model(path)),
    ("glb", "glb", |path| read_model(path)),
    ("gltf", "glb", |path| read_mesh(path)),
    ("image", "img", |path| Ok(image::read(path).map(drop)?)),
    ("las", "las", |path| read_model(path)),
    ("mesh_obj", "obj", |path| read_mesh(path)),
    ("mtl", "mtl", |path| read_library(path)),
    ("npy", "npy", |path| read_model(path)),
    ("npz", "npz", |path| read_model(path)),
    ("nrrd", "nrrd", |path| read_volume(path)),
    ("obj", "obj", |path| read_model(path)),
    ("ply", "ply", |path| read_model(path)),
    ("pts", "pts", |path| read_model(path)),
    ("scene", "xml", |path| Ok(scene_file::load(path, &scene_file::SceneLoadOptions::default()).map(drop)?)),
    ("sfl", "sfl", |path| read_model(path)),
    ("sog", "sog", |path| read_model(path)),
    ("splat", "splat", |path| read_model(path)),
    ("spz", "spz", |path| read_model(path)),
    ("xyz", "xyz", |path| read_model(path)),
];

/// Targets that need the Cargo feature `formats`.
const OF_FORMATS: [&str; 5] = ["e57", "las", "npz", "sog", "spz"];

fn read_model(path: &Path) -> anyhow::Result<()> {
    let loaded = model::load(path, &model::LoadOptions::default(), &|_, _| {})?;
    if !matches!(loaded.shape, model::LoadedShape::Surfels(..)) {
        let g = support::gaussians(loaded);
        assert!(!g.is_empty(), "a capture without Gaussians was accepted");
        for i in 0..g.len() {
            let vectors = [g.position[i], g.sigma[i], g.base[i]];
            assert!(vectors.iter().all(|v| v.is_finite()), "Gaussian {i} is not finite");
            assert!(g.rotation[i].is_normalized(), "Gaussian {i} has no rotation");
        }
    }
    let surfels = model::LoadOptions { kind: Some(model::Kind::Surfels), ..model::LoadOptions::default() };
    let s = support::surfels(model::load(path, &surfels, &|_, _| {})?);
    assert!(!s.is_empty(), "a model without surfels was accepted");
    for i in 0..s.len() {
        let vectors = [s.position[i], s.axis_u[i], s.axis_v[i], s.normal[i], s.colour[i]];
        assert!(vectors.iter().all(|v| v.is_finite()), "surfel {i} is not finite");
        assert!(s.radius(i) > 0.0, "surfel {i} has no radius");
    }
    Ok(())
}

/// Reads the triangles of a file, and its animations if it is glTF.
fn read_mesh(path: &Path) -> anyhow::Result<()> {
    let bytes = fs::read(path)?;
    let format = model::ModelFormat::detect(&bytes, path).ok_or_else(|| anyhow::anyhow!("{}", path.display()))?;
    let invalid = |why| model::ModelError::Invalid { path: path.to_owned(), why };
    let mesh = model::mesh::read(&bytes, format, path, None).map_err(invalid)?;
    let mesh = mesh.ok_or_else(|| anyhow::anyhow!("{} has no triangles", path.display()))?;
    assert!(!mesh.triangles.is_empty(), "a mesh without triangles was accepted");
    for triangle in &mesh.triangles {
        assert!((triangle.material as usize) < mesh.materials.len());
        let positions = triangle.corners.map(|corner| mesh.position[corner as usize]);
        assert!(positions.iter().all(|p| p.is_finite()), "a corner is not finite");
    }
    let columns = [mesh.normal.len(), mesh.uv.len(), mesh.colour.len()];
    assert!(columns.iter().all(|n| [0, mesh.position.len()].contains(n)), "{columns:?}");
    if format != model::ModelFormat::Obj
        && let anim::AnimationFile::Gltf(animation) = anim::open(path)?
    {
        for looped in [false, true] {
            let chain = animation.bind(None, 24.0, looped)?;
            assert!([-1e8, -1.0, 0.0, 0.51, 1e8].iter().all(|seconds| chain.at(*seconds).is_finite()));
        }
    }
    Ok(())
}

/// Reads a material library through an OBJ beside it.
fn read_library(path: &Path) -> anyhow::Result<()> {
    let obj = path.with_extension("obj");
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b c\nf 1 2 3\n";
    fs::write(&obj, format!("mtllib {}\n{corners}", path.file_name().unwrap().display()))?;
    let mesh = model::MeshOptions { spacing: model::Spacing::Surfels(100), reduce: true };
    model::load(&obj, &model::LoadOptions { mesh, ..model::LoadOptions::default() }, &|_, _| {})?;
    Ok(())
}

fn read_volume(path: &Path) -> anyhow::Result<()> {
    let volume = model::VolumeOptions { flatten: 3.0, lit: true, ..model::VolumeOptions::default() };
    for volume in [model::VolumeOptions::default(), volume] {
        let options = model::LoadOptions { volume, ..model::LoadOptions::default() };
        let g = support::gaussians(model::load(path, &options, &|_, _| {})?);
        assert!(!g.is_empty(), "a volume without kernels was accepted");
        for i in 0..g.len() {
            assert!([g.position[i], g.sigma[i], g.base[i]].iter().all(|v| v.is_finite()), "kernel {i} is not finite");
            assert!(g.rotation[i].is_normalized() && g.opacity[i].is_finite() && g.opacity[i] > 0.0, "kernel {i}");
        }
    }
    Ok(())
}

fn read_animation(path: &Path) -> anyhow::Result<()> {
    let animation = anim::load(path)?;
    assert!(!animation.nodes.is_empty(), "an animation without nodes was accepted");
    for node in &animation.nodes {
        for seconds in [-1e8, -1.0, 0.0, 0.51, 1e8] {
            for interpolation in [anim::Interpolation::Maya, anim::Interpolation::Linear, anim::Interpolation::Spline] {
                let state = node.at(seconds, interpolation);
                assert!(state.transform.translate.is_finite(), "{} at {seconds} s is not finite", node.name);
            }
        }
    }
    Ok(())
}

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus")
}

/// Sorted names of a directory's entries; the directory must exist and not be empty.
fn names(directory: &Path) -> Vec<String> {
    let entries = fs::read_dir(directory).unwrap_or_else(|e| panic!("{}: {e}", directory.display()));
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    assert!(!names.is_empty(), "{} is empty", directory.display());
    names.sort();
    names
}

/// Reads every file of a target; gives what was wrong.
fn replay(target: &str, extension: &str, read: Read) -> Vec<String> {
    let directory = corpus().join(target);
    // Scenes name these two; whatever a target reads lies beside them under one name.
    let placed = |name: String| {
        let place = tempfile::tempdir().unwrap();
        fs::copy(corpus().join("ply/ok-surfels.ply"), place.path().join("model.ply")).unwrap();
        fs::copy(corpus().join("anim/ok-two-keys.anim"), place.path().join("motion.anim")).unwrap();
        fs::copy(directory.join(&name), place.path().join("input").with_extension(extension)).unwrap();
        (name, place)
    };
    // All are written before one is read: a file is opened when it has been at rest for a while.
    let places: Vec<_> = names(&directory).into_iter().map(placed).collect();
    let mut wrong = Vec::new();
    let (mut accepted, mut refused) = (0, 0);
    for (name, place) in &places {
        let input = place.path().join("input").with_extension(extension);
        let start = Instant::now();
        let result = read(&input);
        let took = start.elapsed();
        if took > PATIENCE {
            wrong.push(format!("{target}/{name}: took {took:?}"));
        }
        match result {
            Ok(()) if name.starts_with("bad-") => wrong.push(format!("{target}/{name}: was read")),
            Err(e) if name.starts_with("ok-") => wrong.push(format!("{target}/{name}: {e:#}")),
            Ok(()) => accepted += 1,
            Err(e) => {
                refused += 1;
                // Whatever is wrong lies in this file, or in one that it names beside itself.
                let line = format!("{e:#}");
                if !line.contains(&place.path().display().to_string()) || line.lines().count() != 1 {
                    wrong.push(format!("{target}/{name}: the message is not one line that names the file: {line:?}"));
                }
                let causes: Vec<String> = e.chain().map(ToString::to_string).collect();
                if causes.windows(2).any(|pair| pair[0].contains(&pair[1])) {
                    wrong.push(format!("{target}/{name}: the message says the same twice: {line:?}"));
                }
            }
        }
    }
    if accepted == 0 || refused == 0 {
        wrong.push(format!("{target}: {accepted} seeds are read and {refused} refused; each kind needs some"));
    }
    wrong
}

// Not deep: the only test of what fuzzers found.
#[test]
fn every_seed_is_read_or_refused_as_its_name_says() {
    let there = TARGETS.iter().filter(|(target, ..)| cfg!(feature = "formats") || !OF_FORMATS.contains(target));
    let wrong: Vec<String> = there.flat_map(|&(target, ending, read)| replay(target, ending, read)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_target_has_seeds_and_a_program() {
    let rows: BTreeSet<String> = TARGETS.iter().map(|(target, _, _)| (*target).to_owned()).collect();
    let directories: BTreeSet<String> = names(&corpus()).into_iter().collect();
    assert_eq!(directories, rows);
    let programs = names(&corpus().parent().unwrap().join("fuzz_targets"));
    let programs: BTreeSet<String> = programs.iter().map(|p| p.trim_end_matches(".rs").to_owned()).collect();
    assert_eq!(programs, rows);
    let manifest = fs::read_to_string(corpus().parent().unwrap().join("Cargo.toml")).unwrap();
    for row in rows {
        assert!(manifest.contains(&format!("name = \"{row}\"")), "fuzz/Cargo.toml has no target {row}");
    }
}

#[test]
fn the_seeds_stay_small() {
    let sizes = TARGETS.iter().flat_map(|(target, _, _)| {
        let directory = corpus().join(target);
        names(&directory).into_iter().map(move |name| fs::metadata(directory.join(name)).unwrap().len())
    });
    assert!(sizes.sum::<u64>() <= 350_000);
}
