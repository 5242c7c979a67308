// What a frame's points say about its parameters: twins of the products and sums of `backward` in `sdf/kernel.rs`. Points
// are summed in their order, so that the sum is always the same. `learner.rs` says how large BLOCK, SIDE and FACTORS are.

// p and z of BLOCK rows, T and h of BLOCK columns: four points of each, then the next four.
var<workgroup> factors: array<vec4f, FACTORS * TILE / 4u>;

// An invocation takes four rows, and every SIDE-th column of a block.
@compute @workgroup_size(SIDE * SIDE)
fn hidden_weights(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let blocks = (HIDDEN + BLOCK - 1u) / BLOCK;
    let rows_at = group.x / blocks * BLOCK;
    let columns_at = group.x % blocks * BLOCK;
    let layer = group.y + 1u;
    let frame = group.z;
    let row = local / SIDE * 4u;
    let column = local % SIDE;
    // Each column's four rows.
    var sums = mat4x4f();
    for (var tile = 0u; tile < batch.tiles; tile++) {
        let slot = frame * batch.tiles + tile;
        workgroupBarrier();
        for (var number = local; number < FACTORS; number += SIDE * SIDE) {
            load_factor(slot, layer, rows_at, columns_at, number);
        }
        workgroupBarrier();
        for (var four = 0u; four < TILE / 4u; four++) {
            let at = four * FACTORS;
            let p = four_from(at + row);
            let z = four_from(at + BLOCK + row);
            let column_at = at + 2u * BLOCK + column;
            sums += mat4x4f(
                products(p, z, column_at),
                products(p, z, column_at + SIDE),
                products(p, z, column_at + 2u * SIDE),
                products(p, z, column_at + 3u * SIDE),
            );
        }
    }
    let weight_at = batch.gradients_at + frame * batch.parameters + 4u * HIDDEN + group.y * (HIDDEN + 1u) * HIDDEN;
    for (var k = 0u; k < 4u; k++) {
        for (var i = 0u; i < 4u; i++) {
            let unit = rows_at + row + i;
            let input = columns_at + column + k * SIDE;
            if unit < HIDDEN && input < HIDDEN {
                found[weight_at + unit * HIDDEN + input] = sums[k][i];
            }
        }
    }
}

fn four_from(at: u32) -> mat4x4f {
    return mat4x4f(factors[at], factors[at + 1u], factors[at + 2u], factors[at + 3u]);
}

// A column's with four rows. A vector times a matrix is its product with each of the matrix' columns.
fn products(p: mat4x4f, z: mat4x4f, column_at: u32) -> vec4f {
    return factors[column_at] * p + factors[column_at + BLOCK] * z;
}

// Beyond the last unit there is the last unit: nobody asks for its sums.
fn load_factor(slot: u32, layer: u32, rows_at: u32, columns_at: u32, number: u32) {
    let of_block = number % BLOCK;
    let row = min(rows_at + of_block, HIDDEN - 1u);
    let column = min(columns_at + of_block, HIDDEN - 1u);
    var at = 0u;
    switch number / BLOCK {
        case 0u: { at = place(slot, layer, P, row); }
        case 1u: { at = place(slot, layer, Z, row); }
        case 2u: { at = place(slot, layer - 1u, T, column); }
        default: { at = place(slot, layer - 1u, H, column); }
    }
    let of_points = tape[at];
    for (var four = 0u; four < TILE / 4u; four++) {
        factors[four * FACTORS + number] = of_points[four];
    }
}

// Biases; of the first layer and of the last one weights, too. The last bias is the processor's.
@compute @workgroup_size(HIDDEN)
fn other_parameters(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) unit: u32) {
    let layer = group.x;
    let frame = group.y;
    let gradients_at = batch.gradients_at + frame * batch.parameters;
    let layer_at = gradients_at + 4u * HIDDEN + (max(layer, 1u) - 1u) * (HIDDEN + 1u) * HIDDEN;
    var bias = 0.0;
    var weight = vec3f();
    for (var tile = 0u; tile < batch.tiles; tile++) {
        let slot = frame * batch.tiles + tile;
        if layer == batch.sines {
            let t = tape[place(slot, layer - 1u, T, unit)];
            let h = tape[place(slot, layer - 1u, H, unit)];
            for (var point = 0u; point < TILE; point++) {
                let value_bar = field[batch.bars_at + slot * TILE + point].w;
                bias += t[point / 4u][point % 4u] + value_bar * h[point / 4u][point % 4u];
            }
            continue;
        }
        let p = tape[place(slot, layer, P, unit)];
        let z = tape[place(slot, layer, Z, unit)];
        for (var point = 0u; point < TILE; point++) {
            let z_here = z[point / 4u][point % 4u];
            bias += z_here;
            if layer == 0u {
                let at = slot * TILE + point;
                let gradient_bar = field[batch.bars_at + at].xyz;
                weight += p[point / 4u][point % 4u] * gradient_bar + z_here * field[batch.points_at + at].xyz;
            }
        }
    }
    if layer == batch.sines {
        found[layer_at + unit] = bias;
    } else if layer > 0u {
        found[layer_at + HIDDEN * HIDDEN + unit] = bias;
    } else {
        found[gradients_at + 3u * unit] = weight.x;
        found[gradients_at + 3u * unit + 1u] = weight.y;
        found[gradients_at + 3u * unit + 2u] = weight.z;
        found[gradients_at + 3u * HIDDEN + unit] = bias;
    }
}
