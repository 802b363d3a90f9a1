//! Programs: their WGSL, the buffers that each of them binds, and their pipelines.

use std::collections::HashMap;

use wgpu::{BindGroupLayout, BindingType, BufferBindingType, ShaderStages};

use super::device::Device;
use super::lanes::Lanes;
use super::texts::{
    ATTRIBUTE, ATTRIBUTE_BY_PIXELS, ATTRIBUTE_BY_QUADS, BIN, COMPOSITE, DISC, FILTERED, GATHER, GAUSSIAN_PROJECT,
    LOW_PASS, MAP, PEEL, PIXEL, PROJECT, PUBLISHED_ATTRIBUTE, PUBLISHED_RESOLVE, PUBLISHED_SWEEP, QUAD, RESOLVE,
    SECOND_BY_PIXELS, SECOND_BY_QUADS, SWEEP, SWEPT_ATTRIBUTE, SWEPT_RESOLVE, SWEPT_VISIBILITY, TRANSPARENT_RESOLVE,
    VALUES, VISIBILITY, VISIBILITY_BY_PIXELS, VISIBILITY_BY_QUADS,
};
use crate::backend::BackendError;
use crate::options::Prefilter;

/// Names of the buffers that programs bind. The number is the binding in group 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Slot {
    Geometry = 0,
    Looks = 1,
    Segments = 2,
    Lights = 3,
    Splats = 4,
    Touched = 5,
    Partials = 6,
    WrittenTotals = 7,
    Status = 8,
    Keys = 9,
    List = 10,
    Wide = 11,
    Starts = 12,
    Histogram = 13,
    DigitTotals = 14,
    SortedKeys = 15,
    SortedList = 16,
    Thresholds = 17,
    Values = 19,
    Sums = 20,
    Film = 21,
    Totals = 22,
    Map = 24,
    CoverageMask = 25,
    Moments = 26,
    Wanted = 27,
    Gaussians = 32,
    Order = 33,
    Opaque = 34,
    Peeled = 35,
    Layers = 36,
    Environment = 37,
    CaptureSegments = 38,
}

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

/// A compute program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::backend) enum Program {
    Project(KernelKind),
    BinReduce,
    BinScan,
    BinEmit,
    SortCount,
    SortScan,
    SortScatter,
    BinStarts,
    Visibility(KernelKind, Lanes),
    Second(Lanes),
    SplatValues,
    Attribute(KernelKind, Lanes),
    Resolve,
    Sweep,
    SweptVisibility,
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
}

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

    /// Does a filter widen it? Then tiles have an apron, and programs the constant `FILTERED`.
    pub(in crate::backend) const fn is_filtered(self) -> bool {
        matches!(self, Self::Filtered)
    }

    /// The text of a stored kernel: its type, and functions of it.
    const fn wgsl(self) -> &'static str {
        match self {
            Self::Disc => DISC,
            Self::LowPass => LOW_PASS,
            Self::Filtered => FILTERED,
        }
    }
}

/// The buffers that a program only reads, and those that it writes.
type Buffers = (&'static [Slot], &'static [Slot]);

impl Program {
    #[cfg(test)]
    pub(in crate::backend) const ALL: [Self; 44] = [
        Self::Project(KernelKind::Disc),
        Self::Project(KernelKind::LowPass),
        Self::Project(KernelKind::Filtered),
        Self::BinReduce,
        Self::BinScan,
        Self::BinEmit,
        Self::SortCount,
        Self::SortScan,
        Self::SortScatter,
        Self::BinStarts,
        Self::Visibility(KernelKind::Disc, Lanes::Quads),
        Self::Visibility(KernelKind::Disc, Lanes::Pixels),
        Self::Visibility(KernelKind::LowPass, Lanes::Quads),
        Self::Visibility(KernelKind::LowPass, Lanes::Pixels),
        Self::Visibility(KernelKind::Filtered, Lanes::Quads),
        Self::Visibility(KernelKind::Filtered, Lanes::Pixels),
        Self::Second(Lanes::Quads),
        Self::Second(Lanes::Pixels),
        Self::SplatValues,
        Self::Attribute(KernelKind::Disc, Lanes::Quads),
        Self::Attribute(KernelKind::Disc, Lanes::Pixels),
        Self::Attribute(KernelKind::LowPass, Lanes::Quads),
        Self::Attribute(KernelKind::LowPass, Lanes::Pixels),
        Self::Attribute(KernelKind::Filtered, Lanes::Quads),
        Self::Attribute(KernelKind::Filtered, Lanes::Pixels),
        Self::Resolve,
        Self::Sweep,
        Self::StoreMap,
        Self::PublishedSweep,
        Self::PublishedAttribute,
        Self::PublishedResolve,
        Self::PublishedPool,
        Self::SweptVisibility,
        Self::SweptAttribute,
        Self::SweptResolve,
        Self::Pool,
        Self::Finish,
        Self::GaussianProject,
        Self::Gather,
        Self::Composite,
        Self::TransparentResolve,
        Self::PeelStart,
        Self::PeelResolve,
        Self::PeelLeftOut,
    ];

