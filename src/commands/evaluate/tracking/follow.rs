//! One person from the first frame to the last: sensors, cleaning, tracking, and the truth beside them.

use std::sync::Arc;

use anyhow::Context as _;
use effigy_avatar::skinning::star_body;
use effigy_capture::{Frame, FrameId, Intrinsics, Timestamp};
use effigy_fusion::clean::Cleaner;
use effigy_registration::{BodyModel, BodyParams, RegisteredFrame, Smoother, Tracker};
use effigy_sim_sensor::{SimulatedSensor, StrangerTruth, Truth};

use super::{
    Options,
    cpu_time::timed,
    loss::{Moment, Vanishing, losses_of},
    score::{CaseScores, FrameScore, Judge, State},
    strangers::StrangerJudge,
    suite::{Case, Purpose},
};

/// Follows one person with every case's sensor, frame by frame, and scores all frames: clothes are simulated once for
/// all. `cases` differ in their sensors alone.
pub(super) fn follow(
    cases: &[&Case],
    body: &Arc<BodyModel>,
    options: &Options,
) -> anyhow::Result<Vec<CaseScores>> {
    let (first, others) = cases.split_first().context("nobody to follow")?;
    let mut sensors = vec![SimulatedSensor::new(&first.scenario, Arc::clone(body))?];
    for case in others {
        let beside = sensors[0].beside(case.scenario.sensor);
        sensors.push(beside.context("a stranger is watched by one sensor at a time")?);
    }
    let watches = cases.iter().zip(sensors);
    let mut watches = watches
        .map(|(case, sensor)| Watch::new(case, sensor, body, options))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let moments = moments(first);
    for (number, moment) in moments.iter().enumerate() {
        for watch in &mut watches {
            watch.look(number as u64, moment)?;
        }
    }
    let scores = watches.into_iter().map(|watch| watch.finish(&moments));
    Ok(scores.collect())
}

/// A sensor, the chain behind it, and how well that follows.
struct Watch<'a> {
    case: &'a Case,
    sensor: SimulatedSensor,
    body: &'a Arc<BodyModel>,
    options: &'a Options,
    reality: Reality<'a>,
    chain: Chain,
    smoother: Smoother,
    scores: CaseScores,
}

impl<'a> Watch<'a> {
    fn new(
        case: &'a Case,
        sensor: SimulatedSensor,
        body: &'a Arc<BodyModel>,
        options: &'a Options,
    ) -> anyhow::Result<Self> {
        let calibration = effigy_capture::FrameSource::calibration(&sensor).clone();
        let truth = sensor.truth();
        let reality = Reality::new(case, body, calibration.depth.intrinsics, truth)?;
        let depth = calibration.depth;
        let chain = Chain {
            cleaner: Cleaner::new(calibration, options.clean.clone()),
            // Where the camera stands is not told: the floor is found as on any other recording.
            tracker: Tracker::new(Arc::clone(body), depth, options.track.clone(), None),
        };
        Ok(Self {
            case,
            sensor,
            body,
            options,
            reality,
            chain,
            smoother: Smoother::new(options.smooth),
            scores: CaseScores::default(),
        })
    }

    fn look(&mut self, number: u64, moment: &Moment) -> anyhow::Result<()> {
        let frame = exposure(&mut self.sensor, self.case, number, moment)?;
        let (registered, milliseconds) = self.chain.process(&frame)?;
        let smooth = self.smoother.params(&registered);
        let content = FrameId(moment.content);
        let score = if moment.vanished.is_none() {
            let found = (&registered, smooth.as_ref());
            self.reality.score(found, content, milliseconds)
        } else {
            FrameScore::of_nobody(&registered, milliseconds)
        };
        self.scores.frames.push(score);
        if self.options.true_surface && registered.params().is_some() {
            let tracker = &mut self.chain.tracker;
            self.reality.tell_surface(content, tracker, self.body)?;
        }
        self.chain.recycle(registered);
        Ok(())
    }

    fn finish(self, moments: &[Moment]) -> CaseScores {
        let Self { mut scores, reality, chain, body, .. } = self;
        scores.losses = losses_of(moments, &scores.frames);
        scores.height_error_m = reality.height_error_m(body, chain.tracker.betas());
        reality.finish(&mut scores.frames);
        scores
    }
}

