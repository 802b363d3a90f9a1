//! The functions of `shaders/common/fast.wgsl` against f64, on the device.

use wgpu::BufferUsages;

use super::gpu_or_skip;
use super::harness::read;

const PROGRAM: &str = concat!(
    include_str!("../../../shaders/common/quad.wgsl"),
    include_str!("../../../shaders/common/fast.wgsl"),
    r"
@group(0) @binding(0) var<storage, read_write> numbers: array<vec4<f32>>;

// x, exponent, exponent of two -> the functions' values
@compute @workgroup_size(64)
fn evaluate(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&numbers) { return; }
    let x = numbers[id.x].x;
    let exponent = numbers[id.x].y;
    let slope = erf_slope(1.4 - 2.0 * x, 1.4 - 0.04 * exponent);
    numbers[id.x] = vec4<f32>(kernel(vec4<f32>(x)).x, power_of_two(numbers[id.x].z), power(x, exponent), slope);
}
"
);

/// (erf(b) - erf(a)) / (b - a).
fn slope(a: f64, b: f64) -> f64 {
    if (a - b).abs() < 1e-6 {
        let middle = 0.5 * (a + b);
        return std::f64::consts::FRAC_2_SQRT_PI * (-middle * middle).exp();
    }
    (libm::erf(b) - libm::erf(a)) / (b - a)
}

#[test]
fn functions_are_as_exact_as_their_twins() {
    let Some(gpu) = gpu_or_skip("functions_are_as_exact_as_their_twins") else { return };
    let number = |i: u16| [f32::from(i) / 20_000.0, f32::from(i % 70), f32::from(i) / 2_000.0 - 5.0, 0.0];
    let numbers: Vec<[f32; 4]> = (0..=20_000).map(number).collect();
    let device = &gpu.state.device;
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
    let buffer = device.buffer("numbers", 16 * numbers.len() as u64, usage).unwrap();
    device.write(&buffer, 0, bytemuck::cast_slice(&numbers));
    let module = device.handle.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(PROGRAM.into()),
    });
    let pipeline = device.handle.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("evaluate"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let group = device.handle.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
    });
    let mut encoder = gpu.state.encoder();
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(numbers.len().div_ceil(64) as u32, 1, 1);
    }
    device.submit([encoder]);
    let got: Vec<[f32; 4]> = read(&gpu, &buffer, numbers.len());
    let mut worst = [0.0_f64; 4];
    for (number, got) in numbers.iter().zip(got) {
        let x = f64::from(number[0]);
        let power = x.powf(f64::from(number[1]));
        // As on the CPU, a power is at least 2^-90, about 8e-28.
        let size = 1.0 + f64::from(number[1]) * x.max(1e-37).log2().abs();
        let errors = [
            f64::from(got[0]) - (-2.0 * x).exp(),
            f64::from(got[1]) / f64::from(number[2]).exp2() - 1.0,
            if power > 1e-27 { (f64::from(got[2]) / power - 1.0) / size } else { f64::from(got[2]) - power },
            f64::from(got[3]) - slope(1.4 - 2.0 * x, 1.4 - 0.04 * f64::from(number[1])),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            assert!(error.is_finite(), "{x}: {got:?}");
            *worst = worst.max(error.abs());
        }
    }
    eprintln!("kernel {:.1e}, exp2 {:.1e}, pow {:.1e}, erf_slope {:.1e}", worst[0], worst[1], worst[2], worst[3]);
    // The bounds of src/math/fast.rs; contraction can only help.
    assert!(worst[0] < 3e-7 && worst[1] < 3e-7 && worst[2] < 1e-6 && worst[3] < 5e-7, "{worst:?}");
}
