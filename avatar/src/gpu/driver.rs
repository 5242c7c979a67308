//! One avatar on one device: everything that stays is uploaded once, a pose takes its parameters up and its mesh down.

use std::sync::Arc;

use effigy_capture::FrameId;
use effigy_registration::{BodyParams, smpl::BoneTransforms};
use glam::Vec3;

use super::{
    buffers::{self, buffer},
    device::Gpu,
    error::GpuError,
    kernels::{self, Kernels, SKIN_GROUP, at_most},
    layout::{self, PoseBlock, rows},
};
use crate::{
    drive::{AvatarMesh, Driver},
    model::Avatar,
    sdf::{SirenConfig, SirenField},
};

/// Poses one avatar in its full field; the twin of a [`Driver`] without a map.
pub struct GpuDriver {
    gpu: Arc<Gpu>,
    avatar: Arc<Avatar>,
    kernels: Arc<Kernels>,
    buffers: Buffers,
    bindings: wgpu::BindGroup,
    pose: PoseBlock,
    steps: u32,
    packed: Vec<f32>,
}

struct Buffers {
    pose: wgpu::Buffer,
    field: wgpu::Buffer,
    vertices: wgpu::Buffer,
    result: wgpu::Buffer,
    fans: wgpu::Buffer,
    /// The result where the processor can read it.
    readable: wgpu::Buffer,
}

/// Canonical places, posed places, normals.
const PARTS: usize = 3;

impl GpuDriver {
    /// Refuses what the kernels do not do, and devices that are too small.
    pub fn new(gpu: &Arc<Gpu>, driver: &Driver) -> Result<Self, GpuError> {
        let (config, steps) = can_drive(driver)?;
        gpu.check()?;
        let kernels = gpu.kernels(config.hidden)?;
        let (avatar, drive) = (driver.avatar(), driver.config());
        let count = avatar.topology.vertices_in_unit.len();
        check_size(gpu, &kernels, count)?;
        let buffers = Buffers::new(gpu, driver, config)?;
        let unit_box = avatar.subject.unit_box;
        let metres_per_unit = unit_box.metres_per_unit();
        let pose = PoseBlock {
            vertex_count: count as u32,
            layers: config.layers as u32,
            settled: drive.settled_m / metres_per_unit,
            canonical_origin_m: unit_box.canonical_from_unit(Vec3::ZERO),
            metres_per_unit,
            longest: drive.max_offset_m / metres_per_unit,
            ..bytemuck::Zeroable::zeroed()
        };
        let driver = Self {
            bindings: buffers.bound(&gpu.device, &kernels.layout),
            gpu: Arc::clone(gpu),
            avatar: Arc::clone(avatar),
            kernels,
            buffers,
            pose,
            steps,
            packed: Vec::with_capacity(layout::packed_len(config)),
        };
        gpu.check()?;
        Ok(driver)
    }

    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// As [`Driver::pose`]; after an error neither this driver nor its device is of any use any more.
    pub fn pose(&mut self, params: &BodyParams, frame: FrameId) -> Result<AvatarMesh, GpuError> {
        self.posed(params, frame)
            .inspect_err(|error| self.gpu.remember(error))
    }

    fn posed(&mut self, params: &BodyParams, frame: FrameId) -> Result<AvatarMesh, GpuError> {
        self.upload(params)?;
        let submission = self.dispatch();
        let [canonical, vertices, normals] = self.download(submission)?;
        Ok(AvatarMesh {
            frame,
            theta: params.theta,
            canonical,
            vertices,
            normals,
            triangles: Arc::clone(&self.avatar.topology.triangles),
        })
    }

    fn upload(&mut self, params: &BodyParams) -> Result<(), GpuError> {
        let subject = &self.avatar.subject;
        let field = siren(&self.avatar, params)?;
        layout::pack(&field, &mut self.packed);
        // A number that is none makes all values none, and then no vertex moves; shaders may know no such numbers.
        let is_number = self.packed.iter().all(|x| x.is_finite());
        self.pose.steps = if is_number { self.steps } else { 0 };
        self.pose.trans_m = params.trans;
        let (bones, _) = BoneTransforms::from_pose(&params.theta, &subject.rest_joints);
        for (block, bone) in self.pose.bones.iter_mut().zip(&bones.0) {
            *block = rows(bone);
        }
        let queue = &self.gpu.queue;
        queue.write_buffer(&self.buffers.pose, 0, bytemuck::bytes_of(&self.pose));
        queue.write_buffer(&self.buffers.field, 0, bytemuck::cast_slice(&self.packed));
        Ok(())
    }

