//! The texts of programs. A file of WGSL names the files that belong before it.

/// A file of `shaders/`: its name and its text.
pub(super) type File = (&'static str, &'static str);

macro_rules! file {
    ($file:literal) => {
        ($file, include_str!(concat!("../../../shaders/", $file)))
    };
}
pub(super) use file;

macro_rules! files {
    ($($file:literal),+ $(,)?) => { &[$(file!($file)),+] };
}

/// How a line begins that names files, without their endings, that belong before its own.
pub(super) const INCLUDES: &str = "// Includes:";

/// Files that others include. The table of passes has all others.
pub(super) const FILES: &[File] = files![
    "common/at_once.wgsl",
    "common/ball.wgsl",
    "common/bounds.wgsl",
    "common/chance.wgsl",
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
    "common/numbers.wgsl",
    "common/paths.wgsl",
    "common/posed.wgsl",
    "common/ray.wgsl",
    "common/segment.wgsl",
    "common/shading.wgsl",
    "common/sphere.wgsl",
    "common/srgb.wgsl",
    "common/sweep.wgsl",
    "common/swept.wgsl",
    "common/swept_filter.wgsl",
    "common/swept_splat.wgsl",
    "common/types.wgsl",
    "common/unshadowed.wgsl",
    "common/views.wgsl",
    "common/wanted.wgsl",
    "common/work.wgsl",
    "paint/bend.wgsl",
    "paint/both_walks.wgsl",
    "paint/entries.wgsl",
    "paint/kernel.wgsl",
    "paint/meet.wgsl",
    "paint/rest.wgsl",
    "paint/sums.wgsl",
    "paint/unfiltered.wgsl",
    "resolve.wgsl",
    "shadows/casters.wgsl",
    "shadows/light.wgsl",
    "shadows/lookup.wgsl",
    "shadows/maps.wgsl",
    "shadows/posed.wgsl",
    "shadows/receive.wgsl",
    "shadows/splats.wgsl",
    "shadows/stamp.wgsl",
    "swept/slices.wgsl",
    "swept/sums.wgsl",
    "transparent/colour.wgsl",
    "transparent/segment.wgsl",
];

/// The texts of files, each behind those that it includes, and none twice.
pub(super) fn texts(files: &[File]) -> Vec<&'static str> {
    let mut texts = Vec::new();
    for file in files {
        add(*file, &mut texts);
    }
    texts
}

fn add((_, text): File, texts: &mut Vec<&'static str>) {
    let includes = text.lines().filter_map(|line| line.strip_prefix(INCLUDES));
    for name in includes.flat_map(str::split_whitespace) {
        // Tests assemble all programs: names of files that are not there do not get far.
        let named = FILES.iter().find(|(file, _)| file.strip_suffix(".wgsl") == Some(name));
        if let Some(file) = named {
            add(*file, texts);
        }
    }
    if !texts.contains(&text) {
        texts.push(text);
    }
}
