//! From a network's answer to bone weights: how much to believe either body point that was named, and what else.
//!
//! `w = (1 - r) (g a + (1 - g) b) + r softmax(own + base)`. Before any learning this is nearly the body point that
//! faces the same way, so that a network has to learn only where that is wrong. A network that answers with 24 numbers
//! has all the say itself: `r = 1`.

use effigy_registration::smpl::JOINT_COUNT;

use super::loss::{softmax, softmax_backward};
use crate::skinning::BoneWeights;

/// 24 numbers of its own, then one for `g` and one for `r`.
pub(super) const MIXTURE_OUTPUTS: usize = JOINT_COUNT + 2;

/// `g` and `r` of an answer of zeros: 0.95 and 0.02.
const GATE_START: f32 = 3.0;
const SHARE_START: f32 = -4.0;

/// What the body says about one point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Named {
    /// The weights at the closest point that faces the same way, and at the closest point.
    pub(super) candidates: [BoneWeights; 2],
    /// Logits that the network's own are added to.
    pub(super) base: BoneWeights,
}

/// A point's weights and how they came about.
pub(super) struct Mixture<'a> {
    named: &'a Named,
    gate: f32,
    share: f32,
    own: BoneWeights,
    pub(super) weights: BoneWeights,
}

impl<'a> Mixture<'a> {
    pub(super) fn new(answer: &[f32], named: &'a Named) -> Self {
        let logits: BoneWeights = std::array::from_fn(|bone| answer[bone] + named.base[bone]);
        let own = softmax(&logits);
        let (gate, share) = match answer[JOINT_COUNT..] {
            [gate, share] => (sigmoid(gate + GATE_START), sigmoid(share + SHARE_START)),
            _ => (0.5, 1.0),
        };
        let [a, b] = &named.candidates;
        let weights = std::array::from_fn(|bone| {
            let of_body = gate * a[bone] + (1.0 - gate) * b[bone];
            of_body + share * (own[bone] - of_body)
        });
        Self { named, gate, share, own, weights }
    }

    /// The gradient by the answer, from that by the weights; a network of 24 numbers takes the first 24.
    pub(super) fn backward(&self, bar: &BoneWeights) -> [f32; MIXTURE_OUTPUTS] {
        let Self { named, gate, share, own, .. } = self;
        let [a, b] = &named.candidates;
        let own_bar = bar.map(|bar| share * bar);
        let by_own = softmax_backward(own, &own_bar);
        let (mut gate_bar, mut share_bar) = (0.0, 0.0);
        for bone in 0..JOINT_COUNT {
            let of_body = gate * a[bone] + (1.0 - gate) * b[bone];
            gate_bar += bar[bone] * (1.0 - share) * (a[bone] - b[bone]);
            share_bar += bar[bone] * (own[bone] - of_body);
        }
        let mut out = [0.0; MIXTURE_OUTPUTS];
        out[..JOINT_COUNT].copy_from_slice(&by_own);
        out[JOINT_COUNT] = gate_bar * gate * (1.0 - gate);
        out[JOINT_COUNT + 1] = share_bar * share * (1.0 - share);
        out
    }
}

fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixtures_have_the_gradient_of_finite_differences() {
        const STEP: f32 = 1e-2;
        let wave = |phase: f32| -> BoneWeights {
            softmax(&std::array::from_fn::<f32, JOINT_COUNT, _>(|k| {
                (k as f32 + phase).sin()
            }))
        };
        let base = std::array::from_fn(|k| (k as f32 * 0.3).cos());
        let named = Named { candidates: [wave(0.0), wave(2.0)], base };
        let mut answer: Vec<f32> = (0..MIXTURE_OUTPUTS)
            .map(|k| (k as f32 * 0.9).sin())
            .collect();
        // Where all three parts have a say.
        (answer[JOINT_COUNT], answer[JOINT_COUNT + 1]) = (-2.5, 3.7);
        let bar: BoneWeights = std::array::from_fn(|k| (k as f32 * 1.3).cos());
        let got = Mixture::new(&answer, &named).backward(&bar);
        for (index, got) in got.into_iter().enumerate() {
            let loss = |step: f32| -> f64 {
                let mut answer = answer.clone();
                answer[index] += step;
                let weights = Mixture::new(&answer, &named).weights;
                weights
                    .iter()
                    .zip(&bar)
                    .map(|(w, b)| f64::from(w * b))
                    .sum()
            };
            let expected = ((loss(STEP) - loss(-STEP)) / (2.0 * f64::from(STEP))) as f32;
            // Second-order terms of the step and single precision.
            assert!((expected - got).abs() < 1e-4, "{index}: {expected} {got}");
        }
        let sum: f32 = Mixture::new(&answer, &named).weights.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5);
    }
}