    fn dispatch(&self) -> wgpu::SubmissionIndex {
        let count = self.pose.vertex_count;
        let mut encoder = self
            .gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("drive") });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_bind_group(0, &self.bindings, &[]);
        for (kernel, vertices_a_group) in [
            (&self.kernels.project, self.kernels.tile.points()),
            (&self.kernels.skin, SKIN_GROUP),
            (&self.kernels.normals, SKIN_GROUP),
        ] {
            pass.set_pipeline(kernel);
            pass.dispatch_workgroups(count.div_ceil(vertices_a_group), 1, 1);
        }
        drop(pass);
        let Buffers { result, readable, .. } = &self.buffers;
        encoder.copy_buffer_to_buffer(result, 0, readable, 0, result.size());
        self.gpu.queue.submit([encoder.finish()])
    }

    fn download(&self, submission: wgpu::SubmissionIndex) -> Result<[Vec<Vec3>; PARTS], GpuError> {
        buffers::read_back(&self.gpu, &self.buffers.readable, submission, |bytes| {
            let part_bytes = bytes.len() / PARTS;
            std::array::from_fn(|part| {
                bytemuck::pod_collect_to_vec(&bytes[part * part_bytes..][..part_bytes])
            })
        })
    }
}

impl Buffers {
    fn new(gpu: &Gpu, driver: &Driver, config: SirenConfig) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let topology = &driver.avatar().topology;
        let count = topology.vertices_in_unit.len();
        let vertices = layout::vertices(driver);
        let fans = layout::fans(count, &topology.triangles);
        let result_bytes = PARTS * count * size_of::<Vec3>();
        let field_bytes = layout::packed_len(config) * size_of::<f32>();
        let allowed = buffers::most_bytes(gpu);
        for bytes in [
            size_of_val(&vertices[..]),
            size_of_val(&fans[..]),
            result_bytes,
            field_bytes,
        ] {
            at_most(gpu, "bytes in a buffer", bytes as u64, allowed)?;
        }
        let device = &gpu.device;
        let storage = Usage::STORAGE | Usage::COPY_DST;
        let buffers = Self {
            pose: buffer(
                device,
                "pose",
                size_of::<PoseBlock>(),
                Usage::UNIFORM | Usage::COPY_DST,
            ),
            field: buffer(device, "field", field_bytes, storage),
            vertices: buffer(device, "vertices", size_of_val(&vertices[..]), storage),
            result: buffer(
                device,
                "result",
                result_bytes,
                Usage::STORAGE | Usage::COPY_SRC,
            ),
            fans: buffer(device, "fans", size_of_val(&fans[..]), storage),
            readable: buffer(
                device,
                "readable",
                result_bytes,
                Usage::MAP_READ | Usage::COPY_DST,
            ),
        };
        // What could not be made must not be written to.
        gpu.check()?;
        gpu.queue
            .write_buffer(&buffers.vertices, 0, bytemuck::cast_slice(&vertices));
        gpu.queue
            .write_buffer(&buffers.fans, 0, bytemuck::cast_slice(&fans));
        Ok(buffers)
    }

    fn bound(&self, device: &wgpu::Device, layout: &wgpu::BindGroupLayout) -> wgpu::BindGroup {
        let Self { pose, field, vertices, result, fans, .. } = self;
        let all = [pose, field, vertices, result, fans];
        buffers::bound(device, "drive", layout, &all)
    }
}

/// The field's shape and the steps along normals, if the kernels can do what this driver does.
pub(super) fn can_drive(driver: &Driver) -> Result<(SirenConfig, u32), GpuError> {
    let avatar = driver.avatar();
    let params = BodyParams { theta: avatar.topology_theta, ..BodyParams::ZERO };
    let config = siren(avatar, &params)?.config();
    kernels::can_evaluate(config)?;
    let steps = u32::try_from(driver.config().steps).unwrap_or(u32::MAX);
    Ok((config, steps))
}

fn siren(avatar: &Avatar, params: &BodyParams) -> Result<SirenField, GpuError> {
    let pose = avatar.subject.pose_input(&params.theta);
    avatar
        .field
        .siren(&pose)
        .ok_or_else(|| GpuError::NotASiren { kind: avatar.field.kind().to_owned() })
}

fn check_size(gpu: &Gpu, kernels: &Kernels, vertices: usize) -> Result<(), GpuError> {
    let groups = gpu.device.limits().max_compute_workgroups_per_dimension;
    let allowed = u64::from(groups) * u64::from(kernels.tile.points());
    at_most(gpu, "vertices", vertices as u64, allowed)?;
    at_most(gpu, "vertices", vertices as u64, u64::from(u32::MAX / 9))
}
