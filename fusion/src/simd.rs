//! Runs a loop compiled for the widest vector unit of the machine at hand.
//!
//! One body of plain Rust is compiled three times (AVX-512, AVX2 with FMA, baseline) and chosen at run
//! time. On other processors the baseline is the only one (NEON is part of aarch64's).

/// A vector unit that [`run_at`] can compile a body for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    Baseline,
}

impl Unit {
    /// The widest unit of this machine.
    #[inline]
    pub fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if Self::Avx512.is_here() {
                return Self::Avx512;
            }
            if Self::Avx2.is_here() {
                return Self::Avx2;
            }
        }
        Self::Baseline
    }

    /// Whether this machine has the unit.
    #[inline]
    pub fn is_here(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
                    && is_x86_feature_detected!("fma")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            Self::Baseline => true,
        }
    }
}

/// Runs `body` on the widest unit. Write the closure `#[inline(always)]`, so that it is compiled anew
/// inside each version.
#[inline]
pub fn run<R>(body: impl FnOnce() -> R) -> R {
    run_at(Unit::widest(), body)
}

/// Runs `body` on `unit`, or on the baseline where the machine has no such unit.
#[inline]
#[cfg_attr(
    target_arch = "x86_64",
    expect(
        unsafe_code,
        reason = "calling code compiled for a vector unit found at run time"
    )
)]
pub fn run_at<R>(unit: Unit, body: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if unit.is_here() {
        match unit {
            // SAFETY: `is_here` has just found every feature that `in_avx512` is compiled with.
            Unit::Avx512 => return unsafe { in_avx512(body) },
            // SAFETY: `is_here` has just found every feature that `in_avx2` is compiled with.
            Unit::Avx2 => return unsafe { in_avx2(body) },
            Unit::Baseline => {}
        }
    }
    body()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma")]
fn in_avx512<R>(body: impl FnOnce() -> R) -> R {
    body()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn in_avx2<R>(body: impl FnOnce() -> R) -> R {
    body()
}

/// The nearest whole number to a value of less than four million in size; of all others, what is no number included,
/// something that is four million or more as a `u32`. A vector unit does several
/// at a time, where a conversion, which asks what is too large or no number, is done one by one.
#[inline(always)]
pub(crate) fn nearest_whole(value: f32) -> i32 {
    // From 2^23 to 2^24 neighbouring floats are 1 apart, so adding rounds.
    const WHOLE: f32 = 12_582_912.0;
    (value + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits()) as i32
}

/// Every unit this machine has, for tests that hold them to each other.
pub fn units_here() -> Vec<Unit> {
    #[cfg(target_arch = "x86_64")]
    let all = [Unit::Avx512, Unit::Avx2, Unit::Baseline];
    #[cfg(not(target_arch = "x86_64"))]
    let all = [Unit::Baseline];
    all.into_iter().filter(|unit| unit.is_here()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_the_nearest() {
        for value in [
            -4_000_000.3_f32,
            -17.5,
            -0.6,
            -0.4,
            0.0,
            0.49,
            0.51,
            2.5,
            640.2,
            3_999_999.0,
        ] {
            assert_eq!(
                nearest_whole(value),
                value.round_ties_even() as i32,
                "{value}"
            );
        }
    }

    #[test]
    fn what_is_too_large_stays_far_outside_of_every_picture() {
        let sizes = [
            4.2e6,
            8.4e6,
            1.0e7,
            12_582_912.0,
            1.3e7,
            1.0e9,
            1.0e30,
            f32::INFINITY,
        ];
        for value in sizes
            .into_iter()
            .flat_map(|size| [size, -size])
            .chain([f32::NAN, -f32::NAN])
        {
            let outside = nearest_whole(value) as u32;
            assert!(outside >= 4_000_000, "{value} became {outside}");
        }
    }

    #[test]
    fn fused_multiply_add_gives_the_same_bits_on_every_unit() {
        let a: Vec<f32> = (0..1003).map(|i| (i as f32 * 0.37).sin()).collect();
        let expected: Vec<f32> = a.iter().map(|x| x.mul_add(*x, 0.1)).collect();
        for unit in units_here() {
            let mut got = vec![0.0_f32; a.len()];
            run_at(
                unit,
                #[inline(always)]
                || {
                    for (y, x) in got.iter_mut().zip(&a) {
                        *y = x.mul_add(*x, 0.1);
                    }
                },
            );
            assert_eq!(got, expected, "{unit:?}");
        }
    }
}
