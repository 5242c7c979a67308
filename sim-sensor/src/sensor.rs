//! The simulated sensor: frames in order, as a real one would deliver them.

use std::sync::Arc;

use effigy_capture::{Calibration, CaptureError, DepthImage, Frame, FrameId, FrameSource};
use effigy_registration::BodyModel;

use crate::{
    error::SimError,
    noise,
    render::{ColorCamera, Renderer, View},
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
    color: Option<ColorCamera>,
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
        let color = scene.calibration.color.map(|camera| {
            let depth_from_color = scene.calibration.color_from_depth.inverse();
            let world_from_color = scene.world_from_camera * depth_from_color;
            let color = ColorCamera::new(&camera, world_from_color, scene.scenario.room);
            if scene.is_in_cloth() {
                color.two_sided()
            } else {
                color
            }
        });
        Ok(Self { scene, renderer, exposure, color, next: 0 })
    }

    /// What an ideal sensor would see in one frame: true depth, normals, labels, colour.
    pub fn view(&mut self, frame: FrameId) -> &View {
        draw(&mut self.renderer, &self.scene, Subject::Person(frame))
    }

    /// One frame by number, in any order. With simulated clothes a frame far ahead costs the frames between.
    pub fn expose(&mut self, id: FrameId) -> Result<Frame, CaptureError> {
        self.expose_subject(id, Subject::Person(id))
    }

    /// The same moment's frame with nobody in the room.
    pub fn expose_room(&mut self, id: FrameId) -> Result<Frame, CaptureError> {
        self.expose_subject(id, Subject::Nobody)
    }

    fn expose_subject(&mut self, id: FrameId, subject: Subject) -> Result<Frame, CaptureError> {
        let view = draw(&mut self.renderer, &self.scene, subject);
        let raw = match self.scene.scenario.noise {
            Noise::Sensor => self.exposure.expose(view, self.scene.scenario.seed, id),
            Noise::None => self.exposure.truth(view),
        };
        let (width, height) = (view.width as u32, view.height as u32);
        let color = match &mut self.color {
            Some(camera) => {
                let shaded = draw(camera.renderer(), &self.scene, subject).shaded();
                Some(Arc::new(camera.through_lens(&shaded)?))
            }
            None => None,
        };
        Ok(Frame {
            id,
            timestamp: self.scene.timestamp(id),
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

/// Who is in front of the camera.
#[derive(Clone, Copy)]
enum Subject {
    Person(FrameId),
    Nobody,
}

fn draw<'a>(renderer: &'a mut Renderer, scene: &Scene, subject: Subject) -> &'a View {
    let Subject::Person(frame) = subject else {
        return renderer.render_room();
    };
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
