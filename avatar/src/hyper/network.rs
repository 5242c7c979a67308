//! The whole hypernetwork: encoder, one head a layer, and the meta-learned field they start from.

use effigy_registration::smpl::BodyIdentity;
use rand::{Rng, SeedableRng as _, rngs::StdRng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    blob::Precision,
    config::HyperConfig,
    heads::{Head, HeadCache, HeadGradient},
    pose_encoder::{
        CODE_SIZE, EncoderCache, EncoderGradient, EncoderKind, FEATURE_SIZE, PoseEncoder,
    },
};
use crate::{PoseField, PoseInput, SignedDistanceField, nn::linear::Linear, sdf::SirenField};

/// Turns a pose into a [`SirenField`].
#[derive(Clone, Debug, PartialEq)]
pub struct HyperNetwork {
    pub(crate) config: HyperConfig,
    /// phi*: the field before any residual.
    pub(crate) meta: Vec<f32>,
    pub(crate) encoder: PoseEncoder,
    /// Who it is: what the heads see beside the pose.
    pub(crate) person: Vec<f32>,
    /// One a layer of the field.
    pub(crate) heads: Vec<Head>,
    pub provenance: Provenance,
}

/// Where a network's parameters come from; travels with its file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Provenance {
    /// The body that canonical space belongs to; none if it was trained without one.
    pub body: Option<BodyIdentity>,
    /// Commands, seeds and steps, in words.
    pub training: String,
    /// True for parameters that stand in until the real training has run.
    pub is_placeholder: bool,
}

/// What the backward pass of a batch of poses needs.
pub(crate) struct HyperCache {
    encoder: EncoderCache,
    /// What the heads see; [poses, inputs]
    inputs: Vec<f32>,
    heads: Vec<HeadCache>,
}

/// Gradients of every trainable parameter.
pub(crate) struct HyperGradient {
    pub(crate) encoder: EncoderGradient,
    /// By each pose's person; [poses, person]
    pub(crate) person: Vec<f32>,
    pub(crate) heads: Vec<HeadGradient>,
}

impl HyperGradient {
    /// The gradient by each pose's code: by its coefficients, then by its person.
    pub(crate) fn code_bars(&self) -> Vec<Vec<f32>> {
        let poses = self.encoder.global.output_bar.len() / FEATURE_SIZE;
        let mut bars = vec![Vec::new(); poses];
        for gradient in self
            .heads
            .iter()
            .filter_map(|head| head.coefficients.as_ref())
        {
            let width = gradient.output_bar.len() / poses;
            for (bar, row) in bars.iter_mut().zip(gradient.output_bar.chunks_exact(width)) {
                bar.extend(row);
            }
        }
        let width = self.person.len() / poses;
        if width > 0 {
            for (bar, row) in bars.iter_mut().zip(self.person.chunks_exact(width)) {
                bar.extend(row);
            }
        }
        bars
    }
}

/// A named tensor of the network.
pub(crate) struct Tensor<V> {
    pub(crate) name: String,
    pub(crate) shape: Vec<usize>,
    pub(crate) values: V,
}

impl HyperNetwork {
    /// The word that avatar files use for it.
    pub const KIND: &str = "hypernetwork";

    /// A network whose field is exactly `meta` for every pose.
    ///
    /// # Panics
    /// If `meta` is not of the configured shape.
    pub fn init(config: HyperConfig, meta: &SirenField, rng: &mut impl Rng) -> Self {
        assert_eq!(meta.config(), config.field, "the field's shape");
        let mut heads = Vec::with_capacity(config.field.layers);
        let encoder = PoseEncoder::init(rng);
        for layer in 0..config.field.layers {
            heads.push(Head::init(
                &config,
                config.field.layer_parameters(layer),
                rng,
            ));
        }
        let meta = meta.parameters().to_vec();
        Self {
            person: vec![0.0; config.person],
            config,
            meta,
            encoder,
            heads,
            provenance: Provenance::default(),
        }
    }

    /// As it is before any learning.
    pub fn untrained(config: HyperConfig, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let meta = SirenField::init(config.field, &mut rng);
        Self::init(config, &meta, &mut rng)
    }

