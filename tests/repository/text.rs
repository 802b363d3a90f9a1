//! Text: widths of lines, lengths of guides, and words that must not be in the repository.

use std::fs;
use std::path::{Path, PathBuf};

/// Columns of a line of code.
const WIDTH: usize = 120;

/// Words of a guide.
const GUIDE: usize = 1500;

/// Documents in `docs/` that are manuals, and may be longer.
fn is_manual(name: &str) -> bool {
    name == "math.md" || name.ends_with("format.md")
}

/// Files that are wider and are known. To be empty.
const KNOWN_WIDE: &[&str] = &[
    "benches/modes.rs",
    "benches/reference.rs",
    "benches/render.rs",
    "examples/pixel_sums.rs",
    "examples/table_auto.rs",
    "examples/table_modes.rs",
    "examples/table_reference.rs",
    "src/anim/breaks.rs",
    "src/anim/curve.rs",
    "src/anim/error.rs",
    "src/anim/maya.rs",
    "src/anim/maya/tests.rs",
    "src/anim/maya/units.rs",
    "src/anim/mod.rs",
    "src/anim/node.rs",
    "src/anim/segment.rs",
    "src/anim/tangent.rs",
    "src/auto/estimate.rs",
    "src/auto/halves.rs",
    "src/auto/mod.rs",
    "src/auto/path.rs",
    "src/backend/gpu/buffers.rs",
    "src/backend/gpu/device.rs",
    "src/backend/gpu/execute.rs",
    "src/backend/gpu/film.rs",
    "src/backend/gpu/flight.rs",
    "src/backend/gpu/layer.rs",
    "src/backend/gpu/mod.rs",
    "src/backend/gpu/schedule.rs",
    "src/backend/gpu/tests/functions.rs",
    "src/backend/gpu/tests/mod.rs",
    "src/backend/gpu/tests/parity.rs",
    "src/backend/gpu/tests/swept.rs",
    "src/backend/gpu/waves.rs",
    "src/cli/common.rs",
    "src/cli/compare.rs",
    "src/cli/convert.rs",
    "src/cli/info.rs",
    "src/cli/inspect.rs",
    "src/cli/modes.rs",
    "src/cli/movie.rs",
    "src/cli/reference.rs",
    "src/cli/render.rs",
    "src/cli/report.rs",
    "src/cli/sequence.rs",
    "src/cli/settings.rs",
    "src/cli/sheet.rs",
    "src/cli/trial.rs",
    "src/compare/filter.rs",
    "src/compare/flip.rs",
    "src/compare/mod.rs",
    "src/compare/pixels.rs",
    "src/compare/ssim.rs",
    "src/compare/tests.rs",
    "src/frame/mod.rs",
    "src/layout.rs",
    "src/math/fast.rs",
    "src/math/mod.rs",
    "src/math/simd.rs",
    "src/math/srgb.rs",
    "src/math/sweep.rs",
    "src/math/trs.rs",
    "src/model/complete.rs",
    "src/model/gaussian.rs",
    "src/model/generate.rs",
    "src/model/mod.rs",
    "src/model/neighbours.rs",
    "src/model/normals.rs",
    "src/model/obj.rs",
    "src/model/order.rs",
    "src/model/orient.rs",
    "src/model/ply_body.rs",
    "src/model/radii.rs",
    "src/model/sfl_container.rs",
    "src/options.rs",
    "src/plan.rs",
    "src/reconstruct.rs",
    "src/reference/bvh.rs",
    "src/reference/mod.rs",
    "src/reference/posed.rs",
    "src/reference/probe.rs",
    "src/reference/reach.rs",
    "src/reference/sampler.rs",
    "src/reference/store.rs",
    "src/reference/sums.rs",
    "src/reference/trace.rs",
    "src/reference/traverse.rs",
    "src/reference/warp.rs",
    "src/study/report/chart.rs",
    "src/study/report/floor.rs",
    "src/study/report/maps.rs",
    "src/study/report/mod.rs",
    "src/study/report/page.rs",
    "src/study/report/regions.rs",
    "src/study/report/ztest.rs",
    "src/study/sheet/crop.rs",
    "tests/cli/hostile_input.rs",
    "tests/cli/reference.rs",
    "tests/cli/render.rs",
    "tests/cli/report.rs",
    "tests/render/image_files.rs",
    "tests/render/kernels_in_motion.rs",
    "tests/render/modes.rs",
    "tests/repository/modules.rs",
    "tests/scene/anim.rs",
    "tests/scene/files.rs",
    "tests/scene/model_formats/hostile.rs",
    "tests/scene/model_formats/ply.rs",
];

/// Guides that are longer and are known. To be empty.
const KNOWN_LONG: &[&str] = &["docs/architecture.md", "docs/modes.md", "docs/reference.md"];

