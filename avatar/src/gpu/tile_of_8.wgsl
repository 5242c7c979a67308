// One number for each of eight points: what fits where the field is too wide for sixteen.

const TILE = 8u;
alias Tile = mat2x4f;

fn filled(value: f32) -> Tile {
    let column = vec4f(value);
    return Tile(column, column);
}

fn products_with_points(weight: vec4f) -> Tile {
    return Tile(products_with_four(weight, 0u), products_with_four(weight, 4u));
}

fn sines(angles_rad: Tile) -> Tile {
    return Tile(sine(angles_rad[0]), sine(angles_rad[1]));
}

fn cosines(angles_rad: Tile) -> Tile {
    return Tile(cosine(angles_rad[0]), cosine(angles_rad[1]));
}

fn times(a: Tile, b: Tile) -> Tile {
    return Tile(a[0] * b[0], a[1] * b[1]);
}