    /// The text of a program. What an invocation works on comes first, then its kernel; what is last differs by lanes.
    pub(in crate::backend) fn wgsl(self) -> String {
        let kernel = match self {
            Self::Project(kernel) | Self::Visibility(kernel, _) | Self::Attribute(kernel, _) => kernel.wgsl(),
            Self::Second(_) => KernelKind::Filtered.wgsl(),
            _ => "",
        };
        let lanes = match self {
            Self::Visibility(_, Lanes::Pixels) | Self::Second(Lanes::Pixels) | Self::Attribute(_, Lanes::Pixels) => {
                PIXEL
            }
            _ => QUAD,
        };
        let last = match self {
            Self::Visibility(_, Lanes::Quads) => VISIBILITY_BY_QUADS,
            Self::Visibility(_, Lanes::Pixels) => VISIBILITY_BY_PIXELS,
            Self::Attribute(_, Lanes::Quads) => ATTRIBUTE_BY_QUADS,
            Self::Attribute(_, Lanes::Pixels) => ATTRIBUTE_BY_PIXELS,
            Self::Second(Lanes::Quads) => SECOND_BY_QUADS,
            Self::Second(Lanes::Pixels) => SECOND_BY_PIXELS,
            _ => "",
        };
        [lanes, kernel, self.own_wgsl(), last].concat()
    }

