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
