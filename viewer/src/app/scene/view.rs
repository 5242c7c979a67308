//! The avatar's view as a widget.

use std::sync::Arc;

use eframe::{
    egui::{Image, Rect, Sense, TextureId, Ui, load::SizedTexture, pos2},
    egui_wgpu::RenderState,
    wgpu,
};

use super::{
    Orbit,
    renderer::{SceneRenderer, SceneStyle},
    targets::Targets,
};
use crate::{
    Snapshot,
    app::settings::{Layer, Settings},
    pictures::{MeshView, PictureCamera, palette},
    snapshot::{AvatarView, BodyView},
};

/// Nothing larger is asked of a software adapter, in pixels a side.
const SOFTWARE_LIMIT_PX: f32 = 720.0;

/// What stands on the floor.
#[derive(Clone)]
enum Figure {
    Nobody,
    Body(Arc<BodyView>),
    Avatar(Arc<AvatarView>),
}

pub(in crate::app) struct SceneView {
    state: RenderState,
    software: bool,
    renderer: SceneRenderer,
    orbit: Orbit,
    figure: Figure,
    targets: Option<(Targets, TextureId)>,
    drawn: Option<(PictureCamera, SceneStyle)>,
}

impl SceneView {
    pub(in crate::app) fn new(state: RenderState, software: bool) -> Self {
        let renderer = SceneRenderer::new(&state.device);
        Self {
            state,
            software,
            renderer,
            orbit: Orbit::default(),
            figure: Figure::Nobody,
            targets: None,
            drawn: None,
        }
    }

    /// Fills what room there is; the avatar if there is one, else the fitted body.
    pub(in crate::app) fn show(&mut self, ui: &mut Ui, snapshot: &Snapshot, settings: &Settings) {
        let (rectangle, response) =
            ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        self.orbit.follow_pointer(&response, settings.mirror);
        self.take_figure(snapshot, settings);
        let scale = self.pixels_per_point(ui, rectangle);
        let size = [rectangle.width(), rectangle.height()].map(|s| (s * scale).max(8.0) as u32);
        let camera = self.orbit.camera(size);
        let style = SceneStyle {
            albedo: self.albedo(),
            floor: settings.shows(Layer::Floor),
            shadow: if self.figure.is(&Figure::Nobody) {
                0.0
            } else {
                1.0
            },
            stand: self.orbit.person(),
        };
        let texture = self.draw(&camera, style);
        let [left, right] = if settings.mirror {
            [1.0, 0.0]
        } else {
            [0.0, 1.0]
        };
        Image::new(SizedTexture::new(texture, rectangle.size()))
            .uv(Rect { min: pos2(left, 0.0), max: pos2(right, 1.0) })
            .corner_radius(6)
            .paint_at(ui, rectangle);
    }

    /// Uploads the newest figure if it is not the one already there.
    fn take_figure(&mut self, snapshot: &Snapshot, settings: &Settings) {
        let body = || {
            snapshot
                .body
                .clone()
                .filter(|_| settings.shows(Layer::Body))
        };
        let newest = match (&snapshot.avatar, body()) {
            (Some(avatar), _) => Figure::Avatar(Arc::clone(avatar)),
            (None, Some(body)) => Figure::Body(body),
            (None, None) => Figure::Nobody,
        };
        if newest.is(&self.figure) {
            return;
        }
        let (device, queue) = (&self.state.device, &self.state.queue);
        let empty = Arc::default();
        let (mesh, triangles) = match &newest {
            Figure::Avatar(avatar) => (MeshView::from(&**avatar), &avatar.triangles),
            Figure::Body(body) => (MeshView::from(&**body), &body.triangles),
            Figure::Nobody => (MeshView::new(&[], &[]), &empty),
        };
        self.renderer.upload(device, queue, mesh, triangles);
        self.orbit.follow_person(mesh.vertices);
        self.drawn = None;
        self.figure = newest;
    }

    fn albedo(&self) -> [u8; 3] {
        match self.figure {
            Figure::Avatar(_) => palette::CLAY,
            Figure::Body(_) | Figure::Nobody => palette::BODY,
        }
    }

    fn pixels_per_point(&self, ui: &Ui, rectangle: Rect) -> f32 {
        let native = ui.ctx().pixels_per_point();
        if self.software {
            native.min(SOFTWARE_LIMIT_PX / rectangle.width().max(rectangle.height()).max(1.0))
        } else {
            native
        }
    }

    /// The texture with this view in it; drawn only if it is not there yet.
    fn draw(&mut self, camera: &PictureCamera, style: SceneStyle) -> TextureId {
        let size = [camera.intrinsics.width, camera.intrinsics.height];
        let (device, queue) = (&self.state.device, &self.state.queue);
        let targets = match self.targets.take() {
            Some(kept) if kept.0.size == size => kept,
            old => {
                self.drawn = None;
                let targets = Targets::new(device, size);
                let id = self.register(&targets, old.map(|(_, id)| id));
                (targets, id)
            }
        };
        if self.drawn != Some((*camera, style)) {
            self.renderer
                .draw(device, queue, &targets.0, (camera, style));
            self.drawn = Some((*camera, style));
        }
        self.targets.insert(targets).1
    }

    fn register(&self, targets: &Targets, id: Option<TextureId>) -> TextureId {
        let mut renderer = self.state.renderer.write();
        let (device, view) = (&self.state.device, &targets.color_view);
        let filter = wgpu::FilterMode::Linear;
        if let Some(id) = id {
            renderer.update_egui_texture_from_wgpu_texture(device, view, filter, id);
            return id;
        }
        renderer.register_native_texture(device, view, filter)
    }
}

impl Figure {
    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Nobody, Self::Nobody) => true,
            (Self::Body(a), Self::Body(b)) => Arc::ptr_eq(a, b),
            (Self::Avatar(a), Self::Avatar(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}
