//! How a movement gets going and comes to rest.

/// From 0 to 1 with no jump in speed or acceleration (Perlin's quintic).
pub(super) fn smooth(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
}

/// 0 outside `[start, end]`, 1 inside but for smooth flanks of a width.
pub(super) fn window(x: f32, start: f32, end: f32, flank: f32) -> f32 {
    smooth((x - start) / flank) * smooth((end - x) / flank)
}

/// From 0 to 1 at an even pace, speeding up and slowing down over the first and last `flank`.
pub(super) fn cruise(x: f32, flank: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    let ramp = |x: f32| {
        let u = (x / flank).min(1.0);
        // The integral of smoothstep, then a straight line.
        flank * (u * u * u - 0.5 * u * u * u * u) + (x - flank).max(0.0)
    };
    let half = ramp(0.5);
    if x < 0.5 {
        0.5 * ramp(x) / half
    } else {
        1.0 - 0.5 * ramp(1.0 - x) / half
    }
}
