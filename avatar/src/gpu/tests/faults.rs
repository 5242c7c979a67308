//! Lost devices, numbers that are none, and what the kernels refuse.

use std::sync::Arc;

use effigy_capture::FrameId;
use glam::Vec3;

use super::{
    super::{GpuDriver, GpuError, driver::can_drive, kernels::Tile},
    assert_same, driver, gpu, prior_avatar, random_avatar,
};
use crate::{
    LiveDriver, PoseField, PoseInput, SignedDistanceField,
    baselines::{Architecture, ConditionedField},
    hyper,
    model::Avatar,
    sdf::{SirenConfig, SirenField},
    testing::{everyday_poses, suit_avatar},
};

#[test]
fn a_lost_device_is_an_error_and_the_live_drive_goes_on_without_it() {
    let Some(gpu) = gpu() else {
        return;
    };
    let mut cpu = driver(prior_avatar());
    let mut on_gpu = GpuDriver::new(&gpu, &cpu).unwrap();
    let mut live = LiveDriver::on_gpu(driver(prior_avatar()), &gpu);
    let poses = everyday_poses();
    live.pose(&poses[0], FrameId(0));
    assert_eq!(live.device(), format!("{}, full field", gpu.name()));
    assert_eq!(live.gave_up(), None);

    gpu.device.destroy();
    let error = on_gpu.pose(&poses[1], FrameId(1)).unwrap_err();
    println!("{error}");
    assert!(matches!(error, GpuError::Lost { .. }), "{error:?}");
    for params in &poses {
        let mesh = live.pose(params, FrameId(1));
        let twin = cpu.pose(params, FrameId(1));
        assert_eq!((mesh.vertices, mesh.normals), (twin.vertices, twin.normals));
    }
    assert_eq!(live.device(), "CPU, full field");
    assert_eq!(live.gave_up(), Some(error.to_string().as_str()));

    // Nor does anybody start on it.
    let live = LiveDriver::on_gpu(driver(prior_avatar()), &gpu);
    assert_eq!(live.device(), "CPU, full field");
    assert_eq!(live.gave_up(), Some(error.to_string().as_str()));
}

#[test]
fn too_large_a_buffer_is_an_error_and_not_the_end() {
    let Some(gpu) = gpu() else {
        return;
    };
    let most = gpu.device.limits().max_buffer_size;
    drop(gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("too large"),
        size: most + 4,
        usage: wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    }));
    let live = LiveDriver::on_gpu(driver(prior_avatar()), &gpu);
    let reason = live.gave_up().expect("the device has failed");
    println!("{reason}");
    assert!(reason.contains("failed"), "{reason}");
}

#[test]
fn what_the_kernels_do_not_do_is_refused_with_its_reason() {
    let baseline = ConditionedField::new(Architecture::Siren, 1);
    let kind = baseline.kind().to_owned();
    let baseline = Avatar { field: Arc::new(baseline), ..prior_avatar() };
    assert_eq!(
        can_drive(&driver(baseline)),
        Err(GpuError::NotASiren { kind })
    );

    let kind = "inflated-body".to_owned();
    assert_eq!(
        can_drive(&driver(suit_avatar(0.0))),
        Err(GpuError::NotASiren { kind })
    );

    let config = SirenConfig { hidden: 40, layers: 4 };
    let narrow = driver(random_avatar(config));
    assert_eq!(can_drive(&narrow), Err(GpuError::FieldShape { config }));

    let (config, steps) = can_drive(&driver(prior_avatar())).unwrap();
    assert_eq!((config, steps), (SirenConfig::LIVE, 3));
}

#[test]
fn wide_fields_take_smaller_tiles_and_too_wide_ones_none() {
    const BYTES: u32 = 16_384;
    let for_width = |hidden| Tile::that_takes(|tile| tile.workgroup_bytes(hidden), BYTES);
    assert_eq!(for_width(128), Some(Tile::Of16));
    assert_eq!(for_width(256), Some(Tile::Of8));
    assert_eq!(for_width(512), None);
}

/// The prior's field in the pose of its topology, one with broken parameters in all others.
struct Broken {
    at: PoseInput,
    config: SirenConfig,
    parameters: Vec<f32>,
}

impl PoseField for Broken {
    fn field(&self, pose: &PoseInput) -> Box<dyn SignedDistanceField> {
        Box::new(self.siren(pose).expect("always"))
    }

    fn siren(&self, pose: &PoseInput) -> Option<SirenField> {
        let whole = || hyper::prior().field(pose);
        let broken = || SirenField::new(self.config, self.parameters.clone());
        Some(if *pose == self.at { whole() } else { broken() })
    }

    fn kind(&self) -> &'static str {
        "broken"
    }

    fn to_bytes(&self) -> Vec<u8> {
        Vec::new()
    }
}

/// How far each vertex is from its topology place, millimetres, on both sides.
fn moved_by_broken(spoil: impl FnOnce(SirenConfig, &mut [f32])) -> Option<Vec<f32>> {
    let gpu = gpu()?;
    let avatar = prior_avatar();
    let at = avatar.subject.pose_input(&avatar.topology_theta);
    let meta = hyper::prior().meta_field();
    let (config, mut parameters) = (meta.config(), meta.parameters().to_vec());
    spoil(config, &mut parameters);
    let field = Arc::new(Broken { at, config, parameters });
    let mut cpu = driver(Avatar { field, ..avatar });
    let mut ours = GpuDriver::new(&gpu, &cpu).unwrap();
    let params = everyday_poses()[1];
    let mesh = ours.pose(&params, FrameId(0)).unwrap();
    assert_same(&mesh, &cpu.pose(&params, FrameId(0)));
    let avatar = cpu.avatar();
    let unit_box = avatar.subject.unit_box;
    let rest = &avatar.topology.vertices_in_unit;
    let moved =
        |(vertex, &rest): (&Vec3, &Vec3)| vertex.distance(unit_box.canonical_from_unit(rest)) * 1e3;
    Some(mesh.canonical.iter().zip(rest).map(moved).collect())
}

#[test]
fn a_field_with_a_parameter_that_is_no_number_moves_nothing() {
    let moved = moved_by_broken(|config, parameters| {
        parameters[config.layer_range(2).start + 5] = f32::NAN;
    });
    if let Some(moved) = moved {
        assert!(moved.iter().all(|&mm| mm < 0.001));
    }
}

#[test]
fn a_value_beyond_all_numbers_leaves_its_vertex_where_it_is() {
    let moved = moved_by_broken(|config, parameters| {
        let (weight, bias) = config.split_mut(parameters, config.layers - 1);
        weight.fill(0.0);
        // Infinite where the first unit is above zero, enormous elsewhere.
        (weight[0], bias[0]) = (f32::MAX, f32::MAX);
    });
    let Some(moved) = moved else {
        return;
    };
    let still = moved.iter().filter(|&&mm| mm < 0.001).count();
    let at_the_end = moved.iter().filter(|&&mm| (mm - 50.0).abs() < 0.01).count();
    println!("{still} stay, {at_the_end} go as far as they may");
    assert!(still > 50 && at_the_end > 50 && still + at_the_end == moved.len());
}
