// Twin of `Driver::skin`: four bones blended once for each vertex, as `Warp::posed_from_rest_by_four` does.

@compute @workgroup_size(64)
fn skin(@builtin(global_invocation_id) id: vec3u) {
    let index = id.x;
    if index >= pose.vertex_count {
        return;
    }
    let vertex = vertices[index];
    let at_rest = transformed(vertex.rest_from_canonical, load(CANONICAL, index));
    var blend: array<vec4f, 3>;
    for (var slot = 0u; slot < 4u; slot++) {
        let bone = 3u * ((vertex.bones >> (8u * slot)) & 255u);
        let weight = vertex.weights[slot];
        blend[0] += weight * pose.bones[bone];
        blend[1] += weight * pose.bones[bone + 1u];
        blend[2] += weight * pose.bones[bone + 2u];
    }
    store(POSED, index, transformed(blend, at_rest) + pose.trans_m);
}

fn transformed(rows: array<vec4f, 3>, point: vec3f) -> vec3f {
    let p = vec4f(point, 1.0);
    return vec3f(dot(rows[0], p), dot(rows[1], p), dot(rows[2], p));
}