/// Files that cite what is not in the repository and are known. To be empty.
const KNOWN_CITING: &[&str] = &[
    "src/frame/mod.rs",
    "src/math/fast.rs",
    "src/options.rs",
    "src/reference/mod.rs",
    "src/reference/posed.rs",
    "src/reference/trace.rs",
    "src/reference/traverse.rs",
];

/// Folders at the root whose files are ours; build folders are not among them.
const FOLDERS: [&str; 11] =
    [".ci", ".github", "animations", "benches", "docs", "examples", "fuzz", "scenes", "shaders", "src", "tests"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All text files of the repository, by their path below its root.
fn files() -> Vec<(String, String)> {
    let mut paths: Vec<PathBuf> = fs::read_dir(root()).unwrap().map(|entry| entry.unwrap().path()).collect();
    // `.git` is a file in a second work tree.
    paths.retain(|path| path.is_file() && !path.ends_with(".git"));
    for folder in FOLDERS {
        walk(&root().join(folder), &mut paths);
    }
    paths.sort();
    let text = |path: PathBuf| {
        let name = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        // Whatever is no UTF-8 is no text.
        fs::read_to_string(path).ok().map(|text| (name, text))
    };
    paths.into_iter().filter_map(text).collect()
}

fn walk(folder: &Path, paths: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            // Build folders of the fuzz targets.
            if !path.ends_with("fuzz/target") && !path.ends_with("fuzz/artifacts") {
                walk(&path, paths);
            }
        } else {
            paths.push(path);
        }
    }
}

/// What a check found: a line each, and the file. Files that are known do not count, but must be needed.
fn judge(found: &[(String, String)], known: &[&str], list: &str, what: &str) {
    let unknown: Vec<&str> =
        found.iter().filter(|(name, _)| !known.contains(&name.as_str())).map(|(_, line)| line.as_str()).collect();
    assert!(unknown.is_empty(), "{what}:\n{}", unknown.join("\n"));
    let needed = |name: &&&str| found.iter().any(|(file, _)| file == **name);
    let idle: Vec<&&str> = known.iter().filter(|name| !needed(name)).collect();
    assert!(idle.is_empty(), "{list} no longer needs {idle:#?}");
}

#[test]
fn lines_of_code_fit_their_width() {
    let mut found = Vec::new();
    for (name, text) in files() {
        if ["rs", "wgsl"].iter().any(|code| Path::new(&name).extension().is_some_and(|e| e == *code)) {
            for (number, line) in (1..).zip(text.lines()) {
                let columns = line.chars().count();
                if columns > WIDTH {
                    found.push((name.clone(), format!("{name}:{number}: {columns} columns")));
                }
            }
        }
    }
    judge(&found, KNOWN_WIDE, "KNOWN_WIDE", "lines wider than 120 columns");
}

#[test]
fn guides_are_short() {
    let mut found = Vec::new();
    for (path, text) in files() {
        let Some(name) = path.strip_prefix("docs/").filter(|name| !name.contains('/') && name.contains(".md")) else {
            continue;
        };
        let words = text.split_whitespace().count();
        if words > GUIDE && !is_manual(name) {
            found.push((path.clone(), format!("{path}: {words} words")));
        }
    }
    judge(&found, KNOWN_LONG, "KNOWN_LONG", "guides of more than 1500 words");
}

/// A reader has only what the repository holds: not the notes that it was planned with, and not the folders of the
/// computer on which it was written.
#[test]
fn nothing_outside_the_repository_is_cited() {
    // In two halves, so that this file does not contain them.
    let citations = [["design ", "section"], ["Design ", "section"], ["design's ", "section"], ["design ", "page"]];
    let citations: Vec<String> = citations.iter().map(|halves| halves.concat()).collect();
    let folders: Vec<String> = [["/ho", "me/"], ["/ro", "ot/"], ["/wo", "rk/"], ["/Us", "ers/"]]
        .iter()
        .map(|halves| halves.concat())
        .collect();
    let mut found = Vec::new();
    for (name, text) in files() {
        // Lists of what may be asked of a registry, not prose.
        if name.ends_with("Cargo.lock") {
            continue;
        }
        for (number, line) in (1..).zip(text.lines()) {
            let cited = citations.iter().find(|citation| line.contains(citation.as_str()));
            let folder = folders.iter().find(|folder| absolute(line, folder));
            if let Some(what) = cited.or(folder) {
                found.push((name.clone(), format!("{name}:{number}: `{what}`")));
            }
        }
    }
    judge(&found, KNOWN_CITING, "KNOWN_CITING", "citations of what is not in the repository");
}

/// Does a path begin with this folder, and not merely contain it?
fn absolute(line: &str, folder: &str) -> bool {
    line.match_indices(folder).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        before.is_none_or(|c| !(c.is_alphanumeric() || "._-/*}~$)".contains(c)))
    })
}
