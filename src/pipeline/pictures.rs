//! A run's pictures: a first one at once, and at the end a sheet of what was seen, tracked and made.

use std::{path::Path, sync::Arc};

use effigy_avatar::{Avatar, DriveConfig, Driver};
use effigy_capture::Intrinsics;
use effigy_fusion::mesh::closest_point::ClosestPoint;
use effigy_registration::{BodyModel, RegisteredFrame};
use effigy_sim_sensor::Truth;
use effigy_viewer::pictures::{
    Clay, ContactSheet, DepthRange, Framing, HeatScale, MeshView, OverlayStyle, Picture,
    PictureCamera, body_over_depth, clean_picture, heat_picture, render_mesh,
};

/// One picture of a sheet.
const TILE_PX: [u32; 2] = [300, 420];

/// What the heat map's brightest colour stands for.
const HEAT: HeatScale = HeatScale { largest_m: 0.03 };

/// Draws what the sensor sees and, if there is one, the body found in it.
pub(crate) fn first_picture(
    registered: &RegisteredFrame,
    sensor: &Intrinsics,
    body: &BodyModel,
) -> Picture {
    let clean = &registered.clean;
    let framing = Framing::person(clean, TILE_PX);
    let mut sheet = ContactSheet::new(2).add(
        "depth",
        clean_picture(clean, DepthRange::of(clean), &framing),
    );
    if registered.params().is_some() {
        sheet = sheet.add("body", overlay(registered, sensor, body, &framing));
    }
    sheet.compose()
}

fn overlay(
    registered: &RegisteredFrame,
    sensor: &Intrinsics,
    body: &BodyModel,
    framing: &Framing,
) -> Picture {
    let Some(params) = registered.params() else {
        return Picture::new(framing.width, framing.height);
    };
    let posed = body.pose(params);
    body_over_depth(
        &registered.clean,
        MeshView::new(&posed.vertices, &body.triangles),
        (sensor, registered.world_from_camera),
        framing,
        OverlayStyle::default(),
    )
}

/// Rows of moments: depth, body over depth, avatar, and with a simulator the truth and the distance to it.
pub(crate) fn save_sheet(
    path: &Path,
    moments: &[RegisteredFrame],
    (sensor, body): (&Intrinsics, &BodyModel),
    avatar: Option<&Arc<Avatar>>,
    truth: Option<&Truth>,
) -> anyhow::Result<()> {
    let columns = 2 + usize::from(avatar.is_some()) * (1 + 2 * usize::from(truth.is_some()));
    let mut sheet = ContactSheet::new(columns);
    let mut driver = avatar.map(|avatar| Driver::new(Arc::clone(avatar), DriveConfig::default()));
    for moment in moments {
        let clean = &moment.clean;
        let framing = Framing::person(clean, TILE_PX);
        sheet = sheet
            .add(
                format!("{:.1} s: depth", clean.timestamp.as_secs_f64()),
                clean_picture(clean, DepthRange::of(clean), &framing),
            )
            .add("tracked body", overlay(moment, sensor, body, &framing));
        let (Some(driver), Some(params)) = (&mut driver, moment.params()) else {
            continue;
        };
        let posed = driver.pose(params, moment.id());
        let camera = PictureCamera::of_sensor(sensor, moment.world_from_camera, &framing);
        let view = MeshView {
            vertices: &posed.vertices,
            normals: &posed.normals,
            triangles: &posed.triangles,
            colors: &[],
        };
        sheet = sheet.add("avatar", render_mesh(view, &camera, Clay::default()));
        let Some(truth) = truth else { continue };
        let true_frame = truth.at(moment.id());
        let world_from_sim = moment.world_from_camera * true_frame.world_from_camera.inverse();
        let mut true_mesh = true_frame.clothed_in_world;
        true_mesh
            .vertices
            .iter_mut()
            .for_each(|vertex| *vertex = world_from_sim * *vertex);
        let true_view = MeshView::new(&true_mesh.vertices, &true_mesh.triangles);
        let to_truth: Vec<f32> = ClosestPoint::from_mesh(&true_mesh)?
            .query_all(&posed.vertices)
            .iter()
            .map(|hit| hit.distance)
            .collect();
        sheet = sheet
            .add("truth", render_mesh(true_view, &camera, Clay::default()))
            .add(
                "distance to truth",
                heat_picture(view, &to_truth, HEAT, &camera),
            );
    }
    if !sheet.is_empty() {
        sheet.save(path)?;
    }
    Ok(())
}
