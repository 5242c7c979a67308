//! An adapter opened for computing, and the first thing that went wrong with it.

use std::{
    fmt,
    sync::{Arc, Mutex, OnceLock, PoisonError},
};

use super::{error::GpuError, kernels::Kernels, learner::LearnKernels};

/// A device of our own: what fails on it fails nobody else, and its errors come here.
pub struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    name: String,
    is_software: bool,
    first_fault: Arc<OnceLock<GpuError>>,
    /// Those that were asked for last: avatars of one prior share them.
    kernels: Mutex<Option<Arc<Kernels>>>,
    learn_kernels: Mutex<Option<Arc<LearnKernels>>>,
}

impl Gpu {
    /// On this machine's fastest adapter; one in software where there is no other.
    pub fn of_this_machine() -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY),
            ..wgpu::InstanceDescriptor::new_without_display_handle_from_env()
        });
        let request = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..wgpu::RequestAdapterOptions::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&request))
            .map_err(|error| GpuError::NoAdapter { why: on_one_line(&error) })?;
        Self::open(&adapter)
    }

    /// On this adapter, which others may use too: the window, say.
    pub fn open(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        let name = short_name(&info.name);
        if info.backend == wgpu::Backend::Gl {
            // Its compute shaders are optional, and its one context is shared with whoever draws.
            return Err(GpuError::Backend { adapter: name, backend: info.backend.to_string() });
        }
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("effigy"),
            required_limits: limits(&adapter.limits()),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..wgpu::DeviceDescriptor::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&descriptor)).map_err(|error| {
                GpuError::NoDevice { adapter: name.clone(), why: on_one_line(&error) }
            })?;
        let first_fault = Arc::new(OnceLock::new());
        remember_faults(&device, &name, &first_fault);
        Ok(Self {
            device,
            queue,
            name,
            is_software: info.device_type == wgpu::DeviceType::Cpu,
            first_fault,
            kernels: Mutex::default(),
            learn_kernels: Mutex::default(),
        })
    }

    /// "AMD Radeon RX 7600".
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether the processor plays the graphics card: correct, and slower than the processor's own drive.
    pub fn is_software(&self) -> bool {
        self.is_software
    }

    /// Compiles what driving fields so wide needs, so that the first avatar need not wait for it.
    pub fn prepare_to_drive(&self, hidden: usize) -> Result<(), GpuError> {
        self.kernels(hidden).map(drop)
    }

    /// The same for learning them.
    pub fn prepare_to_learn(&self, hidden: usize) -> Result<(), GpuError> {
        self.learn_kernels(hidden).map(drop)
    }

    pub(super) fn kernels(&self, hidden: usize) -> Result<Arc<Kernels>, GpuError> {
        let is_fit = |kernels: &Kernels| kernels.hidden == hidden;
        kept(&self.kernels, is_fit, || Kernels::new(self, hidden))
    }

    pub(super) fn learn_kernels(&self, hidden: usize) -> Result<Arc<LearnKernels>, GpuError> {
        let is_fit = |kernels: &LearnKernels| kernels.hidden == hidden;
        kept(&self.learn_kernels, is_fit, || {
            LearnKernels::new(self, hidden)
        })
    }

    /// The first thing that went wrong with the device, if anything did.
    pub(super) fn check(&self) -> Result<(), GpuError> {
        self.first_fault.get().cloned().map_or(Ok(()), Err)
    }

    /// Whoever asks from now on is told this, if nothing went wrong before.
    pub(super) fn remember(&self, fault: &GpuError) {
        self.first_fault.get_or_init(|| fault.clone());
    }

    pub(super) fn failed(&self, why: &impl fmt::Display) -> GpuError {
        GpuError::Failed { adapter: self.name.clone(), why: on_one_line(why) }
    }
}

/// What was asked for last, if it fits; otherwise it is made.
fn kept<K>(
    last: &Mutex<Option<Arc<K>>>,
    is_fit: impl Fn(&K) -> bool,
    make: impl FnOnce() -> Result<K, GpuError>,
) -> Result<Arc<K>, GpuError> {
    let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(kept) = last.as_ref().filter(|kept| is_fit(kept)) {
        return Ok(Arc::clone(kept));
    }
    let made = Arc::new(make()?);
    *last = Some(Arc::clone(&made));
    Ok(made)
}

/// Errors that nobody catches would end the program.
fn remember_faults(device: &wgpu::Device, name: &str, first_fault: &Arc<OnceLock<GpuError>>) {
    let (adapter, fault) = (name.to_owned(), Arc::clone(first_fault));
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        fault.get_or_init(|| {
            let why = match &error {
                wgpu::Error::OutOfMemory { .. } => "out of memory".to_owned(),
                other => on_one_line(other),
            };
            GpuError::Failed { adapter: adapter.clone(), why }
        });
    }));
    let (adapter, fault) = (name.to_owned(), Arc::clone(first_fault));
    device.set_device_lost_callback(move |reason, message| {
        fault.get_or_init(|| {
            let why = on_one_line(&format_args!("{reason:?} {message}"));
            GpuError::Lost { adapter: adapter.clone(), why }
        });
    });
}

/// What every adapter has, and for computing all that this one has.
fn limits(of_adapter: &wgpu::Limits) -> wgpu::Limits {
    wgpu::Limits {
        max_compute_invocations_per_workgroup: of_adapter.max_compute_invocations_per_workgroup,
        max_compute_workgroup_size_x: of_adapter.max_compute_workgroup_size_x,
        max_compute_workgroup_storage_size: of_adapter.max_compute_workgroup_storage_size,
        max_compute_workgroups_per_dimension: of_adapter.max_compute_workgroups_per_dimension,
        max_storage_buffer_binding_size: of_adapter.max_storage_buffer_binding_size,
        max_buffer_size: of_adapter.max_buffer_size,
        ..wgpu::Limits::downlevel_defaults().or_worse_values_from(of_adapter)
    }
}

/// Mesa adds its compiler's version in parentheses.
fn short_name(name: &str) -> String {
    name.split(" (").next().unwrap_or_default().to_owned()
}

fn on_one_line(message: &impl fmt::Display) -> String {
    let text = message.to_string();
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ")
}
