//! Random numbers by counter: each depends on what it is for, never on what was drawn before it.

/// The source of one kind of randomness in one frame; `at` numbers within it are pixels, say.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Randomness {
    key: u64,
}

impl Randomness {
    pub(crate) fn new(seed: u64, frame: u64, purpose: u64) -> Self {
        Self { key: mix(mix(mix(seed) ^ frame) ^ purpose.wrapping_mul(0xd6e8_feb8_6659_fd93)) }
    }

    /// Evenly in (0, 1), never 0 or 1.
    pub(crate) fn uniform(self, at: u64) -> f32 {
        (self.bits(at) as f32 + 0.5) * (1.0 / (1u32 << 24) as f32)
    }

    pub(crate) fn between(self, at: u64, low: f32, high: f32) -> f32 {
        low + (high - low) * self.uniform(at)
    }

    /// Normal with mean 0 and standard deviation 1.
    pub(crate) fn gaussian(self, at: u64) -> f32 {
        normal_quantile(self.uniform(at))
    }

    fn bits(self, at: u64) -> u32 {
        (mix(self.key ^ at.wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> 40) as u32
    }
}

/// The finaliser of `SplitMix64`.
fn mix(z: u64) -> u64 {
    let z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The inverse of the normal distribution (rational approximation by P. J. Acklam; error below 1e-6).
fn normal_quantile(p: f32) -> f32 {
    const A: [f32; 6] = [
        -39.696_83,
        220.946_1,
        -275.928_5,
        138.357_75,
        -30.664_8,
        2.506_628_3,
    ];
    const B: [f32; 5] = [-54.476_1, 161.585_83, -155.698_98, 66.801_31, -13.280_682];
    const C: [f32; 6] = [
        -0.007_784_894,
        -0.322_396_46,
        -2.400_758_3,
        -2.549_732_6,
        4.374_664,
        2.938_164,
    ];
    const D: [f32; 4] = [0.007_784_696, 0.322_467_13, 2.445_134_2, 3.754_408_7];
    const TAIL: f32 = 0.02425;
    let tail = |p: f32| {
        let q = (-2.0 * p.ln()).sqrt();
        let above = ((((C[0] * q + C[1]) * q + C[2]) * q + C[3]) * q + C[4]) * q + C[5];
        above / ((((D[0] * q + D[1]) * q + D[2]) * q + D[3]) * q + 1.0)
    };
    if p < TAIL {
        return tail(p);
    }
    if p > 1.0 - TAIL {
        return -tail(1.0 - p);
    }
    let q = p - 0.5;
    let r = q * q;
    let above = (((((A[0] * r + A[1]) * r + A[2]) * r + A[3]) * r + A[4]) * r + A[5]) * q;
    above / (((((B[0] * r + B[1]) * r + B[2]) * r + B[3]) * r + B[4]) * r + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussian_numbers_have_mean_zero_and_deviation_one() {
        let random = Randomness::new(7, 3, 1);
        let n = 200_000;
        let values: Vec<f64> = (0..n).map(|i| f64::from(random.gaussian(i))).collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
        let kurtosis = values.iter().map(|v| (v - mean).powi(4)).sum::<f64>() / n as f64;
        assert!(mean.abs() < 0.01, "4 standard errors of the mean: {mean}");
        assert!(
            (variance - 1.0).abs() < 0.015,
            "4 standard errors: {variance}"
        );
        assert!(
            (kurtosis - 3.0).abs() < 0.1,
            "as heavy in the tails as a normal: {kurtosis}"
        );
    }

    #[test]
    fn frames_and_purposes_are_independent() {
        let of = |frame, purpose| Randomness::new(7, frame, purpose);
        let correlation = |a: Randomness, b: Randomness| {
            (0..20_000)
                .map(|i| a.gaussian(i) * b.gaussian(i))
                .sum::<f32>()
                / 20_000.0
        };
        assert!(
            correlation(of(0, 1), of(1, 1)).abs() < 0.03,
            "4 standard errors"
        );
        assert!(
            correlation(of(0, 1), of(0, 2)).abs() < 0.03,
            "4 standard errors"
        );
    }
}
