//! The simulated sensor: frames in order, as a real one would deliver them.

use std::sync::Arc;

use effigy_capture::{Calibration, CaptureError, DepthImage, Frame, FrameId, FrameSource};
use effigy_registration::BodyModel;

use crate::{
    error::SimError,
    noise,
    preset::SensorPreset,
    render::{ColorCamera, Renderer, View},
    scenario::{Noise, Scenario},
    scene::Scene,
    stranger::StrangerScene,
    truth::Truth,
};

#[cfg(test)]
mod tests;

/// A depth camera with a moving person in front of it.
pub struct SimulatedSensor {
    scenario: Scenario,
    calibration: Calibration,
    actor: Actor,
    renderer: Renderer,
    exposure: noise::Exposure,
    color: Option<ColorCamera>,
    next: u64,
}

impl SimulatedSensor {
    pub fn new(scenario: &Scenario, body: Arc<BodyModel>) -> Result<Self, SimError> {
        let scenario = scenario.clone().checked()?;
        let actor = if scenario.stranger.is_some() {
            Actor::Stranger(Box::new(StrangerScene::new(&scenario)?))
        } else {
            Actor::Person(Box::new(Scene::new(&scenario, body)?))
        };
        Ok(Self::before(actor, scenario))
    }

    /// Another sensor before the same person, at the scenario's mount or, without one, at its own, and at this one's rate.
    /// Clothes are simulated once for both while neither runs ahead. `None` before somebody else's character.
    pub fn beside(&self, sensor: SensorPreset) -> Option<Self> {
        let Actor::Person(scene) = &self.actor else {
            return None;
        };
        let rate_hz = Some(self.scenario.rate_hz());
        let scenario = Scenario { sensor, rate_hz, ..self.scenario.clone() };
        let scene = scene.seen_as(&scenario);
        Some(Self::before(Actor::Person(Box::new(scene)), scenario))
    }

    fn before(actor: Actor, scenario: Scenario) -> Self {
        let calibration = scenario.calibration();
        let world_from_camera = calibration.world_from_camera.unwrap_or_default();
        let room = scenario.room;
        let mut renderer = Renderer::new(calibration.depth.intrinsics, world_from_camera, room);
        let mut color = calibration.color.map(|camera| {
            let depth_from_color = calibration.color_from_depth.inverse();
            ColorCamera::new(&camera, world_from_camera * depth_from_color, room)
        });
        if actor.is_two_sided() {
            renderer = renderer.two_sided();
            color = color.map(ColorCamera::two_sided);
        }
        let exposure = noise::Exposure::new(&calibration, scenario.sensor.defects());
        Self { scenario, calibration, actor, renderer, exposure, color, next: 0 }
    }

    /// What an ideal sensor would see in one frame: true depth, normals, labels, colour.
    pub fn view(&mut self, frame: FrameId) -> &View {
        self.actor.draw(&mut self.renderer, Subject::Person(frame))
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
        let view = self.actor.draw(&mut self.renderer, subject);
        let raw = match self.scenario.noise {
            Noise::Sensor => self.exposure.expose(view, self.scenario.seed, id),
            Noise::None => self.exposure.truth(view),
        };
        let (width, height) = (view.width as u32, view.height as u32);
        let color = match &mut self.color {
            Some(camera) => {
                let shaded = self.actor.draw(camera.renderer(), subject).shaded();
                Some(Arc::new(camera.through_lens(&shaded)?))
            }
            None => None,
        };
        Ok(Frame {
            id,
            timestamp: self.scenario.timestamp(id),
            depth: Arc::new(DepthImage::new(width, height, raw)?),
            color,
        })
    }

    /// The truth about what this sensor sees: clothes are simulated once for both. `None` of somebody else's character.
    pub fn truth(&self) -> Option<Truth> {
        match &self.actor {
            Actor::Person(scene) => Some(Truth::of_scene(Scene::clone(scene))),
            Actor::Stranger(_) => None,
        }
    }

    /// How long the movement takes before it repeats.
    pub fn motion_secs(&self) -> f32 {
        self.actor.motion_secs()
    }

    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }
}

/// Who is in front of the camera.
#[derive(Clone, Copy)]
enum Subject {
    Person(FrameId),
    Nobody,
}

/// Who acts in front of the sensor.
enum Actor {
    Person(Box<Scene>),
    Stranger(Box<StrangerScene>),
}

impl Actor {
    /// Whether the surface is seen from both sides: cloth, hair and collars are sheets.
    fn is_two_sided(&self) -> bool {
        match self {
            Self::Person(scene) => scene.is_in_cloth(),
            Self::Stranger(_) => true,
        }
    }

    fn motion_secs(&self) -> f32 {
        match self {
            Self::Person(scene) => scene.motion_secs(),
            Self::Stranger(scene) => scene.motion_secs(),
        }
    }

    fn draw<'a>(&self, renderer: &'a mut Renderer, subject: Subject) -> &'a View {
        let Subject::Person(frame) = subject else {
            return renderer.render_room();
        };
        match self {
            Self::Person(scene) => draw_person(renderer, scene, frame),
            Self::Stranger(scene) => {
                let mesh = scene.surface(frame);
                renderer.render(&mesh, &scene.paint, &scene.character.weights)
            }
        }
    }
}

fn draw_person<'a>(renderer: &'a mut Renderer, scene: &Scene, frame: FrameId) -> &'a View {
    let person = &scene.person;
    if let Some((posed, weights)) = scene.posed_in_cloth(frame) {
        return renderer.render(&posed, &person.paint, &weights);
    }
    let pose = scene.pose(frame);
    let mesh = person.clothed_posed(&pose.theta, pose.trans);
    renderer.render(&mesh, &person.paint, &person.body.skinning)
}

impl FrameSource for SimulatedSensor {
    fn name(&self) -> String {
        format!("simulated {}", self.scenario.sensor.name())
    }

    fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    fn next_frame(&mut self) -> Result<Option<Frame>, CaptureError> {
        let slots = self.scenario.frame_slots();
        while self.next < slots && self.scenario.is_dropped(FrameId(self.next)) {
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
        let slots = self.scenario.frame_slots();
        Some(
            (0..slots)
                .filter(|&f| !self.scenario.is_dropped(FrameId(f)))
                .count() as u64,
        )
    }
}
