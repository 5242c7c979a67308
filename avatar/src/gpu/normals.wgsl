// Twin of `vertex_normals_into`: each vertex gathers its triangles in their order, so that the sum is always the same.

@compute @workgroup_size(64)
fn normals(@builtin(global_invocation_id) id: vec3u) {
    let index = id.x;
    if index >= pose.vertex_count {
        return;
    }
    var sum = vec3f();
    for (var at = fans[index]; at < fans[index + 1u]; at++) {
        let triangle = fans[at];
        let a = load(POSED, fans[triangle]);
        let b = load(POSED, fans[triangle + 1u]);
        let c = load(POSED, fans[triangle + 2u]);
        sum += cross(b - a, c - a);
    }
    let doubled_area = length(sum);
    store(NORMALS, index, select(vec3f(), sum / doubled_area, doubled_area > 0.0));
}
