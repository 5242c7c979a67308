// What the learner's kernels see; `layout.rs` has the same structure. Frames have a field each, and as many tiles of points
// each; what is missing in the last of them weighs nothing.

struct Batch {
    // Of points, a frame.
    tiles: u32,
    // Layers that a sine follows.
    sines: u32,
    // Fours of a frame's field.
    field_len: u32,
    // Where points begin (a one behind each), and derivatives of the loss: by the gradient, then by the value.
    points_at: u32,
    bars_at: u32,
    // Parameters of a frame, and where their gradients begin.
    parameters: u32,
    gradients_at: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> batch: Batch;
// Fields, points, derivatives.
@group(0) @binding(1) var<storage, read> field: array<vec4f>;
// What one sweep leaves to the next, and all of them to the sums.
@group(0) @binding(2) var<storage, read_write> tape: array<Tile>;
// Each point's gradient and value, then each frame's gradients by its parameters, as the processor has them.
@group(0) @binding(3) var<storage, read_write> found: array<f32>;

// As `sdf/kernel.rs` names them: h, c, p, a and later z, T.
const H = 0u;
const C = 1u;
const P = 2u;
const Z = 3u;
const T = 4u;
const KINDS = 5u;

// `slot` counts tiles over all frames.
fn place(slot: u32, layer: u32, kind: u32, unit: u32) -> u32 {
    return ((slot * batch.sines + layer) * KINDS + kind) * HIDDEN + unit;
}
