//! What one cloud teaches the three networks.

use effigy_registration::smpl::JOINT_COUNT;
use glam::{EulerRot, Quat, Vec3};
use rand::{RngExt as _, rngs::StdRng};
use rand_distr::{Distribution as _, Normal};

use super::{
    SkinningNetwork, SkinningNetworks, bare_cloud,
    features::{Described, Surroundings},
    loss::{
        Journey, SkinningLossConfig, Way, add, cross_entropy, difference, softmax, softmax_backward,
    },
    mixture::{Mixture, Named},
    net::Cloud,
    train::{CloudKind, TrainingCloud},
};
use crate::skinning::{BoneWeights, ClosestBodyPoint, SkinnedPoint, fold_extremities};

/// Deviation of a head's or camera's tilt, and the most of it in MetaAvatar's augmentation.
const TILT_RAD: f32 = 0.17;
const MOST_TILT_RAD: f32 = 0.35;

/// A cloud ready for the three networks.
pub(super) struct Lesson<'a> {
    pub(super) cloud: &'a TrainingCloud,
    person: &'a ClosestBodyPoint,
    /// True weights, toes and fingers folded.
    truth: Vec<BoneWeights>,
    pub(super) posed: Described,
    bare: Cloud,
}

/// Means over a cloud's points: the loss, and how far points are from where they should be.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    pub(super) loss: f64,
    pub(super) miss_m: f64,
}

/// Of the inverse, the forward and the label network.
pub(super) type Outcomes = [Outcome; 3];

impl<'a> Lesson<'a> {
    pub(super) fn new(
        cloud: &'a TrainingCloud,
        person: &'a ClosestBodyPoint,
        rng: &mut StdRng,
    ) -> Self {
        let posed = person.model.pose(&cloud.registered);
        let trees = person.posed_trees(&posed);
        let around = Surroundings::posed(person, &trees, &posed, &person.rest_joints());
        let turn = random_turn(rng);
        let turned: Vec<Vec3> = cloud.points.iter().map(|&point| turn * point).collect();
        let mut truth = cloud.weights.clone();
        truth.iter_mut().for_each(fold_extremities);
        Self {
            posed: around.describe(&cloud.points, &cloud.normals),
            bare: bare_cloud(&turned),
            cloud,
            person,
            truth,
        }
    }

    /// Adds the gradients of the three networks' parameters to `gradients`.
    pub(super) fn learn(
        &self,
        networks: &SkinningNetworks,
        config: &SkinningLossConfig,
        gradients: &mut [Vec<f32>; 3],
    ) -> Outcomes {
        let mut outcomes = [Outcome::default(); 3];
        let [by_inverse, by_forward, by_labels] = gradients;

        let inverse = Part { way: Way::Inverse, from: &self.cloud.points, to: &self.cloud.star };
        let input = Input {
            network: &networks.inverse,
            cloud: &self.posed.cloud,
            named: Some(&self.posed.named),
        };
        let (outcome, weights) = self.step(&input, &inverse, None, config, by_inverse);
        outcomes[0] = outcome;

        let (canonical, described) = self.canonical(&weights);
        let forward = Part { way: Way::Forward, from: &canonical, to: &self.cloud.truth_posed };
        let input = Input {
            network: &networks.forward,
            cloud: &described.cloud,
            named: Some(&described.named),
        };
        let agree = Some(weights.as_slice());
        outcomes[1] = self.step(&input, &forward, agree, config, by_forward).0;

        let input = Input { network: &networks.labels, cloud: &self.bare, named: None };
        outcomes[2] = self.step(&input, &inverse, None, config, by_labels).0;
        outcomes
    }

    /// How far points are from where they should be: by the inverse, forward and label network, and by the
    /// closest body point (inverse). Metres.
    pub(super) fn misses_m(&self, networks: &SkinningNetworks) -> [f64; 4] {
        let inverse = Part { way: Way::Inverse, from: &self.cloud.points, to: &self.cloud.star };
        let weights = networks.inverse.beside_body(&self.posed);
        let (canonical, described) = self.canonical(&weights);
        let forward = Part { way: Way::Forward, from: &canonical, to: &self.cloud.truth_posed };
        let of_labels = networks
            .labels
            .net
            .forward(&networks.labels.parameters, &self.bare);
        let of_labels: Vec<_> = of_labels.chunks_exact(JOINT_COUNT).map(softmax).collect();
        let closest: Vec<_> = self
            .posed
            .closest
            .iter()
            .map(|point| point.weights)
            .collect();
        [
            self.mean_miss_m(&inverse, &weights),
            self.mean_miss_m(&forward, &networks.forward.beside_body(&described)),
            self.mean_miss_m(&inverse, &of_labels),
            self.mean_miss_m(&inverse, &closest),
        ]
    }

    fn mean_miss_m(&self, part: &Part<'_>, weights: &[BoneWeights]) -> f64 {
        let misses = weights
            .iter()
            .enumerate()
            .map(|(index, weights)| f64::from(self.journey(part, index).miss_m(weights).0));
        misses.sum::<f64>() / weights.len().max(1) as f64
    }

