//! Loss and parameter gradients of several frames, each with a weight set of its own, on many threads.
//!
//! Every frame's points are cut into a fixed number of units, whatever the thread count. A unit sums its
//! tiles' gradients in order, and a frame sums its units in order: the result is the same to the last bit
//! on one thread and on sixteen.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    config::SirenConfig,
    field::SpareWorkspaces,
    kernel::{self, Network, Workspace},
    loss::{LossConfig, LossPoint, LossTerms, Scale, point_loss},
};

/// Units of work a frame: 8 frames x 4 units keep 16 threads busy.
const UNITS_PER_FRAME: usize = 4;

/// One frame's weights and what is known at its points.
#[derive(Clone, Copy, Debug)]
pub struct FieldFrame<'a> {
    /// [parameters]
    pub parameters: &'a [f32],
    /// In unit space; [points]
    pub points: &'a [Vec3],
    /// [points]
    pub known: &'a [LossPoint],
}

/// Buffers of the computation, reused from step to step.
pub struct FieldGradients {
    config: SirenConfig,
    units: Vec<Unit>,
    spare: SpareWorkspaces,
}

#[derive(Default)]
struct Unit {
    gradient: Vec<f32>,
    terms: LossTerms,
}

impl FieldGradients {
    pub fn new(config: SirenConfig) -> Self {
        Self { config, units: Vec::new(), spare: SpareWorkspaces::new(config) }
    }

    /// The loss over all frames; leaves each frame's gradient in [`Self::frame`]. Runs in the current
    /// rayon pool.
    pub fn compute(&mut self, frames: &[FieldFrame<'_>], loss: &LossConfig) -> LossTerms {
        let scale = Scale::of(frames.iter().flat_map(|frame| frame.known));
        self.units
            .resize_with(frames.len() * UNITS_PER_FRAME, Unit::default);
        let nets: Vec<_> = frames
            .iter()
            .map(|frame| Network::new(self.config, frame.parameters))
            .collect();
        let (config, spare) = (self.config, &self.spare);
        self.units
            .par_iter_mut()
            .enumerate()
            .with_max_len(1)
            .for_each(|(index, unit)| {
                let (frame, part) = (index / UNITS_PER_FRAME, index % UNITS_PER_FRAME);
                unit.gradient.resize(config.parameter_count(), 0.0);
                unit.gradient.fill(0.0);
                unit.terms = LossTerms::default();
                spare.with(|work| {
                    run_unit(
                        work,
                        &nets[frame],
                        &frames[frame],
                        part,
                        (loss, scale),
                        unit,
                    );
                });
            });
        self.units
            .par_chunks_mut(UNITS_PER_FRAME)
            .for_each(sum_into_first);
        let mut terms = LossTerms::default();
        for frame in self.units.chunks(UNITS_PER_FRAME) {
            terms += frame[0].terms;
        }
        terms
    }

    /// The loss's gradient by a frame's parameters, after [`Self::compute`].
    pub fn frame(&self, frame: usize) -> &[f32] {
        &self.units[frame * UNITS_PER_FRAME].gradient
    }
}

fn run_unit(
    work: &mut Workspace,
    net: &Network<'_>,
    frame: &FieldFrame<'_>,
    part: usize,
    (loss, scale): (&LossConfig, Scale),
    unit: &mut Unit,
) {
    let tile = work.tile_points();
    let tiles = frame.points.len().div_ceil(tile);
    let first = tiles * part / UNITS_PER_FRAME;
    let last = tiles * (part + 1) / UNITS_PER_FRAME;
    for number in first..last {
        let range = number * tile..((number + 1) * tile).min(frame.points.len());
        let (points, known) = (&frame.points[range.clone()], &frame.known[range]);
        kernel::values_and_gradients(work, net, points);
        for (index, known) in known.iter().enumerate() {
            let (value, gradient) = (work.values[index], work.gradients[index]);
            let (terms, value_bar, gradient_bar) = point_loss(loss, scale, known, value, gradient);
            unit.terms += terms;
            work.value_bars[index] = value_bar;
            work.gradient_bars[index] = gradient_bar;
        }
        kernel::backward(work, net, points, &mut unit.gradient);
    }
}

fn sum_into_first(units: &mut [Unit]) {
    if let Some((first, rest)) = units.split_first_mut() {
        for unit in rest {
            first.terms += unit.terms;
            for (sum, part) in first.gradient.iter_mut().zip(&unit.gradient) {
                *sum += part;
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

    use super::*;
    use crate::sdf::{SignedDistanceField as _, SirenField, loss::Known, plain};

    fn random_point(rng: &mut StdRng) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0_f32..1.0)))
    }

