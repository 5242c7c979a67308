//! The avatar's geometry against simulated, clothed, noisy people: what is lost before any learning.

use std::{ops::ControlFlow, sync::Arc};

use effigy_avatar::{
    Avatar, AvatarMesh, CanonicaliseConfig, Canonicaliser, DriveConfig, Driver, KeyframeConfig,
    KeyframeSelector, PoseField, PoseInput, SignedDistanceField, TopologyConfig,
    export::write_ply,
    fine_tune::{FineTuneConfig, fine_tune},
    hyper,
    metrics::{measured_vertices, observed_mm, p2s_mm, surface_metrics},
};
use effigy_capture::{FrameId, FrameSource as _};
use effigy_fusion::{
    CleanConfig, CleanFrame, Cleaner, TriangleMesh, mesh::closest_point::ClosestPoint,
};
use effigy_registration::{BodyModel, RegisteredFrame, Tracking, smpl::builtin};
use effigy_sim_sensor::{GroundTruth, Scenario, SimulatedSensor, Truth};
use glam::Vec3;

/// Frames of the mixed motion to look at.
const FRAMES: [u64; 4] = [40, 150, 270, 400];

/// Simulated frames, cleaned, with true tracking.
fn simulated(frames: &[u64]) -> Vec<(RegisteredFrame, GroundTruth)> {
    let body = builtin::body();
    let scenario = Scenario::default();
    let truth = Truth::new(&scenario, Arc::clone(&body)).expect("the default scenario is valid");
    let mut sensor = SimulatedSensor::new(&scenario, body).expect("the default scenario is valid");
    let mut cleaner = Cleaner::new(sensor.calibration().clone(), CleanConfig::default());
    frames
        .iter()
        .map(|&id| {
            let frame = sensor
                .expose(FrameId(id))
                .expect("a simulated frame has its size");
            let clean: CleanFrame = cleaner
                .process(&frame)
                .expect("the frame has the calibrated size");
            let truth = truth.at(FrameId(id));
            let tracking = Tracking::Tracked {
                params: truth.params,
                residual_rms_m: 0.01,
                joint_confidence: [1.0; 24],
            };
            let world_from_camera = truth.world_from_camera;
            (
                RegisteredFrame { clean: Arc::new(clean), world_from_camera, tracking },
                truth,
            )
        })
        .collect()
}

fn canonicaliser(body: &Arc<BodyModel>, truth: &GroundTruth) -> Canonicaliser {
    let calibration = Scenario::default().sensor.calibration();
    Canonicaliser::new(
        Arc::clone(body),
        &truth.params.betas,
        CanonicaliseConfig::default(),
    )
    .expect("the built-in body has vertices")
    .with_camera(&calibration.depth)
}

fn observed_in_world(frame: &RegisteredFrame) -> Vec<Vec3> {
    let points = &frame.clean.vertices.points;
    (0..points.len())
        .filter(|&pixel| frame.clean.person[pixel] && points[pixel].is_finite())
        .map(|pixel| frame.world_from_camera * points[pixel])
        .collect()
}

/// The true clothed surface of one pose as a field.
struct Oracle {
    surface: Arc<ClosestPoint>,
}

impl SignedDistanceField for Oracle {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        out.copy_from_slice(&self.surface.signed_distance_all(points));
    }

    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]) {
        for (index, (point, hit)) in points
            .iter()
            .zip(self.surface.query_all(points))
            .enumerate()
        {
            values[index] = self.surface.sign(*point, &hit);
            gradients[index] = (values[index] * (*point - hit.point)).normalize_or_zero();
        }
    }
}

impl PoseField for Oracle {
    fn field(&self, _: &PoseInput) -> Box<dyn SignedDistanceField> {
        Box::new(Self { surface: Arc::clone(&self.surface) })
    }

    fn kind(&self) -> &'static str {
        "oracle"
    }

    fn to_bytes(&self) -> Vec<u8> {
        Vec::new()
    }
}

#[test]
fn clothed_points_come_back_to_the_clothed_canonical_surface() {
    let body = builtin::body();
    for (frame, truth) in simulated(&FRAMES) {
        let canonicaliser = canonicaliser(&body, &truth);
        let (samples, counts) = canonicaliser.process(&frame).unwrap();
        let unit_box = canonicaliser.subject().unit_box;
        let canonical = TriangleMesh::new(truth.clothed_canonical.clone(), body.triangles.clone());
        let in_canonical = |points: &[Vec3]| -> Vec<Vec3> {
            points
                .iter()
                .map(|&point| unit_box.canonical_from_unit(point))
                .collect()
        };
        let floor_mm = observed_mm(&observed_in_world(&frame), &truth.clothed_in_world).unwrap();
        let off_mm = observed_mm(&in_canonical(&samples.points_in_unit), &canonical).unwrap();
        let closest = ClosestPoint::from_mesh(&canonical).unwrap();
        let free = closest.signed_distance_all(&in_canonical(&samples.free_in_unit));
        let carving = free.iter().filter(|&&distance| distance < -0.005).count();
        println!(
            "frame {}: {counts:?}, {off_mm:.2} mm off, sensor {floor_mm:.2} mm, {carving} of {} \
             free points inside",
            frame.id().0,
            free.len()
        );
        // Skinning by the nearest body point instead of by the true correspondence adds little.
        assert!(off_mm < floor_mm + 0.5);
        assert!(counts.kept > 4500);
        assert!(carving * 50 <= free.len());
    }
}

