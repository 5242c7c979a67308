//! Sizes, gradients, files and the training of the skinning networks.

use std::ops::ControlFlow;

use effigy_registration::{
    BodyModel, BodyParams,
    smpl::{JOINT_COUNT, builtin},
};
use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

use super::{
    NetworkConfig, SkinningNetwork, SkinningNetworks,
    learn::Lesson,
    loss::{SkinningLossConfig, softmax, softmax_backward},
    net::{Cloud, Net},
    planes::Planes,
    train::{
        CloudKind, CloudSource, SkinningProgress, SkinningTrainConfig, TrainingCloud,
        train_skinning,
    },
};
use crate::{
    nn::{ThreadsConfig, unet::UNetConfig},
    skinning::{ClosestBodyPoint, ClosestBodyPointConfig, Warp, dense, star_body},
};

const TINY: NetworkConfig = NetworkConfig {
    features: 2,
    hidden: 4,
    blocks: 2,
    side: 4,
    half_extent: 1.0,
    channels: 3,
    unet: UNetConfig { depth: 2, width: 3 },
    decoder: [6, 6, 4, 4, 4],
    groups: 2,
    outputs: JOINT_COUNT,
};

#[test]
fn the_papers_networks_have_the_papers_size() {
    assert_eq!(
        SkinningNetwork::count_parameters(NetworkConfig::PAPER),
        34_566_424
    );
}

#[test]
fn our_networks_cost_little_a_point() {
    let networks = SkinningNetworks::untrained(1);
    for network in [&networks.inverse, &networks.labels] {
        let a_point = network.multiply_adds(5000) / 5000;
        println!(
            "{} parameters, {a_point} multiply-adds a point",
            network.parameter_count()
        );
        assert!((50_000..300_000).contains(&a_point), "{a_point}");
    }
}

fn cloud(points: usize, features: usize, seed: u64) -> Cloud {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut random = || rng.random_range(-0.7_f32..0.7);
    Cloud {
        points: (0..points)
            .map(|_| Vec3::new(random(), random(), random()))
            .collect(),
        features: (0..points * features).map(|_| random()).collect(),
    }
}

#[test]
fn planes_have_the_gradients_of_finite_differences() {
    let planes = Planes { side: 4, half_extent: 1.0 };
    let cloud = cloud(30, 5, 1);
    let cells = planes.cells(&cloud.points);
    let images = cells.mean(&cloud.features, 5);
    // Linear maps: `<A x, y> = <x, A^T y>`, in single precision over some hundred numbers.
    let dot =
        |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum() };
    let sampled = planes.sample(&images, &cloud.points);
    let back = planes.sample_backward(&sampled, &cloud.points, 5);
    assert!((dot(&sampled, &sampled) - dot(&images.values, &back.values)).abs() < 1e-4);
    let back = cells.mean_backward(&images);
    assert!((dot(&images.values, &images.values) - dot(&cloud.features, &back)).abs() < 1e-4);
    let pooled = cells.pool(&cloud.features, 5);
    let twice = cells.pool(&pooled, 5);
    assert!((dot(&pooled, &pooled) - dot(&cloud.features, &twice)).abs() < 1e-3);
}

#[test]
fn the_whole_network_has_the_gradient_of_finite_differences() {
    const STEP: f32 = 3e-3;
    let net = Net::new(TINY);
    let mut rng = StdRng::seed_from_u64(3);
    let parameters: Vec<f32> = net
        .init(&mut rng)
        .iter()
        .map(|x| x + rng.random_range(-0.3_f32..0.3))
        .collect();
    let cloud = cloud(40, 2, 2);
    let (out, cache) = net.forward_to_learn(&parameters, &cloud);
    assert_eq!(out, net.forward(&parameters, &cloud));
    let weights: Vec<f32> = out
        .iter()
        .map(|_| rng.random_range(-1.0_f32..1.0))
        .collect();
    let mut gradient = vec![0.0; parameters.len()];
    net.backward(&parameters, &cloud, &cache, &weights, &mut gradient);
    let loss = |parameters: &[f32]| -> f64 {
        let out = net.forward(parameters, &cloud);
        out.iter()
            .zip(&weights)
            .map(|(y, w)| f64::from(y * w))
            .sum()
    };
    let (mut tried, mut wrong) = (0, 0);
    for place in &net.layout.places {
        let own = &gradient[place.offset..][..place.len()];
        let largest = own.iter().fold(1e-2_f32, |a, b| a.max(b.abs()));
        for index in [0, place.len() / 2, place.len() - 1] {
            let moved = |step: f32| {
                let mut parameters = parameters.clone();
                parameters[place.offset + index] += step;
                loss(&parameters)
            };
            let expected = (moved(STEP) - moved(-STEP)) / (2.0 * f64::from(STEP));
            tried += 1;
            let error = (expected as f32 - own[index]).abs();
            wrong += usize::from(error > 0.05 * largest);
        }
    }
    // A step may cross the corners of some of the many ReLUs and maxima.
    assert!(wrong * 10 <= tried, "{wrong} of {tried}");
}

