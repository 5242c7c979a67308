// A layer of the field for a tile of points: an invocation is a unit, HIDDEN in all, and has that unit's numbers of all
// points. All weights are read once for a tile, side by side. Whoever includes this binds `field`.

const OMEGA = 30.0;
const QUARTER = HIDDEN / 4u;

// One unit's outputs at all points of the tile.
var<workgroup> activations: array<Tile, HIDDEN>;
// With a fourth number: a one for the bias, as a rule.
var<workgroup> points: array<vec4f, TILE>;

// The unit's products with the tile's activations, by the weights of each four inputs for all units, which begin at `at`.
fn product(at: u32, unit: u32, start: Tile) -> Tile {
    var z = start;
    for (var k = 0u; k < QUARTER; k++) {
        let weight = field[at + k * HIDDEN + unit];
        z += weight.x * activations[4u * k];
        z += weight.y * activations[4u * k + 1u];
        z += weight.z * activations[4u * k + 2u];
        z += weight.w * activations[4u * k + 3u];
    }
    return z;
}

fn products_with_four(weight: vec4f, first: u32) -> vec4f {
    return vec4f(
        dot(weight, points[first]),
        dot(weight, points[first + 1u]),
        dot(weight, points[first + 2u]),
        dot(weight, points[first + 3u]),
    );
}