    const fn own_wgsl(self) -> &'static str {
        match self {
            Self::Project(_) => PROJECT,
            Self::BinReduce
            | Self::BinScan
            | Self::BinEmit
            | Self::BinStarts
            | Self::SortCount
            | Self::SortScan
            | Self::SortScatter => BIN,
            Self::Visibility(..) | Self::Second(_) => VISIBILITY,
            Self::SplatValues => VALUES,
            Self::Attribute(..) => ATTRIBUTE,
            Self::Resolve => RESOLVE,
            Self::Sweep => SWEEP,
            Self::StoreMap => MAP,
            Self::SweptVisibility => SWEPT_VISIBILITY,
            Self::SweptAttribute => SWEPT_ATTRIBUTE,
            Self::SweptResolve | Self::Pool | Self::Finish => SWEPT_RESOLVE,
            Self::PublishedSweep => PUBLISHED_SWEEP,
            Self::PublishedAttribute => PUBLISHED_ATTRIBUTE,
            Self::PublishedResolve | Self::PublishedPool => PUBLISHED_RESOLVE,
            Self::GaussianProject => GAUSSIAN_PROJECT,
            Self::Gather => GATHER,
            Self::Composite => COMPOSITE,
            Self::TransparentResolve => TRANSPARENT_RESOLVE,
            Self::PeelStart | Self::PeelResolve | Self::PeelLeftOut => PEEL,
        }
    }

    pub(in crate::backend) const fn entry(self) -> &'static str {
        match self {
            Self::Project(_) => "project",
            Self::BinReduce => "bin_reduce",
            Self::BinScan => "bin_scan",
            Self::BinEmit => "bin_emit",
            Self::SortCount => "sort_count",
            Self::SortScan => "sort_scan",
            Self::SortScatter => "sort_scatter",
            Self::BinStarts => "bin_starts",
            Self::Visibility(..) => "visibility",
            Self::Second(_) => "second",
            Self::SplatValues => "splat_values",
            Self::Attribute(..) => "sum_attributes",
            Self::Resolve => "resolve",
            Self::Sweep => "sweep",
            Self::StoreMap => "store_map",
            Self::SweptVisibility => "swept_visibility",
            Self::SweptAttribute => "swept_attribute",
            Self::SweptResolve | Self::PublishedResolve => "swept_resolve",
            Self::Pool | Self::PublishedPool => "pool",
            Self::Finish => "finish",
            Self::PublishedSweep => "published_sweep",
            Self::PublishedAttribute => "published_attribute",
            Self::GaussianProject => "gaussian_project",
            Self::Gather => "gather",
            Self::Composite => "composite",
            Self::TransparentResolve => "transparent_resolve",
            Self::PeelStart => "peel_start",
            Self::PeelResolve => "peel_resolve",
            Self::PeelLeftOut => "peel_left_out",
        }
    }

    pub(in crate::backend) const fn buffers(self) -> Buffers {
        use Slot::{
            CaptureSegments, CoverageMask, DigitTotals, Environment, Film, Gaussians, Geometry, Histogram, Keys,
            Layers, Lights, List, Looks, Map, Moments, Opaque, Order, Partials, Peeled, Segments, SortedKeys,
            SortedList, Splats, Starts, Status, Sums, Thresholds, Totals, Touched, Values, Wanted, Wide, WrittenTotals,
        };
        match self {
            Self::Project(_) | Self::Sweep | Self::PublishedSweep => {
                (&[Geometry, Segments, Wanted], &[Splats, Touched])
            }
            Self::BinReduce => (&[Touched], &[Partials]),
            Self::BinScan => (&[], &[Partials, WrittenTotals, Status]),
            Self::BinEmit => (&[Splats, Touched, Totals, Wanted], &[Partials, Keys, List, Wide]),
            Self::SortCount => (&[Totals, SortedKeys, SortedList], &[Histogram]),
            Self::SortScan => (&[Totals], &[Histogram, DigitTotals]),
            Self::SortScatter => (&[Totals, SortedKeys, SortedList], &[Histogram, DigitTotals, Keys, List]),
            Self::BinStarts => (&[Totals, SortedKeys], &[Wide, Starts, Status]),
            Self::Visibility(..) | Self::Second(_) => (&[Segments, Splats, List, Wide, Starts, Wanted], &[Thresholds]),
            Self::SplatValues => (&[Geometry, Looks, Segments, Lights, Splats, Touched, Environment], &[Values]),
            Self::Attribute(..) => (&[Segments, Splats, List, Wide, Starts, Thresholds, Values], &[Sums]),
            Self::Resolve => (&[Lights, Thresholds, Sums, Environment, Starts], &[Film]),
            Self::StoreMap => (&[Thresholds], &[Map]),
            Self::SweptVisibility => (&[Segments, Splats, List, Wide, Starts], &[Map]),
            Self::SweptAttribute | Self::PublishedAttribute => {
                (&[Splats, List, Wide, Starts, Values, Map], &[Sums, CoverageMask])
            }
            Self::SweptResolve | Self::PublishedResolve => {
                (&[Lights, Sums, CoverageMask, Moments, Environment], &[Film])
            }
            Self::Pool | Self::PublishedPool => (&[Sums, CoverageMask, Moments], &[Film]),
            Self::Finish => (&[], &[Film]),
            Self::GaussianProject => (&[Geometry, Looks, Lights, CaptureSegments], &[Keys, List, Gaussians]),
            Self::Gather => (&[Gaussians, Order, Wanted], &[Splats, Touched]),
            Self::Composite => (&[Splats, List, Wide, Starts, Thresholds, Wanted, Layers], &[Sums]),
            Self::TransparentResolve => (&[Sums, Opaque, Wanted], &[Film]),
            Self::PeelStart => (&[Thresholds, Wanted], &[Film, Peeled]),
            Self::PeelResolve => (&[Lights, Sums, Environment], &[Film, Peeled]),
            Self::PeelLeftOut => (&[], &[Status, Peeled]),
        }
    }

    /// True if the program has a second uniform: a table of workgroups, or the background.
    pub(in crate::backend) const fn has_second_uniform(self) -> bool {
        matches!(
            self,
            Self::Project(_)
                | Self::Sweep
                | Self::SplatValues
                | Self::PublishedSweep
                | Self::GaussianProject
                | Self::TransparentResolve
        )
    }
}

