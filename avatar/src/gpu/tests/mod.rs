//! The kernels against their twins on the processor, on whatever adapter there is; without one these tests are skipped.

mod faults;
mod learn;
mod sine;

use std::sync::Arc;

use effigy_capture::FrameId;
use effigy_registration::{BodyParams, smpl::builtin};
use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

use super::{Gpu, GpuDriver};
use crate::{
    AvatarMesh, DriveConfig, Driver,
    hyper::{self, HeadKind, HyperConfig, HyperNetwork},
    model::{Avatar, Subject, TopologyConfig},
    sdf::SirenConfig,
    skinning::{ClosestBodyPoint, ClosestBodyPointConfig},
    testing::everyday_poses,
};

fn gpu() -> Option<Arc<Gpu>> {
    match Gpu::of_this_machine() {
        Ok(gpu) => {
            println!("on {}", gpu.name());
            Some(Arc::new(gpu))
        }
        Err(reason) => {
            println!("skipped: {reason}");
            None
        }
    }
}

/// The prior's person, with few vertices.
fn prior_avatar() -> Avatar {
    let body = builtin::body();
    let subject = Subject::new(&body, &[0.0; 10]).unwrap();
    let skinning = ClosestBodyPoint::new(body, &[0.0; 10], ClosestBodyPointConfig::default());
    let topology = TopologyConfig { vertices: 1500, relax_rounds: 1, smooth_rounds: 2 };
    let theta = everyday_poses()[0].theta;
    Avatar::new(
        &subject,
        Arc::new(hyper::prior()),
        &skinning,
        &theta,
        &topology,
    )
    .unwrap()
}

fn driver(avatar: Avatar) -> Driver {
    Driver::new(Arc::new(avatar), DriveConfig::default())
}

/// The prior's person with a field of another shape, drawn at random, whose values are some millimetres: beyond what
/// vertices may be moved by, clamped ones would all be alike.
fn random_avatar(field: SirenConfig) -> Avatar {
    let config = HyperConfig { field, heads: HeadKind::LowRank(4), person: 0 };
    let mut network = HyperNetwork::untrained(config, 7);
    let (weight, bias) = field.split_mut(&mut network.meta, field.layers - 1);
    bias.fill(0.0);
    for weight in weight {
        *weight *= 0.02;
    }
    // Heads that know nothing add nothing.
    let mut rng = StdRng::seed_from_u64(8);
    for value in network.values_mut().into_iter().flatten() {
        *value += rng.random_range(-3e-4..3e-4);
    }
    Avatar { field: Arc::new(network), ..prior_avatar() }
}

/// Single precision, summed in another order, comes to 0.0003 mm; compilers may round otherwise.
const MOST_P99_MM: f32 = 0.005;

/// A step that ends beside the settled length may be the last one on one side only: a tenth of 3 mm is left to it as a rule.
const MOST_MM: f32 = 0.4;

/// Edges of some 30 mm turn by less, where their ends are as near to the twin's as asked for.
const MOST_NORMALS_P99_RAD: f32 = 0.002;

/// How far vertices are apart, in rising order.
fn differences_mm(a: &[Vec3], b: &[Vec3]) -> Vec<f32> {
    let mut differences: Vec<f32> = a.iter().zip(b).map(|(a, b)| a.distance(*b) * 1e3).collect();
    differences.sort_by(f32::total_cmp);
    differences
}

fn assert_same(ours: &AvatarMesh, twin: &AvatarMesh) {
    assert_eq!((ours.frame, ours.theta), (twin.frame, twin.theta));
    assert_eq!(ours.triangles, twin.triangles);
    for (what, a, b) in [
        ("canonical", &ours.canonical, &twin.canonical),
        ("posed", &ours.vertices, &twin.vertices),
    ] {
        assert_eq!(a.len(), b.len());
        let differences = differences_mm(a, b);
        let (p99, largest) = (
            differences[differences.len() * 99 / 100],
            differences[differences.len() - 1],
        );
        println!("{what}: p99 {p99:.6} mm, largest {largest:.6} mm");
        assert!(
            p99 < MOST_P99_MM && largest < MOST_MM,
            "{what}: {p99} mm, {largest} mm"
        );
    }
    assert_eq!(ours.normals.len(), twin.normals.len());
    let normals = ours.normals.iter().zip(&twin.normals);
    let mut apart: Vec<f32> = normals.map(|(a, b)| a.distance(*b)).collect();
    apart.sort_by(f32::total_cmp);
    let p99 = apart[apart.len() * 99 / 100];
    println!(
        "normals: p99 {p99:.6} rad, largest {:.6} rad",
        apart[apart.len() - 1]
    );
    assert!(p99 < MOST_NORMALS_P99_RAD, "{p99} rad");
}

/// The meshes of some poses, the same on both sides; none without an adapter.
fn compared(avatar: Avatar) -> Vec<AvatarMesh> {
    let Some(gpu) = gpu() else {
        return Vec::new();
    };
    let mut cpu = driver(avatar);
    let mut ours = GpuDriver::new(&gpu, &cpu).unwrap();
    let mut posed = |(number, params): (usize, &BodyParams)| {
        let frame = FrameId(number as u64);
        let (ours, twin) = (ours.pose(params, frame).unwrap(), cpu.pose(params, frame));
        let rest = &cpu.avatar().topology.vertices_in_unit;
        let unit_box = cpu.avatar().subject.unit_box;
        let rest: Vec<Vec3> = rest
            .iter()
            .map(|&v| unit_box.canonical_from_unit(v))
            .collect();
        let moved = differences_mm(&ours.canonical, &rest);
        let of = |percent: usize| moved[(moved.len() - 1) * percent / 100];
        println!(
            "pose {number}: clothes move by {:.2} mm (median), {:.2} mm (p99)",
            of(50),
            of(99)
        );
        assert_same(&ours, &twin);
        ours
    };
    everyday_poses()
        .iter()
        .enumerate()
        .map(&mut posed)
        .collect()
}

#[test]
fn a_gpu_poses_the_prior_as_the_processor_does() {
    for pair in compared(prior_avatar()).windows(2) {
        // One pose would pass for another if nothing depended on it.
        for (a, b) in [
            (&pair[0].canonical, &pair[1].canonical),
            (&pair[0].vertices, &pair[1].vertices),
        ] {
            assert!(differences_mm(a, b)[a.len() * 99 / 100] > 5.0);
        }
    }
}

#[test]
fn a_gpu_poses_a_field_of_the_papers_shape_as_the_processor_does() {
    compared(random_avatar(SirenConfig::PAPER));
}

#[test]
fn a_gpu_poses_small_and_shallow_fields_as_the_processor_does() {
    for field in [
        SirenConfig { hidden: 32, layers: 2 },
        SirenConfig { hidden: 48, layers: 3 },
        SirenConfig { hidden: 192, layers: 4 },
    ] {
        println!("{field:?}");
        compared(random_avatar(field));
    }
}