/// With a perfect field, what is left is skinning and meshing: the floor of every learned avatar.
#[test]
fn driving_a_perfect_field_gives_the_clothed_person_back() {
    let body = builtin::body();
    let measured = measured_vertices(&body.skinning, &body.triangles);
    for (frame, truth) in simulated(&FRAMES[..2]) {
        let canonicaliser = canonicaliser(&body, &truth);
        let subject = canonicaliser.subject();
        let in_unit: Vec<Vec3> = truth
            .clothed_canonical
            .iter()
            .map(|&vertex| subject.unit_box.unit_from_canonical(vertex))
            .collect();
        let surface = Arc::new(ClosestPoint::new(&in_unit, &body.triangles).unwrap());
        let avatar = Avatar::new(
            subject,
            Arc::new(Oracle { surface }),
            &**canonicaliser.skinning(),
            &truth.params.theta,
            &TopologyConfig::default(),
        )
        .unwrap();
        let mut driver = Driver::new(Arc::new(avatar), DriveConfig::default());
        let driven: AvatarMesh = driver.pose(&truth.params, frame.id());
        let bare = TriangleMesh::new(truth.minimal.vertices.clone(), body.triangles.clone());
        let [of_avatar, of_bare] = [driven.to_mesh(), bare].map(|mesh| {
            let metrics = surface_metrics(&truth.clothed_in_world, &measured, &mesh)
                .unwrap()
                .unwrap();
            let p2s = p2s_mm(&truth.clothed_in_world, &mesh).unwrap();
            println!("frame {}: {metrics:?}, p2s {p2s:.2} mm", frame.id().0);
            metrics
        });
        // A mesh of 7,500 vertices cuts the folds' corners by a millimetre.
        assert!(of_avatar.d_f_cm < 0.2);
        assert!(of_avatar.d_f_cm < 0.2 * of_bare.d_f_cm);
        assert!(of_avatar.nc > of_bare.nc);
    }
}

/// The whole chain behind tracking, with true poses: keyframes, canonical samples, a short fine-tuning, and
/// poses the avatar has not seen.
#[test]
fn a_fine_tuned_avatar_is_nearer_to_the_person_than_the_bare_body() {
    let body = builtin::body();
    let seen: Vec<u64> = (20..380).step_by(12).collect();
    let mut selector = KeyframeSelector::new(KeyframeConfig::default());
    let frames = simulated(&seen);
    for (frame, _) in &frames {
        selector.consider(frame);
    }
    assert!(
        selector.is_full(),
        "{} keyframes",
        selector.keyframes().len()
    );
    let canonicaliser = canonicaliser(&body, &frames[0].1);
    let subject = canonicaliser.subject();
    let samples: Vec<_> = selector
        .keyframes()
        .iter()
        .map(|keyframe| canonicaliser.process(&keyframe.frame).unwrap().0)
        .collect();
    let config = FineTuneConfig { steps: 120, ..FineTuneConfig::default() };
    let network = fine_tune(
        hyper::prior(),
        &samples,
        subject.unit_box.metres_per_unit(),
        &config,
        &|| 0.0,
        &mut |progress, _| {
            if progress.step % 40 == 0 {
                println!(
                    "{}: {:.2} mm",
                    progress.step,
                    progress.held_out_residual_m * 1e3
                );
            }
            ControlFlow::Continue(())
        },
    )
    .unwrap();
    let avatar = Avatar::new(
        subject,
        Arc::new(network),
        &**canonicaliser.skinning(),
        &selector.keyframes()[0].params.theta,
        &TopologyConfig::default(),
    )
    .unwrap();
    let mut driver = Driver::new(Arc::new(avatar), DriveConfig::default());
    let measured = measured_vertices(&body.skinning, &body.triangles);
    for (frame, truth) in simulated(&[430, 520]) {
        let driven = driver.pose(&truth.params, frame.id());
        // `EFFIGY_PLY=folder` keeps the meshes, to look at.
        if let Ok(folder) = std::env::var("EFFIGY_PLY") {
            let path = std::path::Path::new(&folder).join(format!("tuned{}.ply", frame.id().0));
            write_ply(&path, &driven, effigy_capture::Rigid3::IDENTITY).unwrap();
        }
        let bare = TriangleMesh::new(truth.minimal.vertices.clone(), body.triangles.clone());
        let [of_avatar, of_bare] = [driven.to_mesh(), bare].map(|mesh| {
            let observed = observed_mm(&observed_in_world(&frame), &mesh).unwrap();
            let metrics = surface_metrics(&truth.clothed_in_world, &measured, &mesh);
            let metrics = metrics.unwrap().unwrap();
            println!(
                "frame {}: {metrics:?}, observed {observed:.2} mm",
                frame.id().0
            );
            (metrics, observed)
        });
        assert!(of_avatar.0.d_f_cm < 0.7 * of_bare.0.d_f_cm);
        assert!(of_avatar.1 < 0.6 * of_bare.1);
    }
}
