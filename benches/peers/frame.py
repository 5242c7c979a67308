"""What happens to a frame, in other people's packages: Open3D's volume and normals, scikit-image's marching cubes,
linear blend skinning in numpy; on what `effigy bench --keep` worked on."""

import json
import pathlib
import tempfile

import numpy as np
import open3d as o3d
from skimage.measure import marching_cubes

from effigy_bench import arguments, bench, compare, timed


def volume(inputs, depth):
    """Integration of one view into a volume that has seen it before."""
    camera = inputs["intrinsics"]
    pinhole = o3d.camera.PinholeCameraIntrinsic(
        camera["width"], camera["height"], camera["fx"], camera["fy"], camera["cx"], camera["cy"]
    )
    grey = o3d.geometry.Image(np.zeros(depth.shape, np.uint8).repeat(3).reshape(*depth.shape, 3))
    picture = o3d.geometry.RGBDImage.create_from_color_and_depth(
        grey, o3d.geometry.Image(depth), depth_scale=1 / inputs["metres_per_unit"], depth_trunc=10.0
    )
    tsdf = o3d.pipelines.integration.ScalableTSDFVolume(
        voxel_length=inputs["voxel_m"],
        sdf_trunc=inputs["truncation_m"],
        color_type=o3d.pipelines.integration.TSDFVolumeColorType.NoColor,
    )
    extrinsic = np.eye(4)
    return lambda: tsdf.integrate(picture, pinhole, extrinsic)


def block_grid(inputs, depth):
    """The same with Open3D's newer tensor volume."""
    camera = inputs["intrinsics"]
    core = o3d.core
    matrix = core.Tensor(
        [[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]], core.Dtype.Float64
    )
    extrinsic = core.Tensor.eye(4, core.Dtype.Float64)
    picture = o3d.t.geometry.Image(core.Tensor(depth))
    scale, far = 1 / inputs["metres_per_unit"], 10.0
    grid = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (core.Dtype.Float32, core.Dtype.Float32), ((1), (1)), inputs["voxel_m"], 8, 20000
    )
    times = inputs["truncation_m"] / inputs["voxel_m"]

    def step():
        blocks = grid.compute_unique_block_coordinates(picture, matrix, extrinsic, scale, far, times)
        grid.integrate(blocks, picture, matrix, extrinsic, scale, far, times)

    return step


def normals(inputs, depth):
    """Open3D's normal map from a vertex map, and its normals of a cloud."""
    camera = inputs["intrinsics"]
    core = o3d.core
    matrix = core.Tensor(
        [[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]], core.Dtype.Float64
    )
    metres = o3d.t.geometry.Image(core.Tensor(depth.astype(np.float32) * inputs["metres_per_unit"]))
    vertices = metres.create_vertex_map(matrix, float("nan"))
    return lambda: vertices.create_normal_map(float("nan"))


def skinning(inputs):
    count, joints = inputs["body_vertices"], inputs["joints"]
    random = np.random.default_rng(1)
    weights = random.random((count, joints)).astype(np.float32)
    weights /= weights.sum(1, keepdims=True)
    bones = np.tile(np.eye(4, dtype=np.float32), (joints, 1, 1))
    points = np.concatenate([random.random((count, 3)), np.ones((count, 1))], 1).astype(np.float32)

    def step():
        blended = (weights @ bones.reshape(joints, 16)).reshape(count, 4, 4)
        return np.einsum("vij,vj->vi", blended, points)[:, :3]

    return step


# Calls of each package in its turn.
CALLS = 15


def main():
    options = arguments(__doc__).parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        bench(options.effigy, "fusion", "--quick", "--keep", name)
        inputs = json.loads((folder / "inputs.json").read_text())
        depth = np.asarray(o3d.io.read_image(str(folder / inputs["depth_png"])))
        side = inputs["grid_side"]
        grid = np.fromfile(folder / inputs["grid_f32"], np.float32).reshape(side, side, side)
    print(f"Open3D {o3d.__version__}, numpy {np.__version__}\n")
    integrate = "integrate a person into a volume"
    peers = [
        ("Open3D ScalableTSDFVolume", integrate, timed(volume(inputs, depth), CALLS)),
        ("Open3D VoxelBlockGrid", integrate, timed(block_grid(inputs, depth), CALLS)),
        ("Open3D normal map", "normals of a map, 640x576", timed(normals(inputs, depth), CALLS)),
        ("scikit-image", f"marching cubes, {side}^3", timed(lambda: marching_cubes(grid, 0.0), CALLS)),
        ("numpy, skinning alone", "pose the body", timed(skinning(inputs), CALLS)),
    ]
    compare(options.rounds, lambda: bench(options.effigy, "fusion"), peers)


if __name__ == "__main__":
    main()
