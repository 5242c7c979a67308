//! Every layer's backward pass against finite differences.

use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

use super::{
    convolution::{Convolution, Doubling, Images},
    dense::{Bias, Dense},
    group_norm::GroupNorm,
    layout::Layout,
    residual::Residual,
    unet::{UNet, UNetConfig},
};

/// Central differences in single precision over this step; sums of some hundred numbers of about one.
const STEP: f32 = 3e-3;
/// Share of the largest derivative that rounding and curvature may cost.
const TOLERANCE: f32 = 2e-2;

fn random(count: usize, seed: u64) -> Vec<f32> {
    let mut rng = StdRng::seed_from_u64(seed);
    (0..count)
        .map(|_| rng.random_range(-1.0_f32..1.0))
        .collect()
}

/// Parameters and input give the output.
type Forward<'a> = dyn Fn(&[f32], &[f32]) -> Vec<f32> + 'a;

/// Parameters, input, the output's gradient and the parameters' gradient to add to, give the input's gradient.
type Backward<'a> = dyn Fn(&[f32], &[f32], &[f32], &mut [f32]) -> Vec<f32> + 'a;

/// A loss whose gradient by an output is `weights`, and a test of both gradients.
fn check(parameters: &[f32], input: &[f32], forward: &Forward<'_>, backward: &Backward<'_>) {
    let out = forward(parameters, input);
    let weights = random(out.len(), 5);
    let loss = |parameters: &[f32], input: &[f32]| -> f64 {
        let out = forward(parameters, input);
        out.iter()
            .zip(&weights)
            .map(|(y, w)| f64::from(y * w))
            .sum()
    };
    let mut gradient = vec![0.0; parameters.len()];
    let input_bar = backward(parameters, input, &weights, &mut gradient);
    let by = |values: &[f32], of: &dyn Fn(&[f32]) -> f64, got: &[f32], what: &str| {
        let largest = got.iter().fold(1e-3_f32, |a, b| a.max(b.abs()));
        let mut wrong = 0;
        let tried: Vec<usize> = (0..values.len())
            .step_by((values.len() / 60).max(1))
            .collect();
        for &index in &tried {
            let moved = |step: f32| {
                let mut values = values.to_vec();
                values[index] += step;
                of(&values)
            };
            let expected = ((moved(STEP) - moved(-STEP)) / (2.0 * f64::from(STEP))) as f32;
            wrong += usize::from((expected - got[index]).abs() > TOLERANCE * largest);
        }
        // A step may cross the corner of a ReLU or a change of the largest pixel.
        assert!(
            wrong * 20 <= tried.len(),
            "{what}: {wrong} of {} differ",
            tried.len()
        );
    };
    by(parameters, &|p| loss(p, input), &gradient, "parameters");
    by(input, &|x| loss(parameters, x), &input_bar, "input");
}

fn images(values: &[f32], side: usize, channels: usize) -> Images {
    Images { side, channels, values: values.to_vec() }
}

#[test]
fn dense_layers_have_the_gradients_of_finite_differences() {
    let mut layout = Layout::default();
    let layer = Dense::new(&mut layout, "a", (7, 5), Bias::With);
    check(
        &random(layout.count, 1),
        &random(6 * 7, 2),
        &|p, x| layer.forward(p, x),
        &|p, x, bar, gradient| layer.backward(p, x, bar, gradient),
    );
}

#[test]
fn group_norms_have_the_gradients_of_finite_differences() {
    let mut layout = Layout::default();
    let norm = GroupNorm::new(&mut layout, "n", 12, 3);
    check(
        &random(layout.count, 1),
        &random(5 * 12, 2),
        &|p, x| norm.forward(p, x).0,
        &|p, x, bar, gradient| norm.backward(p, &norm.forward(p, x).1, bar, gradient),
    );
}

#[test]
fn residual_blocks_have_the_gradients_of_finite_differences() {
    for groups in [0, 2] {
        let mut layout = Layout::default();
        let block = Residual::new(&mut layout, "r", (8, 6, 4), groups);
        check(
            &random(layout.count, 1),
            &random(9 * 8, 2),
            &|p, x| block.forward(p, x.to_vec()).0,
            &|p, x, bar, gradient| {
                block.backward(p, &block.forward(p, x.to_vec()).1, bar, gradient)
            },
        );
    }
}

#[test]
fn convolutions_have_the_gradients_of_finite_differences() {
    let mut layout = Layout::default();
    let layer = Convolution::new(&mut layout, "c", 3, 2);
    // Twelve rows: more than one block of them.
    check(
        &random(layout.count, 1),
        &random(2 * 12 * 12 * 3, 2),
        &|p, x| layer.forward(p, &images(x, 12, 3)).values,
        &|p, x, bar, gradient| {
            let mut bar = images(bar, 12, 2);
            layer
                .backward(p, &images(x, 12, 3), &mut bar, gradient)
                .values
        },
    );
}

#[test]
fn doubling_has_the_gradients_of_finite_differences() {
    let mut layout = Layout::default();
    let layer = Doubling::new(&mut layout, "d", 3, 2);
    check(
        &random(layout.count, 1),
        &random(2 * 4 * 4 * 3, 2),
        &|p, x| layer.forward(p, &images(x, 4, 3)).values,
        &|p, x, bar, gradient| {
            let bar = images(bar, 8, 2);
            layer.backward(p, &images(x, 4, 3), &bar, gradient).values
        },
    );
}

#[test]
fn unets_have_the_gradients_of_finite_differences() {
    let mut layout = Layout::default();
    let net = UNet::new(&mut layout, 2, UNetConfig { depth: 3, width: 3 });
    let start = layout.init(&mut StdRng::seed_from_u64(1));
    check(
        &start,
        &random(3 * 8 * 8 * 2, 2),
        &|p, x| net.forward(p, images(x, 8, 2)).0.values,
        &|p, x, bar, gradient| {
            let (_, cache) = net.forward(p, images(x, 8, 2));
            net.backward(p, &cache, &images(bar, 8, 2), gradient).values
        },
    );
}

#[test]
fn a_convolution_is_the_sum_over_its_neighbourhood() {
    let mut layout = Layout::default();
    let layer = Convolution::new(&mut layout, "c", 2, 1);
    let parameters = random(layout.count, 1);
    let (side, channels) = (10, 2);
    let input = images(&random(2 * side * side * channels, 2), side, channels);
    let out = layer.forward(&parameters, &input);
    let at = |image: usize, row: isize, column: isize, channel: usize| -> f32 {
        let inside = (0..side as isize).contains(&row) && (0..side as isize).contains(&column);
        if !inside {
            return 0.0;
        }
        let pixel = (image * side + row as usize) * side + column as usize;
        input.values[pixel * channels + channel]
    };
    for (image, row, column) in [(0, 0, 0), (0, 5, 9), (1, 9, 3), (1, 8, 8)] {
        let mut expected = parameters[9 * channels];
        for (k, weight) in parameters[..9 * channels].iter().enumerate() {
            let (pixel, channel) = (k / channels, k % channels);
            let (dr, dc) = (pixel as isize / 3 - 1, pixel as isize % 3 - 1);
            expected += weight * at(image, row as isize + dr, column as isize + dc, channel);
        }
        let got = out.values[(image * side + row) * side + column];
        // Eighteen products of numbers below one.
        assert!((got - expected).abs() < 1e-5, "{got} {expected}");
    }
}
