//! Memory of a device: making it, binding it, reading it back.

use std::{sync::mpsc::sync_channel, time::Duration};

use super::{device::Gpu, error::GpuError};

/// A device that takes longer hangs: what we ask for takes milliseconds, seconds where the processor plays the device.
const PATIENCE: Duration = Duration::from_secs(10);

pub(super) fn buffer(
    device: &wgpu::Device,
    label: &str,
    bytes: usize,
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes as u64,
        usage,
        mapped_at_creation: false,
    })
}

/// Of a buffer that shaders see.
pub(super) fn most_bytes(gpu: &Gpu) -> u64 {
    let limits = gpu.device.limits();
    limits
        .max_storage_buffer_binding_size
        .min(limits.max_buffer_size)
}

/// Whole buffers, in the order of their bindings.
pub(super) fn bound(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry {
            binding,
            resource: buffer.as_entire_binding(),
        })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(label),
        layout,
        entries: &entries,
    })
}

/// Waits for what was submitted and shows the bytes of a buffer that it wrote.
pub(super) fn read_back<R>(
    gpu: &Gpu,
    readable: &wgpu::Buffer,
    submission: wgpu::SubmissionIndex,
    read: impl FnOnce(&[u8]) -> R,
) -> Result<R, GpuError> {
    let (tell, told) = sync_channel(1);
    readable
        .slice(..)
        .map_async(wgpu::MapMode::Read, move |mapped| {
            // Nobody listens any more after an error.
            drop(tell.send(mapped));
        });
    let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: Some(PATIENCE) };
    let waited = gpu.device.poll(wait);
    gpu.check()?;
    waited.map_err(|error| gave_no_answer(gpu, &error))?;
    // Whoever polls or submits on another thread may be the one that calls.
    match told.recv_timeout(PATIENCE) {
        Ok(Ok(())) => {}
        Ok(Err(error)) => return Err(gpu.failed(&error)),
        Err(_) => return Err(gpu.failed(&"what it computed cannot be read")),
    }
    let bytes = readable.slice(..).get_mapped_range();
    let bytes = bytes.map_err(|error| gpu.failed(&error))?;
    let result = read(&bytes);
    drop(bytes);
    readable.unmap();
    Ok(result)
}

fn gave_no_answer(gpu: &Gpu, error: &wgpu::PollError) -> GpuError {
    let adapter = gpu.name().to_owned();
    match error {
        wgpu::PollError::Timeout => GpuError::Silent { adapter, secs: PATIENCE.as_secs() },
        // A lost device takes no work; why it was lost it tells only who asks once more.
        wgpu::PollError::WrongSubmissionIndex(..) => {
            let asked = gpu.device.poll(wgpu::PollType::Poll);
            let why = asked
                .err()
                .map_or_else(String::new, |error| error.to_string());
            gpu.check().err().unwrap_or(GpuError::Lost { adapter, why })
        }
    }
}
