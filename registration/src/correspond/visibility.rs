//! What of the body the camera can see, and how well a drawing of it agrees with the picture.

use effigy_fusion::mesh::z_buffer::{Faces, Rasterizer};
use glam::Vec3;

use crate::{
    observe::{Seen, View},
    surface::PosedSurface,
};

/// For each vertex whether the camera sees it: faces it, and nothing of the body is in front.
#[derive(Clone, Debug, Default)]
pub(crate) struct Visibility {
    visible: Vec<bool>,
}

/// How a drawn body compares with the picture, over the union of body and person.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Agreement {
    /// Mean over the union of the depth difference, cut at [`WORST_M`]; a cell that only one of them has counts as that.
    pub(crate) error_m: f32,
}

/// Draws bodies into one view.
#[derive(Debug)]
pub(crate) struct Renderer {
    rasterizer: Rasterizer,
    in_camera: Vec<Vec3>,
}

/// Worse than this is simply wrong.
const WORST_M: f32 = 0.10;
/// Whatever is measured less than this behind the body hides it, or is the very limb, cut off the mask by mistake.
const BEHIND_M: f32 = 0.10;
/// Vertices this far behind the drawn surface are hidden by it; coarse triangles cut corners by less.
const HIDDEN_M: f32 = 0.03;
/// Cosine between normal and ray below which a vertex is seen too obliquely to be matched.
const OBLIQUE: f32 = 0.08;

impl Visibility {
    pub(crate) fn is_visible(&self, vertex: u32) -> bool {
        self.visible[vertex as usize]
    }

    /// As if nothing hid anything.
    pub(crate) fn everything(body: &PosedSurface<'_>) -> Self {
        Self { visible: vec![true; body.vertices.len()] }
    }

    /// Only by facing the camera: cheap, for the coarse search.
    pub(crate) fn by_facing(body: &PosedSurface<'_>, camera_in_world: Vec3) -> Self {
        let visible = body
            .vertices
            .iter()
            .zip(&body.normals)
            .map(|(vertex, normal)| faces(*vertex, *normal, camera_in_world))
            .collect();
        Self { visible }
    }
}

impl Renderer {
    pub(crate) fn new(view: &View) -> Self {
        Self {
            rasterizer: Rasterizer::with_faces(view.pinhole, Faces::Front),
            in_camera: Vec::new(),
        }
    }

    /// Draws the body and finds its visible vertices.
    pub(crate) fn visibility(&mut self, body: &PosedSurface<'_>, view: &View) -> Visibility {
        self.draw(body, view);
        let raster = self.rasterizer.raster();
        let camera_in_world = view.camera_from_world.inverse().translation;
        let visible = self
            .in_camera
            .iter()
            .enumerate()
            .map(|(i, in_camera)| {
                faces(body.vertices[i], body.normals[i], camera_in_world)
                    && view.cell_of(*in_camera).is_none_or(|cell| {
                        let drawn_m = raster.depth[cell];
                        drawn_m == 0.0 || in_camera.z < drawn_m + HIDDEN_M
                    })
            })
            .collect();
        Visibility { visible }
    }

    /// Draws the body and holds it against the picture.
    pub(crate) fn agreement(&mut self, body: &PosedSurface<'_>, view: &View) -> Agreement {
        self.draw(body, view);
        let mut tally = Tally::default();
        let drawn = &self.rasterizer.raster().depth;
        for (i, (cell, &drawn_m)) in view.cells.iter().zip(drawn).enumerate() {
            let lost =
                cell.seen != Seen::Person && drawn_m > 0.0 && view.is_lost_in_floor(i, drawn_m);
            if !lost {
                tally.add(cell.seen, cell.depth_m, drawn_m);
            }
        }
        tally.agreement()
    }

    fn draw(&mut self, body: &PosedSurface<'_>, view: &View) {
        self.in_camera.clear();
        let to_camera = view.camera_from_world;
        let rotation = to_camera.rotation_matrix();
        self.in_camera.extend(
            body.vertices
                .iter()
                .map(|v| rotation * *v + to_camera.translation),
        );
        self.rasterizer
            .draw(&self.in_camera, &body.shaped.surface.triangles);
    }
}

fn faces(vertex: Vec3, normal: Vec3, camera_in_world: Vec3) -> bool {
    let to_camera = (camera_in_world - vertex).normalize_or_zero();
    normal.dot(to_camera) > OBLIQUE
}

#[derive(Default)]
struct Tally {
    union: u32,
    error_m: f64,
}

impl Tally {
    fn add(&mut self, seen: Seen, depth_m: f32, drawn_m: f32) {
        let (is_person, drawn) = (seen == Seen::Person, drawn_m > 0.0);
        let hidden = seen == Seen::Gap || (seen == Seen::Other && depth_m < drawn_m + BEHIND_M);
        if is_person && drawn {
            self.union += 1;
            self.error_m += f64::from((depth_m - drawn_m).abs().min(WORST_M));
        } else if is_person || (drawn && !hidden) {
            self.union += 1;
            self.error_m += f64::from(WORST_M);
        }
    }

    fn agreement(&self) -> Agreement {
        Agreement { error_m: (self.error_m / f64::from(self.union.max(1))) as f32 }
    }
}
