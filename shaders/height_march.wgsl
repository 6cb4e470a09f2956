// Horizons of a height-field: the twin of src/visibility/height_march.rs, which says how and why. One thread walks for one
// facet along one azimuth.

//!import angles

struct Params {
    // Columns and rows of the tile.
    size: vec2u,
    samples_from_tile: vec2f,
    top: f32,
    azimuths: u32,
    facet_count: u32,
    // See scan.rs.
    facing_margin: f32,
    // Of this dispatch.
    first_azimuth: u32,
    pad: u32,
}

struct Place {
    position: vec3f,
    pad_p: u32,
    normal: vec3f,
    pad_n: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> heights: array<f32>;
@group(0) @binding(2) var<storage, read> places: array<Place>;
// Elevations [rad], the azimuths of a facet side by side.
@group(0) @binding(3) var<storage, read_write> horizons: array<f32>;
// Unit vectors of the plane, one an azimuth.
@group(0) @binding(4) var<storage, read> directions: array<vec2f>;

// A horizon so low that the soft step never reaches above 0: Horizons::FREE.
const FREE: f32 = -0.02;
// Edges of one family that a walk crosses at most, besides those of sixteen tiles.
const LEAST_LINES: u32 = 8192u;
// Nothing below this slope is resolved.
const LOWEST: f32 = 0.005;

// Tests ask how many edges were crossed, instead of what was seen.
override COUNTING: bool = false;

const COLUMNS: u32 = 0u;
const ROWS: u32 = 1u;
const DIAGONALS: u32 = 2u;

fn wrapped(k: f32, n: u32) -> u32 {
    let rest = k - f32(n) * floor((k + 0.5) / f32(n));
    return min(u32(max(rest, 0.0)), n - 1u);
}

fn height_at(column: f32, row: f32) -> f32 {
    return heights[wrapped(row, params.size.y) * params.size.x + wrapped(column, params.size.x)];
}

var<private> crossings: u32;

// The highest slope, `slope` at least, at the crossings of one family of edges at increasing distance. `across` and `along`:
// where the walk begins and how it goes on, across the edges and along them.
fn crossed(edges: u32, across: vec2f, along: vec2f, most: u32, z: f32, least: f32) -> f32 {
    var slope = least;
    let step = 1.0 / abs(across.y);
    let turn = sign(across.y);
    var first = select(ceil(across.x) - 1.0, floor(across.x) + 1.0, across.y > 0.0);
    // At its own edge a point sees itself.
    if (first - across.x) * turn < 1e-6 {
        first += turn;
    }
    let begin = (first - across.x) * turn * step;
    for (var k = 0u; k < most; k++) {
        let distance = begin + step * f32(k);
        if distance * max(slope, LOWEST) >= params.top - z {
            break;
        }
        crossings++;
        let line = first + turn * f32(k);
        let place = along.x + along.y * distance;
        let low = floor(place);
        var column = line;
        var row = low;
        var next = vec2f(0.0, 1.0);
        if edges == ROWS {
            column = low;
            row = line;
            next = vec2f(1.0, 0.0);
        } else if edges == DIAGONALS {
            column = low;
            row = low - line;
            next = vec2f(1.0, 1.0);
        }
        let below = height_at(column, row);
        let above = height_at(column + next.x, row + next.y);
        slope = max(slope, (below + (above - below) * (place - low) - z) / distance);
    }
    return slope;
}

@compute @workgroup_size(64)
fn march(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.facet_count {
        return;
    }
    crossings = 0u;
    let azimuth = params.first_azimuth + id.y;
    let direction = directions[azimuth];
    let start = places[id.x].position;
    let normal = places[id.x].normal;
    var slope = max(-(dot(normal.xy, direction) + params.facing_margin) / max(normal.z, 1e-6), 0.0);
    if params.top > start.z {
        let at = start.xy * params.samples_from_tile - 0.5;
        let speed = direction * params.samples_from_tile;
        let along_x = abs(direction.y) < 1e-6;
        let along_y = abs(direction.x) < 1e-6;
        // Along an axis all comes back after one tile, only further away.
        var most = LEAST_LINES + 16u * (params.size.x + params.size.y);
        if along_x {
            most = params.size.x + 1u;
        } else if along_y {
            most = params.size.y + 1u;
        }
        let x = vec2f(at.x, speed.x);
        let y = vec2f(at.y, speed.y);
        if !along_y {
            slope = crossed(COLUMNS, x, y, most, start.z, slope);
        }
        if !along_x {
            slope = crossed(ROWS, y, x, most, start.z, slope);
        }
        let turning = speed.x - speed.y;
        if abs(turning) >= 1e-6 * max(params.samples_from_tile.x, params.samples_from_tile.y) {
            slope = crossed(DIAGONALS, vec2f(at.x - at.y, turning), x, most, start.z, slope);
        }
    }
    if COUNTING {
        horizons[id.x * params.azimuths + azimuth] = f32(crossings);
        return;
    }
    horizons[id.x * params.azimuths + azimuth] = select(FREE, angle_of(slope, 1.0), slope > 0.0);
}
