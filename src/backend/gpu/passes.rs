//! The passes on the device, a row each: its WGSL, the buffers that it reads and writes, and what it runs over.

use super::form::{Form, Lanes};
use super::slots::Slot;
use super::texts::{File, file, texts};
use super::timestamps::Stage;
use crate::options::Prefilter;

/// A kind of kernels at instants: what is stored of one, and how it weighs (`shaders/paint/kernel.wgsl`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum KernelKind {
    /// A disc.
    Disc,
    /// A disc with a low-pass disc on the screen, as published.
    LowPass,
    /// A disc that the filter of full EWA widens.
    Filtered,
}

/// A pass, or a part of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Program {
    Project,
    BinReduce,
    BinScan,
    BinEmit,
    SortCount,
    SortScan,
    SortScatter,
    BinStarts,
    Visibility,
    VisibilityEntries,
    JoinRest,
    Second,
    SecondEntries,
    SplatValues,
    Attribute,
    Resolve,
    Sweep,
    SweptVisibility,
    SweptEntries,
    SweptAttribute,
    SweptResolve,
    Pool,
    Finish,
    StoreMap,
    PublishedSweep,
    PublishedAttribute,
    PublishedResolve,
    PublishedPool,
    GaussianProject,
    Gather,
    Composite,
    TransparentResolve,
    PeelStart,
    PeelResolve,
    PeelLeftOut,
    ShadowFit,
    ShadowCentres,
    ShadowPlanes,
    ShadowLayout,
    ShadowDraw,
    ShadowDrawWide,
    ShadowLayer,
    ShadowSurfels,
    ShadowGaussians,
    ShadowedValues,
    ShadowedResolve,
    ShadowedPeelResolve,
}

/// What workgroups of a program are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) enum Per {
    /// Some surfels or Gaussians of a model, which a table lists in a second uniform.
    Surfels,
    /// Some slots.
    Slots,
    /// All slots.
    All,
    /// Some entries of lists; the device knows how many.
    Entries,
    /// Entries of lists, an invocation for each; the device knows how many.
    Entry,
    /// A digit of a sort.
    Digit,
    /// Some tiles, whose lists begin there.
    Starts,
    /// A tile of a view.
    Tile,
    /// The same. The background is in a second uniform.
    TileAndBackground,
    /// A tile of a view, for each stretch of its list.
    Stretch,
    /// Some surfels that may cast shadows, which a table lists in a second uniform; 64 of them for each light with
    /// shadows; or one.
    Casters,
    CasterAndLight,
    WideCasterAndLight,
    /// Some Gaussians that receive shadows, which a table lists in a second uniform.
    Receivers,
    /// A light with shadows of a view; some texels of it.
    ShadowLight,
    ShadowTexels,
}

/// A file of `src/backend/cpu/`, and a function in it.
pub(in crate::backend) type Twin = (&'static str, &'static str);

/// A row of the table.
pub(in crate::backend) struct Row {
    pub program: Program,
    pub entry: &'static str,
    /// What the time of a pass counts for that has it. Sorts by depth count for `Sort`.
    pub stage: Stage,
    /// What does the same on the CPU.
    #[cfg_attr(not(test), allow(dead_code, reason = "tests look it up"))]
    pub twin: Twin,
    /// Files of WGSL beside those that they include.
    files: &'static [File],
    /// Kernels that it is compiled for; empty where it is the same for all.
    kernels: &'static [KernelKind],
    /// What its invocations work on, unless the last file differs by that.
    lanes: Lanes,
    /// The last file, by lanes, where it differs.
    by_lanes: Option<[File; 2]>,
    /// A file without operations of subgroups, and the one with them that takes its place where the device has them.
    by_subgroups: Option<[File; 2]>,
    pub reads: &'static [Slot],
    pub writes: &'static [Slot],
    pub per: Per,
    /// The `override` constants that it takes, if not all of its text: a pipeline is made for each value of them.
    pub constants: Option<&'static [&'static str]>,
}

