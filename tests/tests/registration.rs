//! Simulated people, through sensor noise and cleaning, are found and followed without truth.

use std::sync::Arc;

use effigy_avatar::skinning::star_body;
use effigy_capture::{Calibration, FrameId, FrameSource as _, Timestamp};
use effigy_fusion::{
    CleanFrame,
    clean::{CleanConfig, Cleaner, PersonVisibility},
};
use effigy_registration::{
    BodyModel, Refiner, RegisteredFrame, TrackConfig, Tracker, Tracking, motion::Routine,
    smpl::builtin,
};
use effigy_sim_sensor::{MotionChoice, OutfitKind, Scenario, SimulatedSensor, Truth};
use glam::Vec3;

/// A simulated person in front of the `azure` preset, cleaned.
struct Scene {
    body: Arc<BodyModel>,
    calibration: Calibration,
    truth: Truth,
    frames: Vec<Arc<CleanFrame>>,
}

impl Scene {
    /// Frames `ids` of a routine at 30 Hz.
    fn new(routine: Routine, outfit: OutfitKind, ids: impl Iterator<Item = u64>) -> Self {
        Self::of(3, routine, outfit, ids)
    }

    /// The same of another person.
    fn of(seed: u64, routine: Routine, outfit: OutfitKind, ids: impl Iterator<Item = u64>) -> Self {
        let scenario = Scenario {
            motion: MotionChoice::Routine(routine),
            outfit,
            seed,
            ..Scenario::default()
        };
        let body = builtin::body();
        let mut sensor =
            SimulatedSensor::new(&scenario, Arc::clone(&body)).expect("a valid scenario");
        let calibration = sensor.calibration().clone();
        let mut cleaner = Cleaner::new(calibration.clone(), CleanConfig::default());
        let frames = ids
            .map(|id| sensor.expose(FrameId(id)).expect("the simulator delivers"))
            .map(|frame| Arc::new(cleaner.process(&frame).expect("sizes agree")))
            .collect();
        let truth = Truth::new(&scenario, Arc::clone(&body)).expect("a valid scenario");
        Self { body, calibration, truth, frames }
    }

    fn tracker(&self) -> Tracker {
        let config = TrackConfig::default();
        Tracker::new(Arc::clone(&self.body), self.calibration.depth, config, None)
    }

    /// Mean distance of fitted from true vertices; `None` unless tracked.
    fn v2v_mm(&self, registered: &RegisteredFrame) -> Option<f32> {
        let fitted = self.body.pose(registered.params()?);
        let truth = self.truth.at(registered.id());
        let into_truth = truth.world_from_camera * registered.world_from_camera.inverse();
        let sum: f32 = fitted
            .vertices
            .iter()
            .zip(&truth.minimal.vertices)
            .map(|(a, b)| (into_truth * *a).distance(*b))
            .sum();
        Some(1e3 * sum / fitted.vertices.len() as f32)
    }

    /// Of a body in the zero pose.
    fn height_m(&self, betas: &[f32; 10]) -> f32 {
        let vertices = self.body.shaped_vertices(betas);
        let ys = vertices.iter().map(|v| v.y);
        ys.clone().fold(f32::MIN, f32::max) - ys.fold(f32::MAX, f32::min)
    }

    fn true_height_m(&self) -> f32 {
        self.height_m(&self.truth.person().betas)
    }

    /// Tracks all frames; the mean error, and the share of frames tracked.
    fn follow(&self) -> (f32, f32) {
        let mut tracker = self.tracker();
        let errors: Vec<f32> = self
            .frames
            .iter()
            .filter_map(|frame| self.v2v_mm(&tracker.process(Arc::clone(frame))))
            .collect();
        let mean_mm = errors.iter().sum::<f32>() / errors.len().max(1) as f32;
        (mean_mm, errors.len() as f32 / self.frames.len() as f32)
    }
}

/// Issue 2's bar for the fitted body, all vertices, clothed.
const V2V_BAR_MM: f32 = 60.0;

#[test]
fn a_turning_person_is_followed_all_the_way_around() {
    let scene = Scene::new(Routine::TurnAround, OutfitKind::Demo, 0..150);
    let (mean_mm, share) = scene.follow();
    assert_eq!(share, 1.0, "frames tracked");
    assert!(mean_mm < V2V_BAR_MM, "V2V {mean_mm} mm");
}

