// Twins of `values_and_gradients` and of the sweeps of `backward` in `sdf/kernel.rs`: a workgroup takes a tile of points
// through all layers and back.

// Each unit's share of a few others' sum: gradient and value.
var<workgroup> parts: array<vec4f, HIDDEN>;

const LAYER_LEN = 2u * QUARTER * HIDDEN + QUARTER;

// The weights of a layer behind the first, then biases, then the weights turned.
fn weights_at(frame: u32, layer: u32) -> u32 {
    return frame * batch.field_len + HIDDEN + (layer - 1u) * LAYER_LEN;
}

fn turned_at(frame: u32, layer: u32) -> u32 {
    return weights_at(frame, layer) + QUARTER * HIDDEN + QUARTER;
}

fn of_unit(at: u32, unit: u32) -> f32 {
    return field[at + unit / 4u][unit % 4u];
}

// What is given of a tile's points, whose list begins at `at`; all must come here together.
fn take_points(at: u32, slot: u32, unit: u32) {
    if unit < TILE {
        points[unit] = field[at + slot * TILE + unit];
    }
    workgroupBarrier();
}

@compute @workgroup_size(HIDDEN)
fn forward(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) unit: u32) {
    let frame = group.y;
    let slot = frame * batch.tiles + group.x;
    take_points(batch.points_at, slot, unit);
    let first = field[frame * batch.field_len + unit];
    var c = pass_sine(slot, 0u, unit, products_with_points(first));
    for (var layer = 1u; layer < batch.sines; layer++) {
        workgroupBarrier();
        let at = weights_at(frame, layer);
        let z = product(at, unit, filled(of_unit(at + QUARTER * HIDDEN, unit)));
        workgroupBarrier();
        c = pass_sine(slot, layer, unit, z);
    }
    workgroupBarrier();

    let last_at = weights_at(frame, batch.sines);
    let point = unit % TILE;
    let neighbour = unit - point;
    var value = 0.0;
    for (var k = 0u; k < TILE; k++) {
        let other = neighbour + k;
        value += of_unit(last_at, other) * activations[other][point / 4u][point % 4u];
    }
    workgroupBarrier();

    var a = filled(of_unit(last_at, unit));
    activations[unit] = times(a, c);
    for (var layer = batch.sines - 1u; ; layer--) {
        tape[place(slot, layer, Z, unit)] = a;
        tape[place(slot, layer, P, unit)] = activations[unit];
        workgroupBarrier();
        if layer == 0u {
            break;
        }
        a = product(turned_at(frame, layer), unit, filled(0.0));
        workgroupBarrier();
        activations[unit] = times(a, tape[place(slot, layer - 1u, C, unit)]);
    }

    var gradient = vec3f();
    for (var k = 0u; k < TILE; k++) {
        let other = neighbour + k;
        let weight = field[frame * batch.field_len + other].xyz;
        gradient += weight * activations[other][point / 4u][point % 4u];
    }
    parts[unit] = vec4f(gradient, value);
    workgroupBarrier();
    if unit < TILE {
        var sum = vec4f(0.0, 0.0, 0.0, field[last_at + QUARTER].x);
        for (var at = unit; at < HIDDEN; at += TILE) {
            sum += parts[at];
        }
        let at = 4u * (slot * TILE + unit);
        found[at] = sum.x;
        found[at + 1u] = sum.y;
        found[at + 2u] = sum.z;
        found[at + 3u] = sum.w;
    }
}

// Leaves the sine in the workgroup and what the way back needs on the tape; gives the sine's derivative.
fn pass_sine(slot: u32, layer: u32, unit: u32, z: Tile) -> Tile {
    let h = sines(OMEGA * z);
    let c = OMEGA * cosines(OMEGA * z);
    tape[place(slot, layer, H, unit)] = h;
    tape[place(slot, layer, C, unit)] = c;
    activations[unit] = h;
    return c;
}

@compute @workgroup_size(HIDDEN)
fn backward(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) unit: u32) {
    let frame = group.y;
    let slot = frame * batch.tiles + group.x;
    take_points(batch.bars_at, slot, unit);
    let first = field[frame * batch.field_len + unit].xyz;
    var t = products_with_points(vec4f(first, 0.0));
    for (var layer = 0u; ; layer++) {
        let h = tape[place(slot, layer, H, unit)];
        let a = tape[place(slot, layer, Z, unit)];
        tape[place(slot, layer, Z, unit)] = (-OMEGA * OMEGA) * times(times(t, a), h);
        t = times(t, tape[place(slot, layer, C, unit)]);
        tape[place(slot, layer, T, unit)] = t;
        if layer + 1u == batch.sines {
            break;
        }
        workgroupBarrier();
        activations[unit] = t;
        workgroupBarrier();
        t = product(weights_at(frame, layer + 1u), unit, filled(0.0));
    }

    var h_bar = products_with_points(vec4f(0.0, 0.0, 0.0, of_unit(weights_at(frame, batch.sines), unit)));
    for (var layer = batch.sines - 1u; ; layer--) {
        let at = place(slot, layer, Z, unit);
        let z = tape[at] + times(h_bar, tape[place(slot, layer, C, unit)]);
        tape[at] = z;
        if layer == 0u {
            break;
        }
        workgroupBarrier();
        activations[unit] = z;
        workgroupBarrier();
        h_bar = product(turned_at(frame, layer), unit, filled(0.0));
    }
}