    /// A small network, and points of every kind: 150 of them, so that the last tile is not full.
    pub(crate) fn example(config: SirenConfig) -> (SirenField, Vec<Vec3>, Vec<LossPoint>) {
        let mut rng = StdRng::seed_from_u64(5);
        let field = SirenField::init(config, &mut rng);
        let points: Vec<_> = (0..150).map(|_| random_point(&mut rng)).collect();
        let known = (0..points.len())
            .map(|index| {
                let known = match index % 6 {
                    0 => Known::Surface { normal: random_point(&mut rng).normalize_or(Vec3::X) },
                    1 => Known::Surface { normal: Vec3::ZERO },
                    2 => Known::Distance(0.03),
                    3 => Known::Free { at_least: 0.05 },
                    4 => Known::Nothing,
                    _ => Known::Repelled,
                };
                LossPoint {
                    known,
                    weight: if index % 7 == 0 {
                        0.0
                    } else {
                        0.5 + index as f32 / 150.0
                    },
                }
            })
            .collect();
        (field, points, known)
    }

    fn in_f64(points: &[Vec3]) -> Vec<[f64; 3]> {
        points.iter().map(|p| p.as_dvec3().to_array()).collect()
    }

    #[test]
    fn values_and_gradients_match_the_plain_twin() {
        for config in [
            SirenConfig { hidden: 48, layers: 5 },
            SirenConfig { hidden: 16, layers: 2 },
        ] {
            let (field, points, _) = example(config);
            let parameters: Vec<f64> = field.parameters().iter().map(|p| f64::from(*p)).collect();
            let mut values = vec![0.0; points.len()];
            let mut both = vec![0.0; points.len()];
            let mut gradients = vec![Vec3::ZERO; points.len()];
            field.values(&points, &mut values);
            field.values_and_gradients(&points, &mut both, &mut gradients);
            for (index, point) in in_f64(&points).into_iter().enumerate() {
                let (f, g) = plain::value_and_gradient(config, &parameters, point);
                // f32 rounding through five layers, each of which multiplies it by up to thirty.
                assert!((f64::from(values[index]) - f).abs() < 1e-5);
                assert!((f64::from(both[index]) - f).abs() < 1e-5);
                let error = gradients[index].as_dvec3() - glam::DVec3::from_array(g);
                assert!(error.length() < 1e-4, "{error}");
            }
        }
    }

    #[test]
    fn parameter_gradients_match_finite_differences_of_the_plain_loss() {
        for config in [
            SirenConfig { hidden: 16, layers: 4 },
            SirenConfig { hidden: 16, layers: 2 },
        ] {
            let (field, points, known) = example(config);
            let weights = LossConfig::default();
            let mut gradients = FieldGradients::new(config);
            let frame =
                FieldFrame { parameters: field.parameters(), points: &points, known: &known };
            let terms = gradients.compute(&[frame], &weights);
            let mut parameters: Vec<f64> =
                field.parameters().iter().map(|p| f64::from(*p)).collect();
            let exact = in_f64(&points);
            let loss = |p: &[f64]| plain::loss(config, &weights, p, &exact, &known);
            assert!((terms.total() / loss(&parameters) - 1.0).abs() < 1e-5);
            let norm = gradients
                .frame(0)
                .iter()
                .map(|g| f64::from(g * g))
                .sum::<f64>()
                .sqrt();
            let typical = norm / (parameters.len() as f64).sqrt();
            let step = 1e-7;
            for index in (0..parameters.len()).step_by(7) {
                let kept = parameters[index];
                parameters[index] = kept + step;
                let above = loss(&parameters);
                parameters[index] = kept - step;
                let slope = (above - loss(&parameters)) / (2.0 * step);
                parameters[index] = kept;
                let error = (slope - f64::from(gradients.frame(0)[index])).abs();
                // f32 against f64: a part in 1,000 of a typical entry.
                assert!(
                    error < 1e-3 * (typical + slope.abs()),
                    "{index}: {slope} {error}"
                );
            }
        }
    }

    #[test]
    fn results_do_not_depend_on_the_thread_count() {
        let config = SirenConfig { hidden: 32, layers: 4 };
        let (field, points, known) = example(config);
        let frame = FieldFrame { parameters: field.parameters(), points: &points, known: &known };
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            let mut gradients = FieldGradients::new(config);
            let terms = pool.install(|| gradients.compute(&[frame; 3], &LossConfig::default()));
            (
                terms,
                gradients.frame(0).to_vec(),
                gradients.frame(2).to_vec(),
            )
        };
        assert_eq!(on(1), on(3));
    }

    #[test]
    fn points_of_weight_zero_change_nothing() {
        let config = SirenConfig { hidden: 16, layers: 3 };
        let (field, points, known) = example(config);
        let keep: Vec<usize> = (0..points.len())
            .filter(|i| known[*i].weight > 0.0)
            .collect();
        let kept_points: Vec<_> = keep.iter().map(|i| points[*i]).collect();
        let kept_known: Vec<_> = keep.iter().map(|i| known[*i]).collect();
        let mut gradients = FieldGradients::new(config);
        let loss = LossConfig::default();
        let all = FieldFrame { parameters: field.parameters(), points: &points, known: &known };
        let with = gradients.compute(&[all], &loss);
        let some =
            FieldFrame { parameters: field.parameters(), points: &kept_points, known: &kept_known };
        let without = gradients.compute(&[some], &loss);
        assert!((with.total() - without.total()).abs() < 1e-9 * with.total());
    }
}