    /// The same `phi*`, with an encoder and heads that know nothing.
    pub fn with_fresh_heads(&self, seed: u64) -> Self {
        Self::init(
            self.config,
            &self.meta_field(),
            &mut StdRng::seed_from_u64(seed),
        )
    }

    /// Told the pose as bare quaternions instead of learned features: an ablation, which files cannot hold.
    pub fn with_quaternions(mut self) -> Self {
        self.encoder.kind = EncoderKind::Quaternions;
        self
    }

    pub fn config(&self) -> HyperConfig {
        self.config
    }

    /// phi*, the field before any residual.
    pub fn meta_field(&self) -> SirenField {
        SirenField::new(self.config.field, self.meta.clone())
    }

    /// The field of one pose.
    pub fn field(&self, pose: &PoseInput) -> SirenField {
        let (_, mut parameters) = self.forward(std::slice::from_ref(pose));
        SirenField::new(self.config.field, parameters.swap_remove(0))
    }

    /// The low-rank coefficients of one pose, layer by layer; empty for full heads. The field's parameters
    /// are linear in them.
    pub fn coefficients(&self, pose: &PoseInput) -> Vec<f32> {
        let code = self.encoder.forward(std::slice::from_ref(pose)).code;
        let inputs = self.head_inputs(&code, &[]);
        self.heads
            .iter()
            .filter_map(|head| head.coefficients(&inputs))
            .flatten()
            .collect()
    }

    /// The output layers' inputs for some poses, head by head: what learning rates are derived from.
    pub(crate) fn output_inputs(&self, poses: &[PoseInput]) -> Vec<Vec<f32>> {
        let (cache, _) = self.forward(poses);
        cache
            .heads
            .into_iter()
            .map(|head| head.basis_input)
            .collect()
    }

    /// The field's parameters for each pose.
    pub(crate) fn forward(&self, poses: &[PoseInput]) -> (HyperCache, Vec<Vec<f32>>) {
        self.forward_with_codes(poses, &[])
    }

    /// [`Self::forward`] with a code for each pose added to its coefficients and its person, or none at all.
    pub(crate) fn forward_with_codes(
        &self,
        poses: &[PoseInput],
        codes: &[&[f32]],
    ) -> (HyperCache, Vec<Vec<f32>>) {
        let encoder = self.encoder.forward(poses);
        let inputs = self.head_inputs(&encoder.code, codes);
        let heads: Vec<_> = self
            .heads
            .par_iter()
            .enumerate()
            .map(|(layer, head)| {
                let range = self.code_range(layer);
                let codes: Vec<&[f32]> = codes.iter().map(|code| &code[range.clone()]).collect();
                head.forward(&inputs, &codes)
            })
            .collect();
        let mut parameters = vec![self.meta.clone(); poses.len()];
        for (layer, (_, residual)) in heads.iter().enumerate() {
            let range = self.config.field.layer_range(layer);
            for (row, parameters) in residual.chunks_exact(range.len()).zip(&mut parameters) {
                for (value, residual) in parameters[range.clone()].iter_mut().zip(row) {
                    *value += residual;
                }
            }
        }
        let heads = heads.into_iter().map(|(cache, _)| cache).collect();
        (HyperCache { encoder, inputs, heads }, parameters)
    }

    /// Gradients from those of each pose's field parameters.
    pub(crate) fn backward(&self, cache: HyperCache, parameter_bars: &[&[f32]]) -> HyperGradient {
        let HyperCache { encoder, inputs, heads } = cache;
        let layers: Vec<_> = self.heads.iter().zip(heads).enumerate().collect();
        let (gradients, input_bars): (Vec<_>, Vec<_>) = layers
            .into_par_iter()
            .map(|(layer, (head, cache))| {
                let range = self.config.field.layer_range(layer);
                let residual_bar: Vec<f32> = parameter_bars
                    .iter()
                    .flat_map(|bar| &bar[range.clone()])
                    .copied()
                    .collect();
                head.backward(&inputs, cache, residual_bar)
            })
            .unzip();
        let mut input_bar = vec![0.0; inputs.len()];
        for part in &input_bars {
            for (sum, bar) in input_bar.iter_mut().zip(part) {
                *sum += bar;
            }
        }
        let (mut code_bar, mut person_bar) = (Vec::new(), Vec::new());
        for row in input_bar.chunks_exact(self.config.head_inputs()) {
            let (code, person) = row.split_at(CODE_SIZE);
            code_bar.extend(code);
            person_bar.extend(person);
        }
        HyperGradient {
            encoder: self.encoder.backward(encoder, code_bar),
            person: person_bar,
            heads: gradients,
        }
    }