/// Names and values of a program's `override` constants.
pub(in crate::backend) type Constants = Vec<(&'static str, u32)>;

/// Pipelines. Each is made when it is needed for the first time.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Pipelines {
    modules: HashMap<String, wgpu::ShaderModule>,
    layouts: HashMap<Program, Layouts>,
    made: HashMap<(Program, Constants), wgpu::ComputePipeline>,
    /// Text that tests replace in all programs, and its replacement.
    #[cfg(test)]
    replaced: &'static [(&'static str, &'static str)],
}

#[derive(Clone, Debug)]
pub(in crate::backend) struct Layouts {
    /// View and, where the program has one, its second uniform.
    pub uniforms: BindGroupLayout,
    pub buffers: BindGroupLayout,
}

impl Pipelines {
    /// Pipelines of programs in which, once in each, the second text of a pair replaces the first. Programs that stay
    /// the same keep theirs.
    #[cfg(test)]
    pub(in crate::backend) fn with(&self, replaced: &'static [(&'static str, &'static str)]) -> Self {
        let mut all = Self { replaced, ..self.clone() };
        all.made.retain(|(program, _), _| replaced.iter().all(|(from, _)| !program.wgsl().contains(from)));
        all
    }

    /// The layouts of a program's two bind groups.
    pub(in crate::backend) fn layouts(&mut self, device: &Device, program: Program) -> &Layouts {
        self.layouts.entry(program).or_insert_with(|| layouts(device, program))
    }

    #[cfg(not(test))]
    #[allow(clippy::unused_self, reason = "tests replace text")]
    fn source(&self, program: Program) -> String {
        program.wgsl()
    }

    #[cfg(test)]
    fn source(&self, program: Program) -> String {
        self.replaced.iter().fold(program.wgsl(), |source, (from, to)| source.replacen(from, to, 1))
    }

    pub(in crate::backend) fn get(
        &mut self,
        device: &Device,
        program: Program,
        constants: &Constants,
    ) -> Result<wgpu::ComputePipeline, BackendError> {
        let key = (program, constants.clone());
        if let Some(pipeline) = self.made.get(&key) {
            return Ok(pipeline.clone());
        }
        let layouts = self.layouts(device, program).clone();
        let scope = device.handle.push_error_scope(wgpu::ErrorFilter::Validation);
        let source = self.source(program);
        let module = self.modules.entry(source.clone()).or_insert_with(|| {
            device.handle.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(program.entry()),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            })
        });
        let layout = device.handle.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(program.entry()),
            bind_group_layouts: &[Some(&layouts.uniforms), Some(&layouts.buffers)],
            immediate_size: 0,
        });
        let values: Vec<(&str, f64)> = constants.iter().map(|&(name, value)| (name, f64::from(value))).collect();
        let pipeline = device.handle.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(program.entry()),
            layout: Some(&layout),
            module,
            entry_point: Some(program.entry()),
            compilation_options: wgpu::PipelineCompilationOptions { constants: &values, ..Default::default() },
            cache: None,
        });
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(device.error(format!("program `{}`: {error}", program.entry()))),
            None => Ok(self.made.entry(key).or_insert(pipeline).clone()),
        }
    }
}

fn layouts(device: &Device, program: Program) -> Layouts {
    let entry = |binding: u32, ty: BufferBindingType, has_dynamic_offset: bool| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: ShaderStages::COMPUTE,
        ty: BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None },
        count: None,
    };
    let make = |entries: &[wgpu::BindGroupLayoutEntry]| {
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(program.entry()), entries };
        device.handle.create_bind_group_layout(&descriptor)
    };
    let uniforms = [entry(0, BufferBindingType::Uniform, true), entry(1, BufferBindingType::Uniform, true)];
    let (read, written) = program.buffers();
    let buffers: Vec<_> = [(read, true), (written, false)]
        .iter()
        .flat_map(|&(slots, read_only)| {
            slots.iter().map(move |&slot| entry(slot as u32, BufferBindingType::Storage { read_only }, false))
        })
        .collect();
    Layouts { uniforms: make(&uniforms[..if program.has_second_uniform() { 2 } else { 1 }]), buffers: make(&buffers) }
}
