// Twin of `Driver::project_along_normals`: each workgroup takes a tile of vertices onto the zero level.
//
// The first TILE of its invocations own a vertex each; activations never leave the workgroup.

var<workgroup> parts: array<f32, HIDDEN>;
var<workgroup> is_open: array<u32, TILE>;
var<workgroup> open_count: u32;

@compute @workgroup_size(HIDDEN)
fn project(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) unit: u32) {
    let index = group.x * TILE + unit;
    let owns = unit < TILE && index < pose.vertex_count;
    var place = vec3f();
    var normal = vec3f();
    var slope = 1.0;
    if owns {
        place = vertices[index].place;
        normal = vertices[index].normal;
        slope = vertices[index].slope;
    }
    if unit < TILE {
        points[unit] = vec4f(place, 1.0);
        is_open[unit] = u32(owns);
    }
    var offset = 0.0;
    for (var step = 0u; step < pose.steps; step++) {
        workgroupBarrier();
        let value = value_at_own_point(unit);
        if unit < TILE && is_open[unit] == 1u {
            if is_finite(value) {
                let change = value / slope;
                offset = clamp(offset - change, -pose.longest, pose.longest);
                points[unit] = vec4f(place + normal * offset, 1.0);
                is_open[unit] = u32(abs(change) > pose.settled);
            } else {
                is_open[unit] = 0u;
            }
        }
        workgroupBarrier();
        if unit == 0u {
            var count = 0u;
            for (var point = 0u; point < TILE; point++) {
                count += is_open[point];
            }
            open_count = count;
        }
        if workgroupUniformLoad(&open_count) == 0u {
            break;
        }
    }
    if owns {
        let point = points[unit].xyz;
        store(CANONICAL, index, point * pose.metres_per_unit + pose.canonical_origin_m);
    }
}

// By its bits: comparing may be compiled as if there were no other numbers.
fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

// The field's value for those that own a point, nothing of use for others; all must come here together.
fn value_at_own_point(unit: u32) -> f32 {
    activations[unit] = sines(OMEGA * products_with_points(field[unit]));
    workgroupBarrier();
    var layer_at = HIDDEN;
    for (var layer = 2u; layer < pose.layers; layer++) {
        let bias_at = layer_at + QUARTER * HIDDEN;
        let z = product(layer_at, unit, filled(field[bias_at + unit / 4u][unit % 4u]));
        workgroupBarrier();
        activations[unit] = sines(OMEGA * z);
        workgroupBarrier();
        layer_at = bias_at + QUARTER;
    }
    return last_layer(unit, layer_at);
}

// Each point's sum in HIDDEN / TILE parts of TILE units.
fn last_layer(unit: u32, layer_at: u32) -> f32 {
    let point = unit % TILE;
    let first = unit - point;
    var part = 0.0;
    for (var k = 0u; k < TILE; k++) {
        let other = first + k;
        part += field[layer_at + other / 4u][other % 4u] * activations[other][point / 4u][point % 4u];
    }
    parts[unit] = part;
    workgroupBarrier();
    var value = field[layer_at + QUARTER].x;
    if unit < TILE {
        for (var at = unit; at < HIDDEN; at += TILE) {
            value += parts[at];
        }
    }
    return value;
}
