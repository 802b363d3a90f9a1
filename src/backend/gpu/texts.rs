//! The texts of programs. A file of WGSL names the files that belong before it.

/// Files of `shaders/`, each with its name.
macro_rules! files {
    ($($file:literal),+ $(,)?) => { &[$(($file, include_str!(concat!("../../../shaders/", $file)))),+] };
}

/// How a line begins that names files, without their endings, that belong before its own.
pub(super) const INCLUDES: &str = "// Includes:";

pub(super) const FILES: &[(&str, &str)] = files![
    "bin.wgsl",
    "common/at_once.wgsl",
    "common/bounds.wgsl",
    "common/channels.wgsl",
    "common/depths.wgsl",
    "common/entries.wgsl",
    "common/environment.wgsl",
    "common/fast.wgsl",
    "common/gaussian.wgsl",
    "common/hit.wgsl",
    "common/land.wgsl",
    "common/list.wgsl",
    "common/moving.wgsl",
    "common/paths.wgsl",
    "common/pixel.wgsl",
    "common/posed.wgsl",
    "common/quad.wgsl",
    "common/ray.wgsl",
    "common/scan.wgsl",
    "common/segment.wgsl",
    "common/shading.wgsl",
    "common/srgb.wgsl",
    "common/sweep.wgsl",
    "common/swept.wgsl",
    "common/swept_filter.wgsl",
    "common/swept_splat.wgsl",
    "common/types.wgsl",
    "common/views.wgsl",
    "common/wanted.wgsl",
    "common/work.wgsl",
    "paint/attribute.wgsl",
    "paint/attribute_pixels.wgsl",
    "paint/attribute_quads.wgsl",
    "paint/both_walks.wgsl",
    "paint/disc.wgsl",
    "paint/entries.wgsl",
    "paint/filtered.wgsl",
    "paint/join_rest.wgsl",
    "paint/kernel.wgsl",
    "paint/meet.wgsl",
    "paint/project.wgsl",
    "paint/resolve.wgsl",
    "paint/rest.wgsl",
    "paint/second.wgsl",
    "paint/second_entries.wgsl",
    "paint/sums.wgsl",
    "paint/unfiltered.wgsl",
    "paint/visibility.wgsl",
    "paint/visibility_entries.wgsl",
    "published/attribute.wgsl",
    "published/coverage.wgsl",
    "published/low_pass.wgsl",
    "published/map.wgsl",
    "published/project.wgsl",
    "resolve.wgsl",
    "swept/attribute.wgsl",
    "swept/coverage.wgsl",
    "swept/project.wgsl",
    "swept/resolve.wgsl",
    "swept/slices.wgsl",
    "swept/sums.wgsl",
    "swept/visibility.wgsl",
    "swept/visibility_entries.wgsl",
    "transparent/composite.wgsl",
    "transparent/gather.wgsl",
    "transparent/peel.wgsl",
    "transparent/project.wgsl",
    "transparent/resolve.wgsl",
    "values.wgsl",
];

/// The texts of files, each behind those that it includes, and none twice.
pub(super) fn texts(files: &[&str]) -> Vec<&'static str> {
    let mut texts = Vec::new();
    for file in files {
        add(file, &mut texts);
    }
    texts
}

fn add(file: &str, texts: &mut Vec<&'static str>) {
    // Tests assemble all programs: names of files that are not there do not get far.
    let Some(&(_, text)) = FILES.iter().find(|(name, _)| *name == file) else { return };
    let includes = text.lines().filter_map(|line| line.strip_prefix(INCLUDES));
    for name in includes.flat_map(str::split_whitespace) {
        add(&format!("{name}.wgsl"), texts);
    }
    if !texts.contains(&text) {
        texts.push(text);
    }
}
