// A mesh under two lights that move with the camera (the twin of pictures/shade.rs), and the floor.
// The target holds sRGB-encoded bytes: colours are encoded here, at the end.

struct Scene {
    clip_from_world: mat4x4<f32>,
    // Rotation only: directions into camera space (x right, y down, z forward).
    camera_from_world: mat4x4<f32>,
    camera_in_world: vec4<f32>,
    // Linear; used where a vertex brings no colour of its own.
    albedo: vec4<f32>,
    key_towards: vec4<f32>,
    key_strength: vec4<f32>,
    fill_towards: vec4<f32>,
    fill_strength: vec4<f32>,
    ground: vec4<f32>,
    sky: vec4<f32>,
    // x: rim, y: wrap, z: half the floor's width in metres, w: shadow.
    amounts: vec4<f32>,
    // xyz: where the person stands.
    stand: vec4<f32>,
    line: vec4<f32>,
    background: vec4<f32>,
}

@group(0) @binding(0) var<uniform> scene: Scene;

struct MeshVertex {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) color: vec4<f32>,
}

struct MeshPixel {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) albedo: vec3<f32>,
}

fn linear_from_srgb(c: vec3<f32>) -> vec3<f32> {
    return select(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, c <= vec3(0.04045));
}

fn srgb_from_linear(light: vec3<f32>) -> vec3<f32> {
    let c = clamp(light, vec3(0.0), vec3(1.0));
    return select(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, c * 12.92, c <= vec3(0.0031308));
}

@vertex
fn mesh_vertex(vertex: MeshVertex) -> MeshPixel {
    var out: MeshPixel;
    out.clip = scene.clip_from_world * vec4(vertex.position, 1.0);
    out.position = vertex.position;
    out.normal = vertex.normal;
    out.albedo = select(scene.albedo.rgb, linear_from_srgb(vertex.color.rgb), vertex.color.a > 0.5);
    return out;
}

@fragment
fn mesh_fragment(pixel: MeshPixel) -> @location(0) vec4<f32> {
    let away_in_world = normalize(pixel.position - scene.camera_in_world.xyz);
    let flat_normal = cross(dpdy(pixel.position), dpdx(pixel.position));
    var normal_in_world = pixel.normal;
    if dot(normal_in_world, normal_in_world) < 0.01 {
        normal_in_world = flat_normal;
    }
    normal_in_world = normalize(normal_in_world);
    let normal = (scene.camera_from_world * vec4(normal_in_world, 0.0)).xyz;
    let away = (scene.camera_from_world * vec4(away_in_world, 0.0)).xyz;
    let wrap = scene.amounts.y;
    let key = max((dot(normal, scene.key_towards.xyz) + wrap) / (1.0 + wrap), 0.0);
    let fill = max(dot(normal, scene.fill_towards.xyz), 0.0);
    let up = 0.5 - 0.5 * normal.y;
    let grazing = clamp(1.0 + dot(normal, away), 0.0, 1.0);
    let light = scene.key_strength.rgb * key + scene.fill_strength.rgb * fill
        + mix(scene.ground.rgb, scene.sky.rgb, up) + vec3(scene.amounts.x * pow(grazing, 4.0));
    return vec4(srgb_from_linear(light * pixel.albedo), 1.0);
}

struct FloorPixel {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec2<f32>,
}

@vertex
fn floor_vertex(@builtin(vertex_index) index: u32) -> FloorPixel {
    let corner = vec2(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0;
    var out: FloorPixel;
    out.place = scene.stand.xz + corner * scene.amounts.z;
    out.clip = scene.clip_from_world * vec4(out.place.x, 0.0, out.place.y, 1.0);
    return out;
}

@fragment
fn floor_fragment(pixel: FloorPixel) -> @location(0) vec4<f32> {
    let distance = length(pixel.place - scene.stand.xz);
    let fade = 1.0 - smoothstep(0.2, 1.0, distance / scene.amounts.z);
    // Lines of one pixel, every half metre.
    let cell = pixel.place * 2.0;
    let to_line = abs(fract(cell - 0.5) - 0.5) / fwidth(cell);
    let line = 1.0 - min(min(to_line.x, to_line.y), 1.0);
    // A pool of light, and the person's shadow in it.
    let pool = 0.5 * exp(-0.5 * distance * distance);
    let shadow = 0.75 * scene.amounts.w * exp(-distance * distance / 0.09);
    var color = mix(scene.background.rgb, scene.line.rgb, (0.8 * line + pool) * fade);
    color = mix(color, scene.background.rgb * 0.35, shadow);
    return vec4(color, 1.0);
}