/// Whatever is true about the one who is followed.
enum Reality<'a> {
    Person { judge: Box<Judge<'a>>, truth: Box<Truth> },
    Stranger(Box<StrangerJudge<'a>>),
}

impl<'a> Reality<'a> {
    /// `person` is the truth about one of our own; others bring theirs along.
    fn new(
        case: &Case,
        body: &'a Arc<BodyModel>,
        camera: Intrinsics,
        person: Option<Truth>,
    ) -> anyhow::Result<Self> {
        let judge = Judge::new(body, camera);
        if let Some(truth) = person {
            return Ok(Self::Person { judge: Box::new(judge), truth: Box::new(truth) });
        }
        let truth = StrangerTruth::new(&case.scenario)?;
        Ok(Self::Stranger(Box::new(StrangerJudge::new(judge, truth))))
    }

    fn score(
        &mut self,
        (registered, smooth): (&RegisteredFrame, Option<&BodyParams>),
        content: FrameId,
        ms: f32,
    ) -> FrameScore {
        match self {
            Self::Person { judge, truth } => {
                judge.score(registered, smooth, &truth.at(content), ms)
            }
            Self::Stranger(judge) => judge.score(registered, content, ms),
        }
    }

    /// Tells a tracker how far each of its body's vertices is from the surface that a frame truly has.
    fn tell_surface(
        &self,
        content: FrameId,
        tracker: &mut Tracker,
        body: &BodyModel,
    ) -> anyhow::Result<()> {
        if let Self::Person { truth, .. } = self {
            let surface = truth.at(content).clothed_canonical;
            let skin = star_body(body, &tracker.betas());
            let offsets: Vec<_> = surface.iter().zip(&skin).map(|(a, b)| *a - *b).collect();
            tracker.set_surface(&offsets)?;
        }
        Ok(())
    }

    /// What can only be known after the last frame.
    fn finish(&self, frames: &mut [FrameScore]) {
        if let Self::Stranger(judge) = self {
            judge.remove_offsets(frames);
        }
    }

    fn height_error_m(&self, body: &BodyModel, betas: [f32; 10]) -> Option<f32> {
        match self {
            Self::Person { truth, .. } => {
                Some(height_m(body, betas) - height_m(body, truth.person().betas))
            }
            Self::Stranger(_) => None,
        }
    }
}

/// What is timed: from a raw frame to its body.
struct Chain {
    cleaner: Cleaner,
    tracker: Tracker,
}

impl Chain {
    fn process(&mut self, frame: &Frame) -> anyhow::Result<(RegisteredFrame, f32)> {
        let (registered, milliseconds) = timed(|| {
            let clean = self.cleaner.process(frame)?;
            anyhow::Ok(self.tracker.process(Arc::new(clean)))
        });
        Ok((registered?, milliseconds))
    }

    /// The frame's memory serves the next one.
    fn recycle(&mut self, registered: RegisteredFrame) {
        if let Ok(clean) = Arc::try_unwrap(registered.clean) {
            self.cleaner.recycle(clean);
        }
    }
}

/// What happens in each frame.
fn moments(case: &Case) -> Vec<Moment> {
    match case.purpose {
        Purpose::Accuracy | Purpose::Stillness => (0..case.scenario.frame_slots())
            .map(|content| Moment { content, vanished: None })
            .collect(),
        Purpose::Losses(count) => super::loss::schedule(&case.scenario, count),
    }
}

/// The frame a moment looks like, with a clock that runs on whatever the person does.
fn exposure(
    sensor: &mut SimulatedSensor,
    case: &Case,
    number: u64,
    moment: &Moment,
) -> anyhow::Result<Frame> {
    let content = FrameId(moment.content);
    let seen = match moment.vanished {
        Some(Vanishing::Left) => sensor.expose_room(content)?,
        _ => sensor.expose(content)?,
    };
    let seen = match moment.vanished {
        Some(vanishing) => vanishing.applied(&seen, &case.scenario)?,
        None => seen,
    };
    let secs = number as f64 / f64::from(case.scenario.rate_hz());
    Ok(Frame { id: FrameId(number), timestamp: Timestamp::from_secs_f64(secs), ..seen })
}

impl FrameScore {
    /// Anything but a track is right where nobody is.
    fn of_nobody(registered: &RegisteredFrame, milliseconds: f32) -> Self {
        Self {
            timestamp: registered.clean.timestamp,
            milliseconds,
            present: false,
            state: State::of(&registered.tracking),
            measured: [false; effigy_registration::smpl::JOINT_COUNT],
            observed: [false; effigy_registration::smpl::JOINT_COUNT],
            errors: None,
            smooth_errors: None,
        }
    }
}

/// From heel to crown, standing straight.
fn height_m(body: &BodyModel, betas: [f32; 10]) -> f32 {
    let vertices = body.shaped_vertices(&betas);
    let heights = || vertices.iter().map(|vertex| vertex.y);
    heights().fold(f32::MIN, f32::max) - heights().fold(f32::MAX, f32::min)
}
