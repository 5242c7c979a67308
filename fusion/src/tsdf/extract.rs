//! Turns a volume into a mesh.

use glam::{IVec3, Vec3};

use super::{
    TsdfVolume,
    block::{VOXELS, place_in_block},
};
use crate::mesh::{TriangleMesh, marching_cubes::marching_cubes_sparse};

impl TsdfVolume {
    /// The surface, with normals; it ends where nothing was seen.
    pub fn extract_mesh(&self) -> TriangleMesh {
        let cells = self
            .blocks
            .iter()
            .flat_map(|block| (0..VOXELS).map(|voxel| block.grid_point(voxel)));
        let value = |corner: IVec3| self.distance_m(corner);
        let mut mesh = marching_cubes_sparse(cells, value, Vec3::ZERO, self.config.voxel_size_m);
        mesh.compute_normals();
        mesh
    }

    /// NaN where too little was seen.
    fn distance_m(&self, at: IVec3) -> f32 {
        let Some(&block) = self.index_of.get(&super::block::block_of(at)) else {
            return f32::NAN;
        };
        let voxel = self.blocks[block as usize].voxel(place_in_block(at));
        if voxel.weight < self.config.min_weight {
            f32::NAN
        } else {
            voxel.distance_m
        }
    }
}

#[cfg(test)]
mod tests {
    use effigy_capture::{CameraModel, Intrinsics, Rigid3};
    use glam::{Quat, Vec3, vec3};

    use super::super::{DepthView, TsdfConfig, TsdfVolume};
    use crate::{
        maps::{DepthMap, NormalMap, Rays, VertexMap},
        mesh::{primitives::sphere, sample::SplitMix, z_buffer::Rasterizer},
    };

    const CAMERA: Intrinsics =
        Intrinsics { width: 320, height: 288, fx: 252.0, fy: 252.0, cx: 160.0, cy: 144.0 };
    const CENTER: Vec3 = vec3(0.05, 1.0, -0.1);
    const RADIUS_M: f32 = 0.3;
    const DISTANCE_M: f32 = 1.2;

    /// Cameras all around, at three heights, looking at the centre.
    fn cameras() -> Vec<Rigid3> {
        let turns = (0..12).flat_map(|step| [-0.9_f32, 0.0, 0.9].map(|tilt| (step, tilt)));
        turns
            .map(|(step, tilt)| {
                let turn = step as f32 * std::f32::consts::TAU / 12.0;
                let rotation = Quat::from_rotation_y(turn) * Quat::from_rotation_x(tilt);
                let translation = CENTER - rotation * vec3(0.0, 0.0, DISTANCE_M);
                Rigid3 { rotation, translation }
            })
            .collect()
    }

    fn fuse_sphere(sigma_m: f32, with_normals: bool) -> TsdfVolume {
        let camera = CameraModel::from(CAMERA);
        let rays = Rays::new(&camera);
        let truth = sphere(CENTER, RADIUS_M, 5);
        let mut rasterizer = Rasterizer::new(CAMERA);
        let mut random = SplitMix::new(5);
        let mut volume = TsdfVolume::new(TsdfConfig::default());
        for volume_from_camera in cameras() {
            let camera_from_volume = volume_from_camera.inverse();
            let vertices: Vec<Vec3> = truth
                .vertices
                .iter()
                .map(|&vertex| camera_from_volume * vertex)
                .collect();
            let raster = rasterizer.draw(&vertices, &truth.triangles);
            let noisy = |&depth: &f32| {
                let gauss = (0..12).map(|_| random.unit_f64() as f32).sum::<f32>() - 6.0;
                if depth > 0.0 {
                    depth + sigma_m * gauss
                } else {
                    f32::NAN
                }
            };
            let metres = raster.depth.iter().map(noisy).collect();
            let depth = DepthMap { width: raster.width, height: raster.height, metres };
            let points = VertexMap::unproject(&depth, &rays);
            let normals = NormalMap::from_vertices(&points);
            let view = DepthView {
                points: &points,
                normals: with_normals.then_some(&normals),
                camera: &camera,
                volume_from_camera,
            };
            volume.integrate(&view, |_| 1.0);
        }
        volume
    }

    #[test]
    fn fused_sphere_lies_within_half_a_voxel() {
        for (sigma_m, with_normals) in [(0.0, false), (0.0, true), (0.002, true)] {
            let mesh = fuse_sphere(sigma_m, with_normals).extract_mesh();
            let mut errors_m: Vec<f32> = mesh
                .vertices
                .iter()
                .map(|vertex| (vertex.distance(CENTER) - RADIUS_M).abs())
                .collect();
            errors_m.sort_by(f32::total_cmp);
            let p95_m = errors_m[errors_m.len() * 95 / 100];
            assert!(
                p95_m < 0.5 * TsdfConfig::default().voxel_size_m,
                "{sigma_m}: {p95_m} m"
            );
            assert!(mesh.is_watertight(), "{:?}", mesh.edge_report());
            let ball = 4.0 / 3.0 * std::f32::consts::PI * RADIUS_M.powi(3);
            assert!(
                (mesh.volume() / ball - 1.0).abs() < 0.02,
                "{} of {ball}",
                mesh.volume()
            );
        }
    }

    #[test]
    fn fusion_repeats_itself_for_any_number_of_threads() {
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| fuse_sphere(0.002, true).extract_mesh())
        };
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn an_empty_volume_has_no_mesh() {
        let mut volume = TsdfVolume::new(TsdfConfig::default());
        let points = VertexMap::empty(320, 288);
        let camera = CameraModel::from(CAMERA);
        let view = DepthView {
            points: &points,
            normals: None,
            camera: &camera,
            volume_from_camera: Rigid3::IDENTITY,
        };
        volume.integrate(&view, |_| 1.0);
        assert_eq!(volume.block_count(), 0);
        assert!(volume.extract_mesh().triangles.is_empty());
    }
}
