//! Sine and cosine of one angle, as a polynomial that vectorises.
//!
//! The angle is reduced by the nearest multiple of pi (three-part pi, Cody and Waite 1980), then sine is
//! an odd polynomial of degree 9 and cosine an even one of degree 10 on [-pi/2, pi/2], both minimax fits
//! (4.6e-9 and 2.4e-10). In f32 the largest error against f64 is 1.2e-7 for angles up to 1,000 rad; it
//! grows with the angle (the products of pi lose bits), and stays finite for any finite one.

/// 1.5 * 2^23: adding it rounds to the nearest integer and leaves that integer in the low bits.
const ROUND: f32 = 12_582_912.0;
const PI_HIGH: f32 = 3.140_625;
const PI_MIDDLE: f32 = 9.675_026e-4;
const PI_LOW: f32 = 1.509_958e-7;

/// `(sin(angle_rad), cos(angle_rad))`. NaN in, NaN out.
#[expect(
    clippy::inline_always,
    reason = "compiled inside each vector unit's loop"
)]
#[inline(always)]
pub(crate) fn sincos(angle_rad: f32) -> (f32, f32) {
    let shifted = angle_rad.mul_add(std::f32::consts::FRAC_1_PI, ROUND);
    let turns = shifted - ROUND;
    let sign = shifted.to_bits() << 31;
    let r = turns.mul_add(-PI_HIGH, angle_rad);
    let r = turns.mul_add(-PI_MIDDLE, r);
    let r = turns.mul_add(-PI_LOW, r);
    let r2 = r * r;
    let sine = (polynomial(
        r2,
        [2.600_024_3e-6, -1.980_660_2e-4, 8.333_017e-3, -0.166_666_57],
    ) * r2)
        .mul_add(r, r);
    let cosine = polynomial(
        r2,
        [
            -2.607_681_6e-7,
            2.476_187e-5,
            -1.388_840_4e-3,
            4.166_664e-2,
            -0.5,
        ],
    )
    .mul_add(r2, 1.0);
    (
        f32::from_bits(sine.to_bits() ^ sign),
        f32::from_bits(cosine.to_bits() ^ sign),
    )
}

/// Horner's rule, highest power first.
#[expect(
    clippy::inline_always,
    reason = "compiled inside each vector unit's loop"
)]
#[inline(always)]
fn polynomial<const N: usize>(x: f32, coefficients: [f32; N]) -> f32 {
    let mut sum = coefficients[0];
    for &coefficient in &coefficients[1..] {
        sum = sum.mul_add(x, coefficient);
    }
    sum
}

#[cfg(test)]
mod tests {
    use effigy_fusion::simd;

    use super::*;

    fn largest_error(limit_rad: f32, unit: simd::Unit) -> f64 {
        let angles: Vec<f32> = (-200_000..=200_000)
            .map(|i| limit_rad * (i as f32 / 200_000.0))
            .collect();
        let mut out = vec![(0.0_f32, 0.0_f32); angles.len()];
        simd::run_at(
            unit,
            #[inline(always)]
            || {
                for (pair, &angle) in out.iter_mut().zip(&angles) {
                    *pair = sincos(angle);
                }
            },
        );
        let error = |(&angle, &(s, c)): (&f32, &(f32, f32))| {
            let exact = f64::from(angle);
            (f64::from(s) - exact.sin())
                .abs()
                .max((f64::from(c) - exact.cos()).abs())
        };
        angles.iter().zip(&out).map(error).fold(0.0, f64::max)
    }

    #[test]
    fn error_stays_below_two_units_in_the_last_place_of_one() {
        for unit in simd::units_here() {
            for (limit_rad, most) in [(4.0, 1.2e-7), (1000.0, 1.5e-7)] {
                let error = largest_error(limit_rad, unit);
                println!("{unit:?}: {error:.3e} up to {limit_rad} rad");
                assert!(error < most, "{unit:?}: {error:e} up to {limit_rad} rad");
            }
        }
    }

    #[test]
    fn angles_beyond_the_stated_range_stay_finite_and_nan_stays_nan() {
        for angle in [1.0e5_f32, -3.0e7] {
            let (s, c) = sincos(angle);
            assert!(s.is_finite() && c.is_finite());
        }
        assert!(sincos(f32::NAN).0.is_nan() && sincos(f32::INFINITY).1.is_nan());
    }
}
