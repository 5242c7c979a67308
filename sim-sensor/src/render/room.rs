//! Floor and wall, exact for each pixel.

use effigy_capture::{Intrinsics, Rigid3};
use glam::{Vec3, vec3};

use super::{Label, View};
use crate::scenario::Room;

/// The wall stands this far behind the person.
const WALL_Z_M: f32 = -1.05;
const FLOOR: Surface = Surface { label: Label::Floor, reflectance: 0.55, color: [150, 138, 124] };
const WALL: Surface = Surface { label: Label::Wall, reflectance: 0.75, color: [206, 204, 198] };

#[derive(Clone, Copy)]
struct Surface {
    label: Label,
    reflectance: f32,
    color: [u8; 3],
}

/// The room with nobody in it.
pub(super) fn draw(camera: Intrinsics, world_from_camera: Rigid3, room: Room) -> View {
    let count = camera.pixel_count();
    let mut view = View {
        width: camera.width as usize,
        height: camera.height as usize,
        depth_m: vec![0.0; count],
        normals: vec![Vec3::ZERO; count],
        incidence_rad: vec![0.0; count],
        cosine: vec![0.0; count],
        labels: vec![Label::Nothing; count],
        reflectance: vec![0.0; count],
        colors: vec![[0; 3]; count],
        camera,
    };
    let planes: &[(Vec3, f32, Surface)] = match room {
        Room::Empty => &[],
        Room::Floor => &[(Vec3::Y, 0.0, FLOOR)],
        Room::FloorAndWall => &[(Vec3::Y, 0.0, FLOOR), (Vec3::Z, WALL_Z_M, WALL)],
    };
    for pixel in 0..count {
        let ray_in_world = world_from_camera.rotate(view.ray(pixel));
        for &(normal, offset_m, surface) in planes {
            let towards = normal.dot(ray_in_world);
            let depth_m = (offset_m - normal.dot(world_from_camera.translation)) / towards;
            let nearest = view.depth_m[pixel] == 0.0 || depth_m < view.depth_m[pixel];
            if towards >= 0.0 || depth_m <= 0.0 || !nearest {
                continue;
            }
            view.depth_m[pixel] = depth_m;
            view.normals[pixel] = world_from_camera.inverse().rotate(normal);
            view.measure_incidence(pixel);
            view.labels[pixel] = surface.label;
            view.reflectance[pixel] = surface.reflectance;
            view.colors[pixel] = checked(surface, world_from_camera * (view.ray(pixel) * depth_m));
        }
    }
    view
}

/// Tiles on the floor, so that one sees where the feet stand.
fn checked(surface: Surface, point_in_world: Vec3) -> [u8; 3] {
    const TILE_M: f32 = 0.5;
    let tile = (point_in_world * vec3(1.0, 0.0, 1.0) / TILE_M).floor();
    let dark = surface.label == Label::Floor && (tile.x + tile.z).rem_euclid(2.0) > 0.5;
    if dark {
        surface.color.map(|c| c - c / 8)
    } else {
        surface.color
    }
}
