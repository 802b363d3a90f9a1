//! Pipelines of programs. Each is made when it is needed for the first time.

use std::collections::HashMap;

use wgpu::{BindGroupLayout, BindingType, BufferBindingType, ShaderStages};

use super::device::Device;
use super::passes::{Program, Variant};
use crate::backend::BackendError;

/// Names and values of a program's `override` constants.
pub(in crate::backend) type Constants = Vec<(&'static str, u32)>;

/// The pipelines that were made.
#[derive(Clone, Debug, Default)]
pub(in crate::backend) struct Pipelines {
    modules: HashMap<String, wgpu::ShaderModule>,
    layouts: HashMap<Program, Layouts>,
    overrides: HashMap<Variant, Vec<&'static str>>,
    made: HashMap<(Variant, Constants), wgpu::ComputePipeline>,
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
        all.made.retain(|(variant, _), _| replaced.iter().all(|(from, _)| !variant.wgsl().contains(from)));
        all
    }

    /// The layouts of a program's two bind groups.
    pub(in crate::backend) fn layouts(&mut self, device: &Device, program: Program) -> &Layouts {
        self.layouts.entry(program).or_insert_with(|| layouts(device, program))
    }

    /// The names of the `override` constants of a program.
    pub(in crate::backend) fn overrides(&mut self, variant: Variant) -> &[&'static str] {
        self.overrides.entry(variant).or_insert_with(|| overrides(variant))
    }

    #[cfg(not(test))]
    #[allow(clippy::unused_self, reason = "tests replace text")]
    fn source(&self, variant: Variant) -> String {
        variant.wgsl()
    }

    #[cfg(test)]
    fn source(&self, variant: Variant) -> String {
        self.replaced.iter().fold(variant.wgsl(), |source, (from, to)| source.replacen(from, to, 1))
    }

    pub(in crate::backend) fn get(
        &mut self,
        device: &Device,
        variant: Variant,
        constants: Constants,
    ) -> Result<wgpu::ComputePipeline, BackendError> {
        let key = (variant, constants);
        if let Some(pipeline) = self.made.get(&key) {
            return Ok(pipeline.clone());
        }
        let entry = variant.entry();
        let layouts = self.layouts(device, variant.program).clone();
        let scope = device.handle.push_error_scope(wgpu::ErrorFilter::Validation);
        let source = self.source(variant);
        let module = self.modules.entry(source.clone()).or_insert_with(|| {
            device.handle.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(entry),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            })
        });
        let layout = device.handle.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(entry),
            bind_group_layouts: &[Some(&layouts.uniforms), Some(&layouts.buffers)],
            immediate_size: 0,
        });
        let values: Vec<(&str, f64)> = key.1.iter().map(|&(name, value)| (name, f64::from(value))).collect();
        let pipeline = device.handle.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&layout),
            module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions { constants: &values, ..Default::default() },
            cache: None,
        });
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(device.error(format!("program `{entry}`: {error}"))),
            None => Ok(self.made.entry(key).or_insert(pipeline).clone()),
        }
    }
}

fn layouts(device: &Device, program: Program) -> Layouts {
    let row = program.row();
    let entry = |binding: u32, ty: BufferBindingType, has_dynamic_offset: bool| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: ShaderStages::COMPUTE,
        ty: BindingType::Buffer { ty, has_dynamic_offset, min_binding_size: None },
        count: None,
    };
    let make = |entries: &[wgpu::BindGroupLayoutEntry]| {
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(row.entry), entries };
        device.handle.create_bind_group_layout(&descriptor)
    };
    let uniforms = [entry(0, BufferBindingType::Uniform, true), entry(1, BufferBindingType::Uniform, true)];
    let buffers: Vec<_> = [(row.reads, true), (row.writes, false)]
        .iter()
        .flat_map(|&(slots, read_only)| {
            slots.iter().map(move |&slot| entry(slot as u32, BufferBindingType::Storage { read_only }, false))
        })
        .collect();
    Layouts { uniforms: make(&uniforms[..row.uniforms()]), buffers: make(&buffers) }
}

/// The `override` constants that a program takes. Those whose value follows from others are none of them.
pub(super) fn overrides(variant: Variant) -> Vec<&'static str> {
    let name = |line: &'static str| {
        let (name, rest) = line.strip_prefix("override ")?.split_once(':')?;
        let (_, value) = rest.split_once('=')?;
        let is_literal = !value.contains(|c: char| c == '(' || c.is_ascii_uppercase());
        is_literal.then_some(name)
    };
    let of_text = variant.texts().into_iter().flat_map(str::lines).filter_map(name);
    let row = variant.program.row();
    of_text.filter(|name| row.constants.is_none_or(|constants| constants.contains(name))).collect()
}