#[test]
fn softmax_has_the_gradient_of_finite_differences() {
    let logits: Vec<f32> = (0..JOINT_COUNT).map(|k| (k as f32 * 0.7).sin()).collect();
    let bar = std::array::from_fn(|k| (k as f32 * 1.3).cos());
    let got = softmax_backward(&softmax(&logits), &bar);
    let loss = |logits: &[f32]| -> f64 {
        let shares = softmax(logits);
        shares
            .iter()
            .zip(&bar)
            .map(|(s, b): (&f32, &f32)| f64::from(s * b))
            .sum()
    };
    for bone in 0..JOINT_COUNT {
        let moved = |step: f32| {
            let mut logits = logits.clone();
            logits[bone] += step;
            loss(&logits)
        };
        let expected = (moved(1e-2) - moved(-1e-2)) / 2e-2;
        assert!((expected as f32 - got[bone]).abs() < 1e-4);
    }
}

/// A bare body in some poses.
struct Bodies;

fn body_cloud(model: &BodyModel, number: u64) -> TrainingCloud {
    let mut rng = StdRng::seed_from_u64(number);
    let mut params = BodyParams::ZERO;
    for joint in 1..JOINT_COUNT {
        params.theta[joint] =
            Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.2..0.2)));
    }
    let star = star_body(model, &params.betas);
    let rest_joints = model.joints(&model.shaped_vertices(&params.betas));
    let warp = Warp::new(&params, &rest_joints);
    let vertices: Vec<usize> = (0..200).map(|_| rng.random_range(0..star.len())).collect();
    let weights: Vec<_> = vertices
        .iter()
        .map(|&v| dense(&model.skinning[v]))
        .collect();
    let posed: Vec<Vec3> = vertices
        .iter()
        .zip(&weights)
        .map(|(&v, weights)| warp.posed_from_canonical(weights).transform_point3(star[v]))
        .collect();
    TrainingCloud {
        kind: if number.is_multiple_of(2) {
            CloudKind::SingleView
        } else {
            CloudKind::Surface
        },
        person: 0,
        points: posed.clone(),
        normals: vec![Vec3::ZERO; posed.len()],
        truth_posed: posed,
        star: vertices.iter().map(|&v| star[v]).collect(),
        star_normals: vec![Vec3::ZERO; vertices.len()],
        weights,
        registered: params,
        warp,
    }
}

impl CloudSource for Bodies {
    fn people(&self) -> Vec<[f32; 10]> {
        vec![[0.0; 10]]
    }

    fn training(&self, number: u64) -> TrainingCloud {
        body_cloud(&builtin::body(), number)
    }

    fn held_out(&self, number: u64) -> TrainingCloud {
        body_cloud(&builtin::body(), 1_000_000 + number)
    }
}

fn config(steps: u32, threads: usize) -> SkinningTrainConfig {
    SkinningTrainConfig {
        steps,
        look_every: 4,
        held_out_clouds: 2,
        threads: ThreadsConfig { count: threads },
        ..SkinningTrainConfig::default()
    }
}

#[test]
fn lessons_have_the_gradient_of_finite_differences() {
    const STEP: f32 = 1e-2;
    let model = builtin::body();
    let person =
        ClosestBodyPoint::new(model.clone(), &[0.0; 10], ClosestBodyPointConfig::default());
    let cloud = body_cloud(&model, 0);
    let lesson = Lesson::new(&cloud, &person, &mut StdRng::seed_from_u64(1));
    let networks = SkinningNetworks::untrained(1);
    let loss_config = SkinningLossConfig::default();
    let all = [&networks.inverse, &networks.forward, &networks.labels];
    let zeros = || all.map(|network| vec![0.0; network.parameter_count()]);
    let mut gradients = zeros();
    lesson.learn(&networks, &loss_config, &mut gradients);
    // The last layer's biases: all else follows from the network's own test.
    for bone in [0, 3, 16, 23] {
        for which in [0, 2] {
            let index = gradients[which].len() - all[which].config().outputs + bone;
            let loss = |step: f32| {
                let mut networks = networks.clone();
                let network = if which == 0 {
                    &mut networks.inverse
                } else {
                    &mut networks.labels
                };
                network.parameters[index] += step;
                lesson.learn(&networks, &loss_config, &mut zeros())[which].loss
            };
            let expected = (loss(STEP) - loss(-STEP)) / (2.0 * f64::from(STEP));
            let got = f64::from(gradients[which][index]);
            assert!(
                (expected - got).abs() < 2e-3 + 0.05 * got.abs(),
                "{expected} {got}"
            );
        }
    }
}