    /// Each pose's code, and who it is: the network's own person, moved by that part of the pose's code.
    fn head_inputs(&self, pose_codes: &[f32], codes: &[&[f32]]) -> Vec<f32> {
        let mut inputs = Vec::new();
        for (row, pose_code) in pose_codes.chunks_exact(CODE_SIZE).enumerate() {
            inputs.extend(pose_code);
            let start = inputs.len();
            inputs.extend(&self.person);
            if let Some(code) = codes.get(row) {
                let moved = inputs[start..]
                    .iter_mut()
                    .zip(&code[self.coefficient_count()..]);
                moved.for_each(|(x, offset)| *x += offset);
            }
        }
        inputs
    }

    /// Numbers of a code: the coefficients of all heads, none for full heads, then the person.
    pub(crate) fn code_size(&self) -> usize {
        self.coefficient_count() + self.config.person
    }

    /// Of all heads together; zero for full heads.
    pub(crate) fn coefficient_count(&self) -> usize {
        self.code_range(self.heads.len()).start
    }

    /// Where a head's coefficients lie in a code.
    fn code_range(&self, head: usize) -> std::ops::Range<usize> {
        let size = |head: &Head| head.coefficients.as_ref().map_or(0, |layer| layer.outputs);
        let start = self.heads[..head].iter().map(size).sum();
        start..start + self.heads.get(head).map_or(0, size)
    }

    /// Makes a code part of the network: it moves into the coefficients' biases and the person.
    pub(crate) fn add_code(&mut self, code: &[f32]) {
        let person = &code[self.coefficient_count()..];
        self.person
            .iter_mut()
            .zip(person)
            .for_each(|(x, offset)| *x += offset);
        for head in 0..self.heads.len() {
            let range = self.code_range(head);
            if let Some(layer) = &mut self.heads[head].coefficients {
                layer
                    .bias
                    .iter_mut()
                    .zip(&code[range])
                    .for_each(|(bias, x)| *bias += x);
            }
        }
    }

    /// Trainable parameters: encoder, person and heads.
    pub fn parameter_count(&self) -> usize {
        self.tensors()
            .iter()
            .map(|tensor| tensor.values.len())
            .sum::<usize>()
            - self.meta.len()
    }

    /// An all-zero network that a file's tensors are read into.
    pub(crate) fn zeros(config: HyperConfig) -> Self {
        let layer = |l| Head::zeros(&config, config.field.layer_parameters(l));
        Self {
            config,
            meta: vec![0.0; config.field.parameter_count()],
            encoder: PoseEncoder::zeros(),
            person: vec![0.0; config.person],
            heads: (0..config.field.layers).map(layer).collect(),
            provenance: Provenance::default(),
        }
    }

    /// Every tensor, in the order of files and of Reptile's updates.
    pub(crate) fn tensors(&self) -> Vec<Tensor<&[f32]>> {
        let mut list = vec![Tensor {
            name: "meta".to_owned(),
            shape: vec![self.meta.len()],
            values: self.meta.as_slice(),
        }];
        push_linear(&mut list, "encoder.global", &self.encoder.global);
        for (joint, [hidden, output]) in self.encoder.joints.iter().enumerate() {
            push_linear(&mut list, &format!("encoder.{joint}.hidden"), hidden);
            push_linear(&mut list, &format!("encoder.{joint}.output"), output);
        }
        if !self.person.is_empty() {
            list.push(Tensor {
                name: "person".to_owned(),
                shape: vec![self.person.len()],
                values: self.person.as_slice(),
            });
        }
        for (layer, head) in self.heads.iter().enumerate() {
            push_linear(&mut list, &format!("head.{layer}.first"), &head.first);
            push_linear(&mut list, &format!("head.{layer}.second"), &head.second);
            let norms = [
                ("first_norm", &head.first_norm),
                ("second_norm", &head.second_norm),
            ];
            for (name, norm) in norms {
                for (part, values) in [("scale", &norm.scale), ("shift", &norm.shift)] {
                    let name = format!("head.{layer}.{name}.{part}");
                    list.push(Tensor { name, shape: vec![values.len()], values });
                }
            }
            if let Some(coefficients) = &head.coefficients {
                push_linear(
                    &mut list,
                    &format!("head.{layer}.coefficients"),
                    coefficients,
                );
            }
            push_linear(&mut list, &format!("head.{layer}.output"), &head.output);
        }
        list
    }

