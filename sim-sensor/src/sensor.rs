//! The simulated sensor: frames in order, as a real one would deliver them.

use std::sync::Arc;

use effigy_capture::{
    Calibration, CaptureError, ColorImage, DepthImage, Frame, FrameId, FrameSource,
};
use effigy_registration::BodyModel;

use crate::{
    error::SimError,
    noise,
    render::{Renderer, View},
    scenario::{Noise, Scenario},
    scene::Scene,
};

#[cfg(test)]
mod tests;

/// A depth camera with a moving person in front of it.
pub struct SimulatedSensor {
    scene: Scene,
    renderer: Renderer,
    exposure: noise::Exposure,
    next: u64,
}

impl SimulatedSensor {
    pub fn new(scenario: &Scenario, body: Arc<BodyModel>) -> Result<Self, SimError> {
        let scene = Scene::new(scenario, body)?;
        let intrinsics = scene.calibration.depth.intrinsics;
        let mut renderer = Renderer::new(intrinsics, scene.world_from_camera, scene.scenario.room);
        if scene.is_in_cloth() {
            renderer = renderer.two_sided();
        }
        let exposure = noise::Exposure::new(&scene.calibration, scene.scenario.sensor.defects());
        Ok(Self { scene, renderer, exposure, next: 0 })
    }

    /// What an ideal sensor would see in one frame: true depth, normals, labels, colour.
    pub fn view(&mut self, frame: FrameId) -> &View {
        draw(&mut self.renderer, &self.scene, frame)
    }

    /// One frame by number, in any order. With simulated clothes a frame far ahead costs the frames between.
    pub fn expose(&mut self, id: FrameId) -> Result<Frame, CaptureError> {
        let view = draw(&mut self.renderer, &self.scene, id);
        Self::delivered(&self.scene, &mut self.exposure, view, id)
    }

    /// The same moment's frame with nobody in the room.
    pub fn expose_room(&mut self, id: FrameId) -> Result<Frame, CaptureError> {
        let view = self.renderer.render_room();
        Self::delivered(&self.scene, &mut self.exposure, view, id)
    }

    fn delivered(
        scene: &Scene,
        exposure: &mut noise::Exposure,
        view: &View,
        id: FrameId,
    ) -> Result<Frame, CaptureError> {
        let raw = match scene.scenario.noise {
            Noise::Sensor => exposure.expose(view, scene.scenario.seed, id),
            Noise::None => exposure.truth(view),
        };
        let (width, height) = (view.width as u32, view.height as u32);
        let color = if scene.scenario.color {
            Some(Arc::new(ColorImage::new(width, height, view.shaded())?))
        } else {
            None
        };
        Ok(Frame {
            id,
            timestamp: scene.timestamp(id),
            depth: Arc::new(DepthImage::new(width, height, raw)?),
            color,
        })
    }

    /// How long the movement takes before it repeats.
    pub fn motion_secs(&self) -> f32 {
        self.scene.motion_secs()
    }

    pub fn scenario(&self) -> &Scenario {
        &self.scene.scenario
    }
}

fn draw<'a>(renderer: &'a mut Renderer, scene: &Scene, frame: FrameId) -> &'a View {
    let person = &scene.person;
    if let Some(surface) = scene.in_cloth(frame) {
        return renderer.render(&surface.posed, &person.paint, &surface.weights);
    }
    let pose = scene.pose(frame);
    let mesh = person.clothed_posed(&pose.theta, pose.trans);
    renderer.render(&mesh, &person.paint, &person.body.skinning)
}

impl FrameSource for SimulatedSensor {
    fn name(&self) -> String {
        format!("simulated {}", self.scene.scenario.sensor.name())
    }

    fn calibration(&self) -> &Calibration {
        &self.scene.calibration
    }

    fn next_frame(&mut self) -> Result<Option<Frame>, CaptureError> {
        let slots = self.scene.scenario.frame_slots();
        while self.next < slots && self.scene.is_dropped(FrameId(self.next)) {
            self.next += 1;
        }
        if self.next >= slots {
            return Ok(None);
        }
        let id = FrameId(self.next);
        self.next += 1;
        self.expose(id).map(Some)
    }

    fn frame_count(&self) -> Option<u64> {
        let slots = self.scene.scenario.frame_slots();
        Some(
            (0..slots)
                .filter(|&f| !self.scene.is_dropped(FrameId(f)))
                .count() as u64,
        )
    }
}
