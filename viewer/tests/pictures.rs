//! Pictures against what geometry says must be in them.

use std::f32::consts::PI;

use effigy_capture::{FrameId, Intrinsics, Rigid3, Timestamp};
use effigy_fusion::{
    CleanFrame, DepthMap, NormalMap, TriangleMesh, VertexMap, clean::PersonVisibility,
    mesh::primitives::sphere,
};
use effigy_viewer::pictures::{
    Clay, DepthRange, Framing, HeatScale, MeshView, OverlayStyle, Picture, PictureCamera,
    body_over_depth, clean_picture, heat_picture, near_to_far, palette, render_mesh, side_by_side,
};
use glam::{Quat, Vec3, vec3};

const RADIUS_M: f32 = 0.3;
const DISTANCE_M: f32 = 2.0;
const SIZE: [u32; 2] = [160, 200];
const SENSOR: Intrinsics =
    Intrinsics { width: 160, height: 144, fx: 126.0, fy: 126.0, cx: 79.5, cy: 71.5 };

fn ball() -> TriangleMesh {
    sphere(Vec3::ZERO, RADIUS_M, 4)
}

fn silhouette_px(picture: &Picture) -> f32 {
    picture.pixels().filter(|p| p.0 != palette::PANEL).count() as f32
}

/// A ball looks like a disc: its tangent rays make a cone of half-angle asin(r / d).
fn disc_px(focal_px: f32, distance_m: f32) -> f32 {
    let radius_px = focal_px * RADIUS_M / (distance_m * distance_m - RADIUS_M * RADIUS_M).sqrt();
    PI * radius_px * radius_px
}

#[test]
fn a_balls_silhouette_has_the_area_of_its_cone_of_rays() {
    let camera = PictureCamera::orbit(Vec3::ZERO, DISTANCE_M, [0.7, 0.3], SIZE);
    let picture = render_mesh(MeshView::from(&ball()), &camera, Clay::default());
    let expected = disc_px(camera.intrinsics.fx, DISTANCE_M);
    // Half-covered pixels of the rim count as whole: half a pixel all around, 0.7 % each at this radius.
    let share = silhouette_px(&picture) / expected;
    assert!((0.99..1.04).contains(&share), "{share}");
}

#[test]
fn the_key_light_comes_from_the_upper_left() {
    let camera = PictureCamera::orbit(Vec3::ZERO, DISTANCE_M, [0.0, 0.0], SIZE);
    let picture = render_mesh(MeshView::from(&ball()), &camera, Clay::default());
    let [x, y] = [SIZE[0] / 2, SIZE[1] / 2];
    let brightness = |dx: i32, dy: i32| {
        let [x, y] = [x as i32 + dx, y as i32 + dy].map(|v| v as u32);
        u32::from(picture.get_pixel(x, y).0[1])
    };
    assert!(brightness(-25, -25) > brightness(25, 25) + 60);
}

#[test]
fn vertex_colours_replace_the_clay() {
    let mut mesh = ball();
    mesh.colors = vec![[0, 0, 255]; mesh.vertices.len()];
    let camera = PictureCamera::orbit(Vec3::ZERO, DISTANCE_M, [0.0, 0.0], SIZE);
    let picture = render_mesh(MeshView::from(&mesh), &camera, Clay::default());
    let [r, g, b] = picture.get_pixel(SIZE[0] / 2, SIZE[1] / 2).0;
    assert!(r == 0 && g == 0 && b > 100, "{:?}", [r, g, b]);
}

#[test]
fn a_broken_mesh_is_drawn_as_far_as_it_is_whole() {
    let mut mesh = ball();
    mesh.vertices[0] = Vec3::NAN;
    let camera = PictureCamera::around(&mesh.vertices, 0.0, 0.0, SIZE);
    assert!(
        silhouette_px(&render_mesh(
            MeshView::from(&mesh),
            &camera,
            Clay::default()
        )) > 1000.0
    );
    let empty = render_mesh(MeshView::new(&[], &[]), &camera, Clay::default());
    assert_eq!(silhouette_px(&empty), 0.0);
}

#[test]
fn a_heat_picture_without_distances_is_dark_and_with_them_is_bright() {
    let mesh = ball();
    let camera = PictureCamera::around(&mesh.vertices, 0.0, 0.0, SIZE);
    let scale = HeatScale { largest_m: 0.01 };
    let middle = |distance_m: f32| {
        let distances = vec![distance_m; mesh.vertices.len()];
        let picture = heat_picture(MeshView::from(&mesh), &distances, scale, &camera);
        picture
            .get_pixel(SIZE[0] / 2, SIZE[1] / 2)
            .0
            .map(u32::from)
            .iter()
            .sum::<u32>()
    };
    assert!(middle(0.01) > middle(0.0) + 150);
}