    /// The values of [`Self::tensors`], in the same order.
    pub(crate) fn values_mut(&mut self) -> Vec<&mut Vec<f32>> {
        let mut list = vec![&mut self.meta];
        list.extend([
            &mut self.encoder.global.weight,
            &mut self.encoder.global.bias,
        ]);
        for layer in self.encoder.joints.iter_mut().flatten() {
            list.extend([&mut layer.weight, &mut layer.bias]);
        }
        if !self.person.is_empty() {
            list.push(&mut self.person);
        }
        for head in &mut self.heads {
            for layer in [&mut head.first, &mut head.second] {
                list.extend([&mut layer.weight, &mut layer.bias]);
            }
            for norm in [&mut head.first_norm, &mut head.second_norm] {
                list.extend([&mut norm.scale, &mut norm.shift]);
            }
            if let Some(layer) = &mut head.coefficients {
                list.extend([&mut layer.weight, &mut layer.bias]);
            }
            list.extend([&mut head.output.weight, &mut head.output.bias]);
        }
        list
    }
}

impl PoseField for HyperNetwork {
    fn field(&self, pose: &PoseInput) -> Box<dyn SignedDistanceField> {
        Box::new(Self::field(self, pose))
    }

    fn coefficients(&self, pose: &PoseInput) -> Option<Vec<f32>> {
        let coefficients = Self::coefficients(self, pose);
        (!coefficients.is_empty()).then_some(coefficients)
    }

    fn siren(&self, pose: &PoseInput) -> Option<SirenField> {
        Some(Self::field(self, pose))
    }

    fn kind(&self) -> &str {
        Self::KIND
    }

    fn to_bytes(&self) -> Vec<u8> {
        Self::to_bytes(self, Precision::F32).expect("own tensors fit their own shapes")
    }
}

