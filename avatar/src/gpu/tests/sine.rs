//! The kernels' sine against f64.

use super::{super::kernels, gpu};

const KERNEL: &str = "
@group(0) @binding(0) var<storage, read_write> numbers: array<vec4f>;
@compute @workgroup_size(64)
fn sines(@builtin(global_invocation_id) id: vec3u) {
    numbers[id.x] = sine(numbers[id.x]);
}
";

/// A multiple of 256.
const COUNT: usize = 1 << 16;

#[test]
fn the_kernels_sine_is_as_good_as_the_processors() {
    let Some(gpu) = gpu() else {
        return;
    };
    // As far as angles of fields come; then some more.
    for (limit_rad, most) in [(4.0_f32, 2.5e-7), (1000.0, 4e-7)] {
        let spread = |i: usize| limit_rad * (i as f32 / (COUNT / 2) as f32 - 1.0);
        let angles_rad: Vec<f32> = (0..COUNT).map(spread).collect();
        let sines = sines(&gpu, &angles_rad);
        let error =
            |(&angle, &sine): (&f32, &f32)| (f64::from(sine) - f64::from(angle).sin()).abs();
        let largest = angles_rad.iter().zip(&sines).map(error).fold(0.0, f64::max);
        println!("{largest:.3e} up to {limit_rad} rad");
        assert!(largest < most, "{largest:e} up to {limit_rad} rad");
    }
}

fn sines(gpu: &super::Gpu, angles_rad: &[f32]) -> Vec<f32> {
    use wgpu::BufferUsages as Usage;
    let device = &gpu.device;
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[kernels::entry(
            0,
            wgpu::BufferBindingType::Storage { read_only: false },
        )],
    });
    let source = format!("{}{KERNEL}", kernels::SINE);
    let pipeline = kernels::pipeline(device, &layout, ("sines", &source));
    let buffer = |usage| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: size_of_val(angles_rad) as u64,
            usage,
            mapped_at_creation: false,
        })
    };
    let numbers = buffer(Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST);
    let readable = buffer(Usage::MAP_READ | Usage::COPY_DST);
    gpu.queue
        .write_buffer(&numbers, 0, bytemuck::cast_slice(angles_rad));
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &layout,
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: numbers.as_entire_binding() }],
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_bind_group(0, &bindings, &[]);
    pass.set_pipeline(&pipeline);
    pass.dispatch_workgroups((COUNT / 256) as u32, 1, 1);
    drop(pass);
    encoder.copy_buffer_to_buffer(&numbers, 0, &readable, 0, numbers.size());
    gpu.queue.submit([encoder.finish()]);
    readable
        .slice(..)
        .map_async(wgpu::MapMode::Read, |mapped| mapped.expect("mappable"));
    device
        .poll(wgpu::PollType::wait_indefinitely())
        .expect("the copy ends");
    gpu.check().unwrap();
    let bytes = readable.slice(..).get_mapped_range().expect("mapped above");
    bytemuck::pod_collect_to_vec(&bytes)
}
