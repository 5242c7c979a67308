//! Every kind of picture on one sheet: `cargo run --release -p effigy-viewer --example pictures -- sheet.png`.

mod scene;

use std::{
    f32::consts::{FRAC_PI_2, PI},
    path::PathBuf,
};

use effigy_viewer::{
    ViewerError,
    pictures::{
        Clay, ContactSheet, DepthRange, Framing, HeatScale, MeshView, OverlayStyle, PictureCamera,
        body_over_depth, clean_picture, heat_picture, raw_depth_picture, render_mesh,
    },
};
use scene::{CAMERA, Scene};

const TILE_PX: [u32; 2] = [300, 400];

fn main() -> Result<(), ViewerError> {
    let path = std::env::args()
        .nth(1)
        .map_or_else(|| PathBuf::from("pictures.png"), PathBuf::from);
    let scene = Scene::new();
    let moment = scene.at(25);
    let (clean, body, avatar) = (&moment.clean, &*moment.body, &*moment.avatar);
    let range = DepthRange::of(clean);
    let person = Framing::person(clean, TILE_PX);
    let whole = Framing::fitted([clean.depth.width, clean.depth.height], TILE_PX);
    let sensor = (&CAMERA, scene.world_from_camera);
    let view = |azimuth: f32| PictureCamera::around(&avatar.vertices, azimuth, 0.1, TILE_PX);
    let gaps = body
        .vertices
        .iter()
        .zip(&avatar.vertices)
        .map(|(a, b)| a.distance(*b));
    let gaps: Vec<f32> = gaps.collect();
    let scale = HeatScale { largest_m: 0.02 };
    ContactSheet::new(4)
        .title("Every kind of picture")
        .add(
            "raw depth",
            raw_depth_picture(&moment.frame.depth, 0.001, range, &whole),
        )
        .add("clean depth", clean_picture(clean, range, &person))
        .add(
            "body over depth",
            body_over_depth(clean, body.into(), sensor, &person, OverlayStyle::default()),
        )
        .add("body", render_mesh(body.into(), &view(0.0), Clay::body()))
        .add(
            "avatar, front",
            render_mesh(avatar.into(), &view(0.0), Clay::default()),
        )
        .add(
            "avatar, left side",
            render_mesh(avatar.into(), &view(FRAC_PI_2), Clay::default()),
        )
        .add(
            "avatar, back",
            render_mesh(avatar.into(), &view(PI), Clay::default()),
        )
        .add(
            "distance body to avatar, p95 12.5 mm",
            heat_picture(MeshView::from(avatar), &gaps, scale, &view(0.5)),
        )
        .save(&path)
}