fn push_linear<'a>(list: &mut Vec<Tensor<&'a [f32]>>, name: &str, layer: &'a Linear) {
    list.push(Tensor {
        name: format!("{name}.weight"),
        shape: vec![layer.outputs, layer.inputs],
        values: &layer.weight,
    });
    list.push(Tensor {
        name: format!("{name}.bias"),
        shape: vec![layer.outputs],
        values: &layer.bias,
    });
}

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::JOINT_COUNT;
    use glam::{Mat3, Vec3};
    use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

    use super::*;
    use crate::{
        hyper::HeadKind,
        nn::linear::{OuterGradient, sum_of_rows},
        sdf::SirenConfig,
    };

    const SMALL: HyperConfig = HyperConfig {
        field: SirenConfig { hidden: 16, layers: 3 },
        heads: HeadKind::LowRank(4),
        person: 3,
    };

    fn pose(rng: &mut StdRng) -> PoseInput {
        let mut vector =
            || Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.6_f32..0.6)));
        PoseInput {
            rotations: std::array::from_fn(|_| {
                Mat3::from_axis_angle(vector().normalize_or(Vec3::X), 0.7)
            }),
            joints_in_unit: [(); JOINT_COUNT].map(|()| vector()),
        }
    }

    fn network(config: HyperConfig, rng: &mut StdRng) -> HyperNetwork {
        let meta = SirenField::init(config.field, rng);
        HyperNetwork::init(config, &meta, rng)
    }

    /// A network that is not at its start: every tensor moved a little, so that no gradient is zero.
    fn moved(config: HyperConfig, rng: &mut StdRng) -> HyperNetwork {
        let mut network = network(config, rng);
        for tensor in network.values_mut() {
            for x in tensor {
                *x += rng.random_range(-0.05_f32..0.05);
            }
        }
        network
    }

    #[test]
    fn field_is_exactly_the_meta_field_before_any_training() {
        let mut rng = StdRng::seed_from_u64(1);
        for config in [
            SMALL,
            HyperConfig { heads: HeadKind::Full, person: 0, ..SMALL },
        ] {
            let network = network(config, &mut rng);
            assert_eq!(network.field(&pose(&mut rng)), network.meta_field());
        }
    }

    /// `sum_i weight_i * parameter_i` over the poses' field parameters, the weights being the bars.
    fn weighted_sum(network: &HyperNetwork, poses: &[PoseInput], bars: &[Vec<f32>]) -> f64 {
        let (_, parameters) = network.forward(poses);
        let products = |(p, bar): (&Vec<f32>, &Vec<f32>)| {
            p.iter()
                .zip(bar)
                .map(|(p, b)| f64::from(*p) * f64::from(*b))
                .sum::<f64>()
        };
        parameters.iter().zip(bars).map(products).sum()
    }

    fn dot(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    fn norm(vector: &[f32]) -> f32 {
        dot(vector, vector).sqrt()
    }

    /// The gradient written out, tensor by tensor, in the order of `values_mut` (phi* has none).
    fn written_out(network: &HyperNetwork, gradient: &HyperGradient) -> Vec<Vec<f32>> {
        let mut list = vec![vec![0.0; network.meta.len()]];
        let mut linear = |gradient: &OuterGradient, layer: &Linear| {
            let (weight, bias) = gradient.written_out(layer);
            list.extend([weight, bias]);
        };
        linear(&gradient.encoder.global, &network.encoder.global);
        let joints = gradient.encoder.joints.iter().zip(&network.encoder.joints);
        for (gradients, layers) in joints {
            gradients
                .iter()
                .zip(layers)
                .for_each(|(gradient, layer)| linear(gradient, layer));
        }
        if !network.person.is_empty() {
            list.push(sum_of_rows(&gradient.person, network.person.len()));
        }
        for (gradient, head) in gradient.heads.iter().zip(&network.heads) {
            let mut part = Vec::new();
            for (gradient, layer) in [
                (&gradient.first, &head.first),
                (&gradient.second, &head.second),
            ] {
                let (weight, bias) = gradient.written_out(layer);
                part.extend([weight, bias]);
            }
            for norm in [&gradient.first_norm, &gradient.second_norm] {
                part.extend([norm.scale.clone(), norm.shift.clone()]);
            }
            if let (Some(gradient), Some(layer)) = (&gradient.coefficients, &head.coefficients) {
                let (weight, bias) = gradient.written_out(layer);
                part.extend([weight, bias]);
            }
            let (weight, bias) = gradient.output.written_out(&head.output);
            part.extend([weight, bias]);
            list.extend(part);
        }
        list
    }

    #[test]
    fn gradients_match_finite_differences() {
        let mut rng = StdRng::seed_from_u64(2);
        for config in [
            SMALL,
            HyperConfig { heads: HeadKind::Full, person: 0, ..SMALL },
        ] {
            let mut network = moved(config, &mut rng);
            let poses = [pose(&mut rng), pose(&mut rng), pose(&mut rng)];
            let bars: Vec<Vec<f32>> = (0..poses.len())
                .map(|_| {
                    network
                        .meta
                        .iter()
                        .map(|_| rng.random_range(-1.0_f32..1.0))
                        .collect()
                })
                .collect();
            let (cache, _) = network.forward(&poses);
            let bar_slices: Vec<_> = bars.iter().map(Vec::as_slice).collect();
            let gradient = network.backward(cache, &bar_slices);
            let gradient = written_out(&network, &gradient);
            let names: Vec<_> = network.tensors().into_iter().map(|t| t.name).collect();
            for tensor in 1..names.len() {
                // One direction through all of a tensor, half along its gradient and half random: f32
                // differences of single weights drown in rounding. Its length keeps ReLUs from switching.
                let random: Vec<f32> = gradient[tensor]
                    .iter()
                    .map(|_| rng.random_range(-1.0_f32..1.0))
                    .collect();
                let (size, random_size) = (norm(&gradient[tensor]), norm(&random));
                let direction: Vec<f32> = gradient[tensor]
                    .iter()
                    .zip(&random)
                    .map(|(g, r)| g / size + r / random_size)
                    .collect();
                let slope = dot(&gradient[tensor], &direction);
                let step = 1e-3;
                let mut at = |offset: f32| {
                    let values = network.values_mut().swap_remove(tensor);
                    values
                        .iter_mut()
                        .zip(&direction)
                        .for_each(|(x, d)| *x += offset * d);
                    weighted_sum(&network, &poses, &bars)
                };
                let (above, below) = (at(step), at(-2.0 * step));
                at(step);
                let measured = (above - below) / (2.0 * f64::from(step));
                // 4 % of the gradient's own length: curvature and f32 rounding over this step.
                assert!(
                    (measured - f64::from(slope)).abs() < 0.04 * f64::from(size),
                    "{}: {measured} {slope} {size}",
                    names[tensor]
                );
            }
        }
    }

    #[test]
    fn quaternions_reach_the_heads_and_nothing_of_the_encoder_learns() {
        let mut rng = StdRng::seed_from_u64(8);
        let network = moved(SMALL, &mut rng).with_quaternions();
        let poses = [pose(&mut rng), pose(&mut rng)];
        let (cache, parameters) = network.forward(&poses);
        assert_ne!(parameters[0], parameters[1]);
        let bars: Vec<_> = parameters.iter().map(Vec::as_slice).collect();
        let gradient = network.backward(cache, &bars);
        assert!(
            gradient
                .encoder
                .global
                .output_bar
                .iter()
                .all(|bar| *bar == 0.0)
        );
    }

    #[test]
    fn parameter_count_is_the_configurations() {
        let mut rng = StdRng::seed_from_u64(3);
        let network = network(HyperConfig::LIVE, &mut rng);
        let expected = HyperConfig::LIVE.head_parameter_count()
            + HyperConfig::encoder_parameter_count()
            + HyperConfig::LIVE.person;
        assert_eq!(network.parameter_count(), expected);
    }

    #[test]
    #[ignore = "allocates 350 MB"]
    fn paper_preset_can_be_built() {
        let mut rng = StdRng::seed_from_u64(4);
        let network = network(HyperConfig::PAPER, &mut rng);
        assert_eq!(network.parameter_count(), 85_613_223);
    }

    #[test]
    fn bytes_bring_back_the_same_field() {
        let mut rng = StdRng::seed_from_u64(6);
        let mut network = moved(SMALL, &mut rng);
        network.provenance.training = "a test".to_owned();
        let bytes = network.to_bytes(Precision::F32).unwrap();
        let back = HyperNetwork::from_bytes(&bytes).unwrap();
        assert_eq!(back, network);
        assert_eq!(back.parameter_bytes(), network.parameter_bytes());
        let short = HyperNetwork::from_bytes(&network.to_bytes(Precision::F16).unwrap()).unwrap();
        assert_eq!(short.meta, network.meta);
        assert_ne!(short.parameter_bytes(), network.parameter_bytes());
        let pose = pose(&mut rng);
        let (exact, rounded) = (network.field(&pose), short.field(&pose));
        let largest = exact.parameters().iter().zip(rounded.parameters());
        let largest = largest.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // Eleven bits of mantissa on residuals of about one tenth.
        assert!(largest < 1e-3, "{largest}");
    }

    #[test]
    fn broken_bytes_are_refused() {
        let mut rng = StdRng::seed_from_u64(7);
        let bytes = network(SMALL, &mut rng).to_bytes(Precision::F32).unwrap();
        for cut in [0, 7, 100, bytes.len() / 2, bytes.len() - 1] {
            assert!(
                HyperNetwork::from_bytes(&bytes[..cut]).is_err(),
                "cut at {cut}"
            );
        }
        let mut nan = bytes;
        let end = nan.len();
        nan[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
        let error = HyperNetwork::from_bytes(&nan).unwrap_err().to_string();
        assert!(error.contains("not a finite number"), "{error}");
    }
}