/// A ball 2 m in front of a level camera before a wall at 3 m.
fn ball_frame() -> (CleanFrame, Rigid3) {
    let (width, height) = (SENSOR.width as usize, SENSOR.height as usize);
    let center = vec3(0.0, 0.0, DISTANCE_M);
    let hit = |pixel: usize| {
        let at = glam::vec2((pixel % width) as f32, (pixel / width) as f32);
        let ray = SENSOR.unproject(at, 1.0);
        let (a, b) = (ray.length_squared(), ray.dot(center));
        let root = b * b - a * (center.length_squared() - RADIUS_M * RADIUS_M);
        (root > 0.0).then(|| ray * ((b - root.sqrt()) / a))
    };
    let hits: Vec<Option<Vec3>> = (0..width * height).map(hit).collect();
    let metres = hits.iter().map(|h| h.map_or(3.0, |p| p.z)).collect();
    let normals = hits
        .iter()
        .map(|h| h.map_or(Vec3::NEG_Z, |p| (p - center) / RADIUS_M))
        .collect();
    let points = hits.iter().map(|h| h.unwrap_or(Vec3::NAN)).collect();
    let clean = CleanFrame {
        id: FrameId(0),
        timestamp: Timestamp(0),
        depth: DepthMap { width, height, metres },
        vertices: VertexMap { width, height, points },
        normals: NormalMap { width, height, normals },
        person: hits.iter().map(Option::is_some).collect(),
        sigma_m: vec![0.001; width * height],
        floor: None,
        visibility: PersonVisibility::Whole,
    };
    let rotation = Quat::from_rotation_x(PI);
    (
        clean,
        Rigid3 { rotation, translation: vec3(0.0, 0.0, DISTANCE_M) },
    )
}

#[test]
fn the_person_keeps_its_colour_and_the_room_turns_grey() {
    let (clean, _) = ball_frame();
    let range = DepthRange { near_m: 1.5, far_m: 3.5 };
    let picture = clean_picture(&clean, range, &Framing::whole(160, 144));
    let [r, _, b] = picture.get_pixel(79, 71).0.map(i32::from);
    // Near is yellow.
    assert!(r > b + 60, "{r} {b}");
    let [r, g, b] = picture.get_pixel(3, 3).0.map(i32::from);
    assert!(
        (r - b).abs() < 12 && (r - g).abs() < 12 && r < 90,
        "{r} {g} {b}"
    );
    assert_eq!(near_to_far(1.5, 1.5, 3.5), near_to_far(0.0, 1.5, 3.5));
}

#[test]
fn a_body_that_fits_covers_the_person_and_nothing_else() {
    let (clean, world_from_camera) = ball_frame();
    let mesh = ball();
    let framing = Framing::whole(160, 144);
    let sensor = (&SENSOR, world_from_camera);
    let style = OverlayStyle { color: [0, 255, 0], opacity: 1.0 };
    let picture = body_over_depth(&clean, MeshView::from(&mesh), sensor, &framing, style);
    let green = |p: [u8; 3]| p[1] > p[0].saturating_add(25) && p[1] > p[2].saturating_add(25);
    let differs = picture
        .pixels()
        .zip(&clean.person)
        .filter(|(p, inside)| green(p.0) != **inside);
    // The rim: a pixel's centre may be in for one and out for the other.
    let rim_px = 2.0 * PI * 19.0;
    assert!((differs.count() as f32) < 0.3 * rim_px);
}

#[test]
fn the_persons_framing_fills_most_of_the_picture() {
    let (clean, world_from_camera) = ball_frame();
    let framing = Framing::person(&clean, [200, 200]);
    let seen = framing.intrinsics(&SENSOR);
    let camera = PictureCamera::of_sensor(&SENSOR, world_from_camera, &framing);
    let picture = render_mesh(MeshView::from(&ball()), &camera, Clay::default());
    let share = silhouette_px(&picture) / disc_px(seen.fx, DISTANCE_M);
    assert!((0.98..1.04).contains(&share), "{share}");
    // 8 % of air on each side of a disc: pi / 4 / 1.16^2.
    let filled = silhouette_px(&picture) / (200.0 * 200.0);
    assert!((0.52..0.65).contains(&filled), "{filled}");
}

#[test]
fn two_pictures_stand_side_by_side_under_their_names() {
    let one = Picture::from_pixel(50, 60, image::Rgb([1, 2, 3]));
    let both = side_by_side(("avatar", one.clone()), ("truth", one));
    assert!(both.width() > 2 * 50 && both.height() > 60);
    assert_eq!(
        both.pixels().filter(|p| p.0 == [1, 2, 3]).count(),
        2 * 50 * 60
    );
}
