//! How long each stage takes on one thread: `cargo bench -p effigy-fusion`.

#[path = "../tests/scene/mod.rs"]
mod scene;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use effigy_capture::Rigid3;
use effigy_fusion::{
    CleanConfig, Cleaner, NormalMap, TsdfConfig, TsdfVolume,
    mesh::{
        closest_point::ClosestPoint,
        marching_cubes::marching_cubes,
        sample::sample_surface,
        z_buffer::{Faces, Rasterizer},
    },
    tsdf::DepthView,
};
use glam::{Vec3, vec3};
use scene::{AZURE, CAMERA, at, calibration, expose, figure, render, room};

/// A person 2 m away in a room: 30 k pixels of 640 x 576.
fn frames(criterion: &mut Criterion) {
    let view = render(&[room(), figure(at(0.0, 2.0), 4)], 0.0);
    let frames: Vec<_> = (0..4).map(|number| expose(&view, AZURE, number)).collect();
    let mut cleaner = Cleaner::new(calibration(AZURE), CleanConfig::default());
    let mut number = 0;
    criterion.bench_function("clean a frame", |bencher| {
        bencher.iter(|| {
            number += 1;
            black_box(cleaner.process(&frames[number % 4]).expect("the size fits"))
        });
    });
    let clean = cleaner.process(&frames[0]).expect("the size fits");
    criterion.bench_function("normals of a whole map", |bencher| {
        bencher.iter(|| black_box(NormalMap::from_vertices(&clean.vertices)));
    });
}

/// 7 k vertices and 14 k triangles over 30 k pixels.
fn meshes(criterion: &mut Criterion) {
    let body = figure(at(0.0, 2.0), 3);
    for (name, faces) in [
        ("rasterise both sides", Faces::Both),
        ("rasterise fronts", Faces::Front),
    ] {
        let mut rasterizer = Rasterizer::with_faces(CAMERA, faces);
        criterion.bench_function(name, |bencher| {
            bencher.iter(|| {
                black_box(rasterizer.draw(&body.vertices, &body.triangles));
            });
        });
    }
    let mut tree = ClosestPoint::from_mesh(&body).expect("the figure is a mesh");
    criterion.bench_function("build a tree over 20 k triangles", |bencher| {
        bencher.iter(|| black_box(ClosestPoint::from_mesh(&body)));
    });
    criterion.bench_function("refit it", |bencher| {
        bencher.iter(|| tree.refit(&body.vertices));
    });
    let near: Vec<Vec3> = sample_surface(&body, 1000, 0)
        .iter()
        .map(|sample| sample.point + 0.02 * sample.normal)
        .collect();
    criterion.bench_function("1000 nearest points, 2 cm away", |bencher| {
        bencher.iter(|| {
            near.iter()
                .map(|&point| tree.query(point).distance)
                .sum::<f32>()
        });
    });
    let size = 128;
    let values: Vec<f32> = (0..size * size * size)
        .map(|i| {
            vec3(
                (i % size) as f32,
                (i / size % size) as f32,
                (i / size / size) as f32,
            )
        })
        .map(|point| point.distance(Vec3::splat(64.0)) - 40.0)
        .collect();
    criterion.bench_function("marching cubes in 128^3", |bencher| {
        bencher.iter(|| black_box(marching_cubes(&values, [size; 3], Vec3::ZERO, 1.0)));
    });
}

fn volumes(criterion: &mut Criterion) {
    let view = render(&[room(), figure(at(0.0, 2.0), 4)], 0.0);
    let mut cleaner = Cleaner::new(calibration(AZURE), CleanConfig::default());
    let clean = cleaner
        .process(&expose(&view, AZURE, 0))
        .expect("the size fits");
    let camera = CAMERA.into();
    let depth_view = DepthView {
        points: &clean.vertices,
        normals: Some(&clean.normals),
        camera: &camera,
        volume_from_camera: Rigid3::IDENTITY,
    };
    let weight = |pixel: usize| if clean.person[pixel] { 1.0 } else { 0.0 };
    let mut volume = TsdfVolume::new(TsdfConfig::default());
    criterion.bench_function("integrate a person into a volume", |bencher| {
        bencher.iter(|| volume.integrate(&depth_view, weight));
    });
    criterion.bench_function("extract the volume's mesh", |bencher| {
        bencher.iter(|| black_box(volume.extract_mesh()));
    });
}

criterion_group!(benches, frames, meshes, volumes);
criterion_main!(benches);
