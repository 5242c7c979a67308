//! Means, shares and percentiles; `None` of nothing.

use crate::pipeline::clock;

pub(super) fn mean(values: impl IntoIterator<Item = f32>) -> Option<f64> {
    let (mut sum, mut count) = (0.0_f64, 0_u64);
    for value in values {
        sum += f64::from(value);
        count += 1;
    }
    (count > 0).then(|| sum / count as f64)
}

pub(super) fn root_mean_square(values: impl IntoIterator<Item = f32>) -> Option<f64> {
    mean(values.into_iter().map(|value| value * value)).map(f64::sqrt)
}

/// The share of the items that are so.
pub(super) fn share<T>(
    items: impl IntoIterator<Item = T>,
    is_so: impl Fn(T) -> bool,
) -> Option<f64> {
    mean(
        items
            .into_iter()
            .map(|item| f32::from(u8::from(is_so(item)))),
    )
}

/// As [`clock::percentile`], of anything that gives numbers.
pub(super) fn percentile(values: impl IntoIterator<Item = f32>, share: f64) -> Option<f64> {
    let values: Vec<f32> = values.into_iter().collect();
    clock::percentile(&values, share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_occurred() {
        let values = || (1..=100).map(|i| i as f32);
        assert_eq!(percentile(values(), 0.99), Some(99.0));
        assert_eq!(percentile(values(), 0.5), Some(50.0));
        assert_eq!(percentile([7.0], 0.95), Some(7.0));
        assert_eq!(percentile([], 0.5), None);
    }
}
