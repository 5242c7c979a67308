// What all three kernels see; `layout.rs` has the same structures.

struct Pose {
    vertex_count: u32,
    // Of the field.
    layers: u32,
    steps: u32,
    // Unit lengths, as are all that no name says otherwise of.
    settled: f32,
    canonical_origin_m: vec3f,
    metres_per_unit: f32,
    trans_m: vec3f,
    longest: f32,
    // Rest to posed, three rows each.
    bones: array<vec4f, 72>,
}

struct Vertex {
    place: vec3f,
    slope: f32,
    normal: vec3f,
    // Four indices of a byte each.
    bones: u32,
    weights: vec4f,
    // Rows.
    rest_from_canonical: array<vec4f, 3>,
}

@group(0) @binding(0) var<uniform> pose: Pose;
@group(0) @binding(1) var<storage, read> field: array<vec4f>;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
// Canonical places, posed places, normals; three numbers a vertex.
@group(0) @binding(3) var<storage, read_write> result: array<f32>;
// Where each vertex's triangles begin (and one more), where each of them stands, then corners; all indices are of this array.
@group(0) @binding(4) var<storage, read> fans: array<u32>;

fn load(part: u32, vertex: u32) -> vec3f {
    let at = 3u * (part * pose.vertex_count + vertex);
    return vec3f(result[at], result[at + 1u], result[at + 2u]);
}

fn store(part: u32, vertex: u32, value: vec3f) {
    let at = 3u * (part * pose.vertex_count + vertex);
    result[at] = value.x;
    result[at + 1u] = value.y;
    result[at + 2u] = value.z;
}

const CANONICAL = 0u;
const POSED = 1u;
const NORMALS = 2u;
