//! The drive on a graphics card: an avatar's full field at every vertex, skinning and normals as compute shaders.
//!
//! In: a [`wgpu::Adapter`] and a [`Driver`](crate::Driver), whose twin it is. Out: the same
//! [`AvatarMesh`](crate::AvatarMesh) within a hundredth of a millimetre, or an error: then the caller goes on with the
//! processor, as [`LiveDriver`](crate::LiveDriver) does.

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