/// A program for a kind of kernels and a form. Where they make no difference, they are the first ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) struct Variant {
    pub program: Program,
    pub kernel: KernelKind,
    pub form: Form,
}

const KERNELS: &[KernelKind] = &[KernelKind::Disc, KernelKind::LowPass, KernelKind::Filtered];

/// A row of a program that is the same for all kernels.
const fn row(
    (program, entry, stage): (Program, &'static str, Stage),
    twin: Twin,
    files: &'static [File],
    per: Per,
    reads: &'static [Slot],
    writes: &'static [Slot],
) -> Row {
    Row {
        program,
        entry,
        stage,
        twin,
        files,
        kernels: &[],
        lanes: Lanes::Quads,
        by_lanes: None,
        by_subgroups: None,
        reads,
        writes,
        per,
        constants: None,
    }
}

/// A row of a program of pass `bin`, whose file holds several, which take other constants.
const fn bin(
    (program, entry): (Program, &'static str),
    per: Per,
    reads: &'static [Slot],
    writes: &'static [Slot],
    constants: &'static [&'static str],
) -> Row {
    let twin = ("bin.rs", "bin");
    Row {
        by_subgroups: Some([file!("common/scan.wgsl"), file!("common/scan_by_subgroups.wgsl")]),
        constants: Some(constants),
        ..row((program, entry, Stage::Bin), twin, &[file!("bin.wgsl")], per, reads, writes)
    }
}

use Slot::{
    CaptureSegments, Casters, CoverageMask, DigitTotals, Environment, Film, Gaussians, Geometry, Histogram, Keys,
    Layers, Lights, List, Looks, Map, Moments, Opaque, Order, Partials, Peeled, Segments, ShadowMaps, SortedKeys,
    SortedList, Splats, Starts, Status, Sums, Thresholds, Totals, Touched, Values, Wanted, Wide, WrittenTotals,
};

/// All passes, in the order of [`Program`].
pub(in crate::backend) static TABLE: [Row; 47] = [
    Row {
        kernels: KERNELS,
        ..row(
            (Program::Project, "project", Stage::Project),
            ("paint/project.rs", "project"),
            &[file!("paint/project.wgsl")],
            Per::Surfels,
            &[Geometry, Segments, Wanted],
            &[Splats, Touched],
        )
    },
    bin((Program::BinReduce, "bin_reduce"), Per::Slots, &[Touched], &[Partials], &[]),
    bin((Program::BinScan, "bin_scan"), Per::All, &[], &[Partials, WrittenTotals, Status], &[]),
    bin(
        (Program::BinEmit, "bin_emit"),
        Per::Slots,
        &[Splats, Touched, Totals, Wanted],
        &[Partials, Keys, List, Wide],
        &["SPLATS", "BOUNDS_PART"],
    ),
    bin(
        (Program::SortCount, "sort_count"),
        Per::Entries,
        &[Totals, SortedKeys, SortedList],
        &[Histogram],
        &["SHIFT", "BY_VIEW"],
    ),
    bin((Program::SortScan, "sort_scan"), Per::Digit, &[Totals], &[Histogram, DigitTotals], &[]),
    bin(
        (Program::SortScatter, "sort_scatter"),
        Per::Entries,
        &[Totals, SortedKeys, SortedList],
        &[Histogram, DigitTotals, Keys, List],
        &["SHIFT", "BY_VIEW"],
    ),
    bin((Program::BinStarts, "bin_starts"), Per::Starts, &[Totals, SortedKeys], &[Wide, Starts, Status], &[]),
    Row {
        kernels: KERNELS,
        ..row(
            (Program::Visibility, "visibility", Stage::Visibility),
            ("paint/visibility.rs", "visibility"),
            &[file!("paint/visibility.wgsl")],
            Per::Tile,
            &[Segments, Splats, Wide, Starts, Wanted],
            &[Thresholds],
        )
    },
    Row {
        kernels: KERNELS,
        lanes: Lanes::Pixels,
        ..row(
            (Program::VisibilityEntries, "visibility_entries", Stage::Visibility),
            ("paint/visibility.rs", "visibility"),
            &[file!("paint/visibility_entries.wgsl")],
            Per::Entry,
            &[Segments, Splats, List, SortedKeys, Starts],
            &[Thresholds],
        )
    },
    row(
        (Program::JoinRest, "join_rest", Stage::Visibility),
        ("paint/visibility.rs", "visibility"),
        &[file!("paint/join_rest.wgsl")],
        Per::Tile,
        &[Starts],
        &[Thresholds],
    ),
    Row {
        kernels: &[KernelKind::Filtered],
        ..row(
            (Program::Second, "second", Stage::Visibility),
            ("paint/visibility.rs", "second"),
            &[file!("paint/second.wgsl")],
            Per::Tile,
            &[Segments, Splats, Wide, Starts, Wanted],
            &[Thresholds],
        )
    },
    Row {
        kernels: &[KernelKind::Filtered],
        lanes: Lanes::Pixels,
        ..row(
            (Program::SecondEntries, "second_entries", Stage::Visibility),
            ("paint/visibility.rs", "second"),
            &[file!("paint/second_entries.wgsl")],
            Per::Entry,
            &[Segments, Splats, List, SortedKeys, Starts],
            &[Thresholds],
        )
    },
    row(
        (Program::SplatValues, "splat_values", Stage::Attribute),
        ("values.rs", "values"),
        &[file!("common/unshadowed.wgsl"), file!("values.wgsl")],
        Per::Surfels,
        &[Geometry, Looks, Segments, Lights, Splats, Touched, Environment],
        &[Values],
    ),
    Row {
        kernels: KERNELS,
        by_lanes: Some([file!("paint/attribute_quads.wgsl"), file!("paint/attribute_pixels.wgsl")]),
        ..row(
            (Program::Attribute, "sum_attributes", Stage::Attribute),
            ("paint/attribute.rs", "attribute"),
            &[file!("paint/attribute.wgsl")],
            Per::Tile,
            &[Segments, Splats, List, Wide, Starts, Thresholds, Values],
            &[Sums],
        )
    },
    row(
        (Program::Resolve, "resolve", Stage::Resolve),
        ("paint/resolve.rs", "resolve"),
        &[file!("common/unshadowed.wgsl"), file!("paint/resolve.wgsl")],
        Per::Tile,
        &[Lights, Thresholds, Sums, Environment, Starts],
        &[Film],
    ),
    row(
        (Program::Sweep, "sweep", Stage::Project),
        ("swept/project.rs", "project"),
        &[file!("swept/project.wgsl")],
        Per::Surfels,
        &[Geometry, Segments, Wanted],
        &[Splats, Touched],
    ),
    row(
        (Program::SweptVisibility, "swept_visibility", Stage::Visibility),
        ("swept/slices.rs", "visibility"),
        &[file!("swept/visibility.wgsl")],
        Per::Stretch,
        &[Segments, Splats, List, Wide, Starts],
        &[Map],
    ),
    row(
        (Program::SweptEntries, "swept_entries", Stage::Visibility),
        ("swept/slices.rs", "visibility"),
        &[file!("swept/visibility_entries.wgsl")],
        Per::Entry,
        &[Segments, Splats, List, SortedKeys, Starts],
        &[Map],
    ),
    row(
        (Program::SweptAttribute, "swept_attribute", Stage::Attribute),
        ("swept/attribute.rs", "attribute"),
        &[file!("swept/attribute.wgsl")],
        Per::Stretch,
        &[Splats, List, Wide, Starts, Values, Map],
        &[Sums, CoverageMask],
    ),
    row(
        (Program::SweptResolve, "swept_resolve", Stage::Resolve),
        ("swept/resolve.rs", "add_to_film"),
        &[file!("swept/coverage.wgsl"), file!("swept/resolve.wgsl")],
        Per::Tile,
        &[Lights, Sums, CoverageMask, Moments, Environment],
        &[Film],
    ),
    row(
        (Program::Pool, "pool", Stage::Resolve),
        ("swept/resolve.rs", "add_to_film"),
        &[file!("swept/coverage.wgsl"), file!("swept/resolve.wgsl")],
        Per::Tile,
        &[Sums, CoverageMask, Moments],
        &[Film],
    ),
    row(
        (Program::Finish, "finish", Stage::Resolve),
        ("swept/resolve.rs", "finish"),
        &[file!("swept/coverage.wgsl"), file!("swept/resolve.wgsl")],
        Per::Tile,
        &[],
        &[Film],
    ),
    row(
        (Program::StoreMap, "store_map", Stage::Visibility),
        ("published/map.rs", "store"),
        &[file!("published/map.wgsl")],
        Per::Tile,
        &[Thresholds],
        &[Map],
    ),
    row(
        (Program::PublishedSweep, "published_sweep", Stage::Project),
        ("published/project.rs", "project"),
        &[file!("published/project.wgsl")],
        Per::Surfels,
        &[Geometry, Segments, Wanted],
        &[Splats, Touched],
    ),
    row(
        (Program::PublishedAttribute, "published_attribute", Stage::Attribute),
        ("published/attribute.rs", "attribute"),
        &[file!("published/attribute.wgsl")],
        Per::Stretch,
        &[Splats, List, Wide, Starts, Values, Map],
        &[Sums, CoverageMask],
    ),
    row(
        (Program::PublishedResolve, "swept_resolve", Stage::Resolve),
        ("swept/resolve.rs", "add_to_film"),
        &[file!("published/coverage.wgsl"), file!("swept/resolve.wgsl")],
        Per::Tile,
        &[Lights, Sums, CoverageMask, Moments, Environment],
        &[Film],
    ),
    row(
        (Program::PublishedPool, "pool", Stage::Resolve),
        ("swept/resolve.rs", "add_to_film"),
        &[file!("published/coverage.wgsl"), file!("swept/resolve.wgsl")],
        Per::Tile,
        &[Sums, CoverageMask, Moments],
        &[Film],
    ),
    row(
        (Program::GaussianProject, "gaussian_project", Stage::Project),
        ("transparent/project.rs", "project"),
        &[file!("transparent/project.wgsl")],
        Per::Surfels,
        &[Geometry, Looks, Lights, CaptureSegments],
        &[Keys, List, Gaussians],
    ),
    row(
        (Program::Gather, "gather", Stage::Bin),
        ("transparent/sorted.rs", "lists"),
        &[file!("transparent/gather.wgsl")],
        Per::Slots,
        &[Gaussians, Order, Wanted],
        &[Splats, Touched],
    ),
    row(
        (Program::Composite, "composite", Stage::Composite),
        ("transparent/composite.rs", "composite"),
        &[file!("transparent/composite.wgsl")],
        Per::Stretch,
        &[Splats, List, Wide, Starts, Thresholds, Wanted, Layers],
        &[Sums],
    ),
    row(
        (Program::TransparentResolve, "transparent_resolve", Stage::Resolve),
        ("transparent/resolve.rs", "resolve"),
        &[file!("transparent/resolve.wgsl")],
        Per::TileAndBackground,
        &[Sums, Opaque, Wanted],
        &[Film],
    ),
    row(
        (Program::PeelStart, "peel_start", Stage::Visibility),
        ("transparent/see_through/cover.rs", "start"),
        &[file!("common/unshadowed.wgsl"), file!("transparent/peel.wgsl")],
        Per::Tile,
        &[Thresholds, Wanted],
        &[Film, Peeled],
    ),
    row(
        (Program::PeelResolve, "peel_resolve", Stage::Resolve),
        ("transparent/see_through/resolve.rs", "resolve"),
        &[file!("common/unshadowed.wgsl"), file!("transparent/peel.wgsl")],
        Per::Tile,
        &[Lights, Sums, Environment],
        &[Film, Peeled],
    ),
    row(
        (Program::PeelLeftOut, "peel_left_out", Stage::Visibility),
        ("transparent/see_through/cover.rs", "left_out"),
        &[file!("common/unshadowed.wgsl"), file!("transparent/peel.wgsl")],
        Per::Tile,
        &[],
        &[Status, Peeled],
    ),
    row(
        (Program::ShadowFit, "shadow_fit", Stage::Visibility),
        ("shadows/fit.rs", "of"),
        &[file!("shadows/fit.wgsl")],
        Per::Casters,
        &[Geometry, Segments, Lights, Wanted],
        &[ShadowMaps],
    ),
    row(
        (Program::ShadowCentres, "shadow_centres", Stage::Visibility),
        ("shadows/centres.rs", "each"),
        &[file!("shadows/centres.wgsl")],
        Per::Receivers,
        &[Geometry, Lights, Wanted, CaptureSegments],
        &[ShadowMaps],
    ),
    row(
        (Program::ShadowPlanes, "shadow_planes", Stage::Visibility),
        ("shadows/caster.rs", "of"),
        &[file!("shadows/planes.wgsl")],
        Per::Casters,
        &[Geometry, Looks, Segments, Lights],
        &[Casters],
    ),
    row(
        (Program::ShadowLayout, "shadow_layout", Stage::Visibility),
        ("shadows/fit.rs", "areas"),
        &[file!("shadows/layout.wgsl")],
        Per::ShadowLight,
        &[Lights],
        &[ShadowMaps],
    ),
    row(
        (Program::ShadowDraw, "shadow_draw", Stage::Visibility),
        ("shadows/map.rs", "draw"),
        &[file!("shadows/draw.wgsl")],
        Per::CasterAndLight,
        &[Geometry, Segments, Lights, Casters],
        &[ShadowMaps],
    ),
    row(
        (Program::ShadowDrawWide, "shadow_draw_wide", Stage::Visibility),
        ("shadows/map.rs", "draw"),
        &[file!("shadows/draw_wide.wgsl")],
        Per::WideCasterAndLight,
        &[Geometry, Segments, Lights, Casters],
        &[ShadowMaps],
    ),
    row(
        (Program::ShadowLayer, "shadow_layer", Stage::Visibility),
        ("shadows/layers.rs", "draw"),
        &[file!("shadows/layer.wgsl")],
        Per::ShadowTexels,
        &[Lights, Casters],
        &[ShadowMaps],
    ),
    row(
        (Program::ShadowSurfels, "shadow_surfels", Stage::Attribute),
        ("shadows/mod.rs", "seen"),
        &[file!("shadows/surfels.wgsl")],
        Per::Surfels,
        &[Geometry, Segments, Lights, Touched, ShadowMaps, Casters],
        &[Values],
    ),
    row(
        (Program::ShadowGaussians, "shadow_gaussians", Stage::Project),
        ("transparent/emission.rs", "light_left"),
        &[file!("shadows/gaussians.wgsl")],
        Per::Surfels,
        &[Geometry, Looks, Lights, CaptureSegments, ShadowMaps, Casters],
        &[Gaussians],
    ),
    row(
        (Program::ShadowedValues, "splat_values", Stage::Attribute),
        ("values.rs", "values"),
        &[file!("shadows/of_surfels.wgsl"), file!("values.wgsl")],
        Per::Surfels,
        &[Geometry, Looks, Segments, Lights, Splats, Touched, Environment],
        &[Values],
    ),
    row(
        (Program::ShadowedResolve, "resolve", Stage::Resolve),
        ("paint/resolve.rs", "resolve"),
        &[file!("shadows/of_pixels.wgsl"), file!("paint/resolve.wgsl")],
        Per::Tile,
        &[Lights, Thresholds, Sums, Environment, Starts, ShadowMaps, Casters],
        &[Film],
    ),
    row(
        (Program::ShadowedPeelResolve, "peel_resolve", Stage::Resolve),
        ("transparent/see_through/resolve.rs", "resolve"),
        &[file!("shadows/of_pixels.wgsl"), file!("transparent/peel.wgsl")],
        Per::Tile,
        &[Lights, Sums, Environment, ShadowMaps, Casters],
        &[Film, Peeled],
    ),
];

const _: () = {
    let mut row = 0;
    while row < TABLE.len() {
        assert!(TABLE[row].program as usize == row);
        row += 1;
    }
};

impl KernelKind {
    /// The kernels at instants of a frame.
    pub(in crate::backend) const fn of(prefilter: Prefilter) -> Self {
        match prefilter {
            // A frame has chosen.
            Prefilter::None | Prefilter::Auto => Self::Disc,
            Prefilter::Approx => Self::LowPass,
            Prefilter::Ewa => Self::Filtered,
        }
    }

    /// The file of a stored kernel: its type, and functions of it.
    const fn file(self) -> File {
        match self {
            Self::Disc => file!("paint/disc.wgsl"),
            Self::LowPass => file!("published/low_pass.wgsl"),
            Self::Filtered => file!("paint/filtered.wgsl"),
        }
    }
}

impl Row {
    /// Number of its uniforms: the view, and a second one.
    pub(in crate::backend) const fn uniforms(&self) -> usize {
        match self.per {
            Per::Surfels
            | Per::TileAndBackground
            | Per::Receivers
            | Per::Casters
            | Per::CasterAndLight
            | Per::WideCasterAndLight => 2,
            _ => 1,
        }
    }

    /// The buffers that it binds.
    pub(in crate::backend) fn slots(&self) -> impl Iterator<Item = Slot> {
        self.reads.iter().chain(self.writes).copied()
    }
}

impl Program {
    pub(in crate::backend) fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }

    /// The program for kernels of a kind.
    pub(in crate::backend) fn variant(self, kernel: KernelKind, form: Form) -> Variant {
        let row = self.row();
        Variant {
            program: self,
            kernel: if row.kernels.is_empty() { KernelKind::Disc } else { kernel },
            form: Form {
                lanes: if row.by_lanes.is_some() { form.lanes } else { row.lanes },
                subgroups: row.by_subgroups.is_some() && form.subgroups,
            },
        }
    }
}