#[test]
fn training_gives_the_same_bits_interrupted_or_not_and_on_any_number_of_threads() {
    let model = builtin::body();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c");
    let mut go_on = |_: &SkinningProgress<'_>| ControlFlow::Continue(());
    let (whole, looks) = train_skinning(&model, &Bodies, &config(8, 1), None, &mut go_on)
        .unwrap()
        .unwrap();
    let config = SkinningTrainConfig { threads: ThreadsConfig { count: 1 }, ..config(8, 1) };
    let mut stop_at_three = |now: &SkinningProgress<'_>| {
        if now.step == 3 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let stopped =
        train_skinning(&model, &Bodies, &config, Some(&path), &mut stop_at_three).unwrap();
    assert!(stopped.is_none());
    let (resumed, resumed_looks) =
        train_skinning(&model, &Bodies, &config, Some(&path), &mut go_on)
            .unwrap()
            .unwrap();
    assert_eq!(resumed.inverse.parameters, whole.inverse.parameters);
    assert_eq!(resumed.forward.parameters, whole.forward.parameters);
    assert_eq!(resumed.labels.parameters, whole.labels.parameters);
    assert_eq!(resumed_looks, looks);
    let two = self::config(8, 2);
    let (two, _) = train_skinning(&model, &Bodies, &two, None, &mut go_on)
        .unwrap()
        .unwrap();
    assert_eq!(two.inverse.parameters, whole.inverse.parameters);
    let other = SkinningTrainConfig { rate: 1e-4, ..config };
    let error = train_skinning(&model, &Bodies, &other, Some(&path), &mut go_on)
        .err()
        .unwrap();
    assert!(
        error.to_string().contains("another configuration"),
        "{error}"
    );
}

#[test]
fn losses_that_are_not_finite_stop_the_training() {
    struct Broken;
    impl CloudSource for Broken {
        fn people(&self) -> Vec<[f32; 10]> {
            Bodies.people()
        }
        fn training(&self, number: u64) -> TrainingCloud {
            let mut cloud = Bodies.training(number);
            cloud.star[0].x = f32::NAN;
            cloud
        }
        fn held_out(&self, number: u64) -> TrainingCloud {
            Bodies.held_out(number)
        }
    }
    let mut go_on = |_: &SkinningProgress<'_>| ControlFlow::Continue(());
    let error = train_skinning(&builtin::body(), &Broken, &config(8, 1), None, &mut go_on);
    let error = error.err().unwrap().to_string();
    assert!(
        error.contains("not finite at step 0") && error.contains("lower rate"),
        "{error}"
    );
}

#[test]
fn networks_survive_their_file_and_broken_ones_are_refused() {
    let networks = SkinningNetworks::untrained(4);
    let bytes = networks.to_bytes().unwrap();
    let back = SkinningNetworks::from_bytes(&bytes).unwrap();
    let points = cloud(50, 0, 1).points;
    assert_eq!(back.labels.config(), networks.labels.config());
    assert_eq!(back.part_labels(&points).len(), 50);
    // Half precision keeps eleven bits of each weight.
    for (a, b) in back
        .inverse
        .parameters
        .iter()
        .zip(&networks.inverse.parameters)
    {
        assert!((a - b).abs() <= 1e-3 * b.abs() + 1e-6);
    }
    assert!(SkinningNetworks::from_bytes(&bytes[..bytes.len() / 2]).is_err());
    assert!(SkinningNetworks::from_bytes(b"nothing").is_err());
    let other = SkinningNetworks { labels: SkinningNetwork::untrained(TINY, 1), ..networks };
    let error = SkinningNetworks::from_bytes(&other.to_bytes().unwrap())
        .err()
        .unwrap();
    assert!(error.to_string().contains("train them again"), "{error}");
}

#[test]
fn networks_of_another_body_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("n.safetensors");
    let body = builtin::body().identity;
    let mut networks = SkinningNetworks::untrained(4);
    std::fs::write(&path, networks.to_bytes().unwrap()).unwrap();
    let error = SkinningNetworks::load(&path, body)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("trained with body none"), "{error}");
    networks.provenance.body = Some(body);
    std::fs::write(&path, networks.to_bytes().unwrap()).unwrap();
    assert!(SkinningNetworks::load(&path, body).is_ok());
}
