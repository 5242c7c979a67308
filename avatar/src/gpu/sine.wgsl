// Twin of `sdf/sincos.rs`, where its sources are: WGSL promises of its own sine no more than 2^-11.

fn sine(angle_rad: vec4f) -> vec4f {
    let turns = round(angle_rad * 0.318309886);
    let r = within_a_turn(angle_rad, turns);
    let r2 = r * r;
    var p = fma(vec4f(2.6000243e-6), r2, vec4f(-1.9806602e-4));
    p = fma(p, r2, vec4f(8.333017e-3));
    p = fma(p, r2, vec4f(-0.16666657));
    let s = fma(p * r2, r, r);
    return s * sign_of(turns);
}

fn cosine(angle_rad: vec4f) -> vec4f {
    let turns = round(angle_rad * 0.318309886);
    let r = within_a_turn(angle_rad, turns);
    let r2 = r * r;
    var p = fma(vec4f(-2.6076816e-7), r2, vec4f(2.476187e-5));
    p = fma(p, r2, vec4f(-1.3888404e-3));
    p = fma(p, r2, vec4f(4.166664e-2));
    p = fma(p, r2, vec4f(-0.5));
    return fma(p, r2, vec4f(1.0)) * sign_of(turns);
}

// Half turns taken off in three parts.
fn within_a_turn(angle_rad: vec4f, turns: vec4f) -> vec4f {
    let r = fma(-turns, vec4f(3.140625), angle_rad);
    return fma(-turns, vec4f(1.509958e-7), fma(-turns, vec4f(9.675026e-4), r));
}

fn sign_of(turns: vec4f) -> vec4f {
    let odd = turns - 2.0 * floor(0.5 * turns);
    return 1.0 - 2.0 * odd;
}