impl Variant {
    /// All of them.
    #[cfg(test)]
    pub(in crate::backend) fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for row in &TABLE {
            for kernel in KERNELS.iter().filter(|kernel| row.kernels.is_empty() || row.kernels.contains(kernel)) {
                for form in Form::all() {
                    let variant = row.program.variant(*kernel, form);
                    if !all.contains(&variant) {
                        all.push(variant);
                    }
                }
            }
        }
        all
    }

    /// The name of its function.
    pub(in crate::backend) fn entry(self) -> &'static str {
        self.program.row().entry
    }

    /// Its texts of WGSL. What an invocation works on comes first, then its kernel; what is last differs by lanes.
    pub(in crate::backend) fn texts(self) -> Vec<&'static str> {
        let row = self.program.row();
        let mut files = vec![match self.form.lanes {
            Lanes::Quads => file!("common/quad.wgsl"),
            Lanes::Pixels => file!("common/pixel.wgsl"),
        }];
        files.extend((!row.kernels.is_empty()).then(|| self.kernel.file()));
        files.extend(row.by_subgroups.map(|forms| forms[usize::from(self.form.subgroups)]));
        files.extend(row.files);
        files.extend(row.by_lanes.map(|[quads, pixels]| if self.form.lanes == Lanes::Quads { quads } else { pixels }));
        texts(&files)
    }

    /// All its texts.
    pub(in crate::backend) fn wgsl(self) -> String {
        self.texts().join("\n")
    }
}
