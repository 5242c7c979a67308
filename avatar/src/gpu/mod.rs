//! An avatar's field on a graphics card, as compute shaders: driven ([`GpuDriver`]) and learned ([`GpuGradients`]).
//!
//! In: a [`wgpu::Adapter`], and a [`Driver`](crate::Driver) or the fields of a step of fine-tuning. Out: what the twin on
//! the processor gives, meshes within a hundredth of a millimetre and gradients within a hundred-thousandth, or an error:
//! then the caller goes on with the processor, as [`LiveDriver`](crate::LiveDriver) and
//! [`FineTuner`](crate::fine_tune::FineTuner) do.

mod buffers;
mod device;
mod driver;
mod error;
mod kernels;
mod layout;
mod learner;
#[cfg(test)]
mod tests;

pub use device::Gpu;
pub use driver::GpuDriver;
pub use error::GpuError;
pub use learner::GpuGradients;