#[test]
fn a_walking_person_in_close_clothes_is_fitted_to_three_centimetres() {
    let scene = Scene::new(Routine::WalkInPlace, OutfitKind::CloseFitting, 0..45);
    let (mean_mm, share) = scene.follow();
    assert_eq!(share, 1.0, "frames tracked");
    // The next issue's bar for close clothes.
    assert!(mean_mm < 30.0, "V2V {mean_mm} mm");
}

#[test]
fn a_body_is_found_at_any_heading_from_its_first_frame() {
    let starts: Vec<u64> = (10..170).step_by(10).collect();
    let mut sum_mm = 0.0;
    for &start in &starts {
        let scene = Scene::new(Routine::TurnAround, OutfitKind::Demo, start..=start);
        let (error_mm, share) = scene.follow();
        assert_eq!(share, 1.0, "found at frame {start}");
        // A body that looks the wrong way is off by some 150 mm; one seen from the side may have an arm elsewhere.
        assert!(error_mm < 110.0, "V2V {error_mm} mm at frame {start}");
        sum_mm += error_mm;
    }
    let mean_mm = sum_mm / starts.len() as f32;
    assert!(mean_mm < 35.0, "V2V {mean_mm} mm on average");
}

#[test]
fn a_pose_is_nearer_once_it_is_known_what_is_worn() {
    let scene = Scene::new(Routine::WalkInPlace, OutfitKind::Demo, 0..45);
    let mut tracker = scene.tracker();
    let tracked: Vec<RegisteredFrame> = scene
        .frames
        .iter()
        .map(|frame| tracker.process(Arc::clone(frame)))
        .collect();
    let refiner = Refiner::new(
        Arc::clone(&scene.body),
        scene.calibration.depth,
        TrackConfig::default(),
    );
    let (mut before_mm, mut after_mm) = (0.0, 0.0);
    for frame in tracked.iter().skip(20).step_by(6) {
        let params = frame.params().expect("it is tracked");
        let worn = scene.truth.at(frame.id()).clothed_canonical;
        let skin = star_body(&scene.body, &params.betas);
        let offsets: Vec<Vec3> = worn.iter().zip(&skin).map(|(a, b)| *a - *b).collect();
        let refined = refiner
            .refine(frame, params, &offsets)
            .expect("one offset a vertex");
        before_mm += scene.v2v_mm(frame).expect("it is tracked");
        after_mm += scene.v2v_mm(&refined).expect("it is tracked still");
    }
    println!("sums of V2V: {before_mm} mm before, {after_mm} mm after");
    assert!(after_mm < 0.85 * before_mm, "{before_mm} {after_mm}");
}

#[test]
fn tracks_are_the_same_to_the_last_bit_when_repeated() {
    let scene = Scene::new(Routine::RaiseArms, OutfitKind::Demo, (0..30).map(|i| 2 * i));
    let tracks = || {
        let mut tracker = scene.tracker();
        let track = |frame: &Arc<CleanFrame>| tracker.process(Arc::clone(frame)).tracking;
        scene.frames.iter().map(track).collect::<Vec<Tracking>>()
    };
    assert_eq!(tracks(), tracks());
}

#[test]
fn a_person_who_leaves_is_lost_at_once_and_found_again() {
    let scene = Scene::new(Routine::Stand, OutfitKind::Demo, 0..12);
    let mut tracker = scene.tracker();
    for frame in &scene.frames[..4] {
        let found = tracker.process(Arc::clone(frame));
        assert!(matches!(found.tracking, Tracking::Tracked { .. }));
    }
    let empty = Arc::new(without_person(&scene.frames[4]));
    let gone = tracker.process(Arc::clone(&empty));
    assert_eq!(gone.tracking, Tracking::Lost { since: empty.timestamp });
    for frame in &scene.frames[5..] {
        let back = tracker.process(Arc::clone(frame));
        let error_mm = scene.v2v_mm(&back).expect("found again in the first frame");
        assert!(error_mm < V2V_BAR_MM, "V2V {error_mm} mm");
    }
}

