// One number for each of sixteen points.

const TILE = 16u;
alias Tile = mat4x4f;

fn filled(value: f32) -> Tile {
    let column = vec4f(value);
    return Tile(column, column, column, column);
}

fn products_with_points(weight: vec4f) -> Tile {
    return Tile(
        products_with_four(weight, 0u),
        products_with_four(weight, 4u),
        products_with_four(weight, 8u),
        products_with_four(weight, 12u),
    );
}

fn sines(angles_rad: Tile) -> Tile {
    return Tile(
        sine(angles_rad[0]),
        sine(angles_rad[1]),
        sine(angles_rad[2]),
        sine(angles_rad[3]),
    );
}

fn cosines(angles_rad: Tile) -> Tile {
    return Tile(
        cosine(angles_rad[0]),
        cosine(angles_rad[1]),
        cosine(angles_rad[2]),
        cosine(angles_rad[3]),
    );
}

fn times(a: Tile, b: Tile) -> Tile {
    return Tile(a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]);
}