    fn journey(&self, part: &Part<'_>, index: usize) -> Journey<'_> {
        Journey {
            warp: &self.cloud.warp,
            way: part.way,
            from: part.from[index],
            to: part.to[index],
        }
    }

    /// The canonical cloud that the forward network sees: single views as inverse skinning leaves them, full
    /// surfaces as they truly are.
    fn canonical(&self, weights: &[BoneWeights]) -> (Vec<Vec3>, Described) {
        let canonical: Vec<Vec3> = match self.cloud.kind {
            CloudKind::SingleView => weights
                .iter()
                .zip(&self.cloud.points)
                .map(|(weights, &point)| {
                    let canonical_from_posed = self.cloud.warp.canonical_from_posed(weights);
                    canonical_from_posed.transform_point3(point)
                })
                .collect(),
            CloudKind::Surface => self.cloud.star.clone(),
        };
        let around = Surroundings::star(self.person);
        let described = around.describe(&canonical, &self.cloud.star_normals);
        (canonical, described)
    }

    /// How much each point counts; together 1.
    fn says(&self, config: &SkinningLossConfig) -> Vec<f32> {
        /// Sum of absolute differences from which the closest body point's weights are wrong.
        const WRONG: f32 = 0.5;
        let say = |(closest, truth): (&SkinnedPoint, &BoneWeights)| {
            if difference(&closest.weights, truth).0 > WRONG {
                1.0 + config.doubtful
            } else {
                1.0
            }
        };
        let mut says: Vec<f32> = self
            .posed
            .closest
            .iter()
            .zip(&self.truth)
            .map(say)
            .collect();
        let sum: f32 = says.iter().sum();
        for say in &mut says {
            *say /= sum.max(1.0);
        }
        says
    }

    /// One network's loss, its answer, and its gradient added to `gradient`.
    fn step(
        &self,
        input: &Input<'_>,
        part: &Part<'_>,
        agree: Option<&[BoneWeights]>,
        config: &SkinningLossConfig,
        gradient: &mut [f32],
    ) -> (Outcome, Vec<BoneWeights>) {
        let Input { network: SkinningNetwork { net, parameters }, cloud, named } = *input;
        let (answers, cache) = net.forward_to_learn(parameters, cloud);
        let says = self.says(config);
        let mut outcome = Outcome::default();
        let mut bars = Vec::with_capacity(answers.len());
        let mut all = Vec::with_capacity(self.truth.len());
        for (index, answer) in answers.chunks_exact(net.config.outputs).enumerate() {
            let mixture = named.map(|named| Mixture::new(answer, &named[index]));
            let weights = mixture
                .as_ref()
                .map_or_else(|| softmax(answer), |mixture| mixture.weights);
            let truth = &self.truth[index];
            let (entropy, by_entropy) = cross_entropy(&weights, truth);
            let (off, by_off) = difference(&weights, truth);
            let (miss_m, by_miss) = self.journey(part, index).miss_m(&weights);
            let mut bar = [0.0; JOINT_COUNT];
            add(&mut bar, config.entropy, &by_entropy);
            add(&mut bar, config.weights, &by_off);
            add(&mut bar, config.place_a_metre, &by_miss);
            let mut loss =
                config.entropy * entropy + config.weights * off + config.place_a_metre * miss_m;
            if let Some(others) = agree {
                let (apart, by_apart) = difference(&weights, &others[index]);
                add(&mut bar, config.agreement, &by_apart);
                loss += config.agreement * apart;
            }
            let say = says[index];
            let bar = bar.map(|bar| say * bar);
            outcome.loss += f64::from(say * loss);
            outcome.miss_m += f64::from(say * miss_m);
            match &mixture {
                Some(mixture) => bars.extend(&mixture.backward(&bar)[..net.config.outputs]),
                None => bars.extend(softmax_backward(&weights, &bar)),
            }
            all.push(weights);
        }
        net.backward(parameters, cloud, &cache, &bars, gradient);
        (outcome, all)
    }
}

/// A network and what it sees.
struct Input<'a> {
    network: &'a SkinningNetwork,
    cloud: &'a Cloud,
    /// What the body says, if there is one.
    named: Option<&'a [Named]>,
}

/// What a network's weights move, and where to.
struct Part<'a> {
    way: Way,
    from: &'a [Vec3],
    to: &'a [Vec3],
}

/// Any heading, a little tilt.
fn random_turn(rng: &mut StdRng) -> Quat {
    let tilt = Normal::new(0.0, TILT_RAD).expect("a positive deviation");
    let mut tilt = || f32::clamp(tilt.sample(rng), -MOST_TILT_RAD, MOST_TILT_RAD);
    let (x, z) = (tilt(), tilt());
    let heading = rng.random_range(0.0..std::f32::consts::TAU);
    Quat::from_euler(EulerRot::XZY, x, z, heading)
}