#[test]
fn a_person_cut_at_the_waist_is_partial_and_not_fitted() {
    let scene = Scene::new(Routine::Stand, OutfitKind::Demo, 0..1);
    let mut cut = (*scene.frames[0]).clone();
    // Above the waist in the image: the camera is level, the hips are near its axis.
    let waist_row = cut.depth.height / 2 - 20;
    let width = cut.depth.width;
    for (pixel, person) in cut.person.iter_mut().enumerate() {
        *person &= pixel / width < waist_row;
    }
    cut.visibility = PersonVisibility::Partial;
    let mut tracker = scene.tracker();
    let registered = tracker.process(Arc::new(cut));
    assert!(
        matches!(registered.tracking, Tracking::Partial { .. }),
        "{:?}",
        registered.tracking
    );
}

#[test]
fn a_covered_sensor_is_noticed_within_a_third_of_a_second() {
    let scene = Scene::new(Routine::Stand, OutfitKind::Demo, 0..3);
    let mut tracker = scene.tracker();
    for frame in &scene.frames {
        tracker.process(Arc::clone(frame));
    }
    // A hand before the lens: one near, flat surface that even the segmentation takes for the person.
    let states: Vec<Tracking> = (1..=10)
        .map(|i| {
            let mut covered = (*scene.frames[2]).clone();
            covered.timestamp = Timestamp(covered.timestamp.0 + i * 33_333_333);
            let (width, height) = (covered.depth.width, covered.depth.height);
            for pixel in 0..width * height {
                let inside = pixel % width > width / 4 && pixel / width > height / 4;
                covered.person[pixel] = inside;
                let ray = scene.calibration.depth.intrinsics.unproject(
                    glam::vec2((pixel % width) as f32, (pixel / width) as f32),
                    0.6,
                );
                covered.depth.metres[pixel] = if inside { 0.6 } else { f32::NAN };
                covered.vertices.points[pixel] = if inside { ray } else { Vec3::NAN };
                covered.normals.normals[pixel] = if inside { -Vec3::Z } else { Vec3::NAN };
                covered.sigma_m[pixel] = 0.001;
            }
            tracker.process(Arc::new(covered)).tracking
        })
        .collect();
    assert!(
        !matches!(states.last(), Some(Tracking::Tracked { .. })),
        "still tracked after 0.33 s: {:?}",
        states.last()
    );
}

#[test]
fn the_estimated_height_is_right_to_three_centimetres() {
    let scene = Scene::new(Routine::TurnAround, OutfitKind::CloseFitting, 0..60);
    let mut tracker = scene.tracker();
    for frame in &scene.frames {
        tracker.process(Arc::clone(frame));
    }
    let error_m = scene.height_m(&tracker.betas()) - scene.true_height_m();
    // Shoes (16 mm) and hair (12 mm) look like height.
    assert!(error_m.abs() < 0.03, "off by {error_m} m");
}

#[test]
fn somebody_else_is_measured_anew() {
    let scene = |seed: u64, frames: u64| {
        Scene::of(
            seed,
            Routine::TurnAround,
            OutfitKind::CloseFitting,
            0..frames,
        )
    };
    let first = scene(3, 60);
    let mut tracker = first.tracker();
    for frame in &first.frames {
        tracker.process(Arc::clone(frame));
    }
    let apart_m = |other: &Scene| (other.true_height_m() - first.true_height_m()).abs();
    let seed = (4..40).find(|&seed| apart_m(&scene(seed, 0)) > 0.10);
    let other = scene(seed.expect("people differ"), 60);
    tracker.forget_person();
    assert_eq!(tracker.betas(), [0.0; 10]);
    for frame in &other.frames {
        tracker.process(Arc::clone(frame));
    }
    let error_m = other.height_m(&tracker.betas()) - other.true_height_m();
    assert!(error_m.abs() < 0.03, "off by {error_m} m");
}

/// The same frame after the person has gone.
fn without_person(frame: &CleanFrame) -> CleanFrame {
    let mut empty = frame.clone();
    empty.person.fill(false);
    empty.vertices.points.fill(Vec3::NAN);
    empty.normals.normals.fill(Vec3::NAN);
    empty.visibility = PersonVisibility::Nobody;
    empty
}
