// Computes the horizons of a height field: the twin of src/visibility/height_march.rs, which describes the algorithm.
// One thread walks from one facet along one azimuth.

struct Params {
    // Columns and rows of the tile.
    size: vec2u,
    samples_from_tile: vec2f,
    top: f32,
    azimuths: u32,
    facet_count: u32,
    // FACING_MARGIN of src/visibility/scan.rs.
    facing_margin: f32,
    // The first azimuth of this dispatch.
    first_azimuth: u32,
    pad: u32,
}

struct Facet {
    position: vec3f,
    pad_p: u32,
    normal: vec3f,
    pad_n: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> heights: array<f32>;
@group(0) @binding(2) var<storage, read> facets: array<Facet>;
// Slopes; the azimuths of a facet are adjacent.
@group(0) @binding(3) var<storage, read_write> horizons: array<f32>;
// Unit vectors of the plane, one per azimuth.
@group(0) @binding(4) var<storage, read> directions: array<vec2f>;

// HorizonMap::FREE and HorizonMap::BLOCKED.
const FREE: f32 = -0.020002667;
const BLOCKED: f32 = 1e9;
// The number of edges of one family that a walk may cross, in addition to those of sixteen tiles.
const MIN_LINES: u32 = 8192u;
// The smallest slope that is resolved, as in src/visibility/mod.rs.
const MIN_SLOPE: f32 = 0.005;

const COLUMNS: u32 = 0u;
const ROWS: u32 = 1u;

fn wrapped(k: f32, n: u32) -> u32 {
    let rest = k - f32(n) * floor((k + 0.5) / f32(n));
    return min(u32(max(rest, 0.0)), n - 1u);
}

fn height_at(column: f32, row: f32) -> f32 {
    return heights[wrapped(row, params.size.y) * params.size.x + wrapped(column, params.size.x)];
}

// A walk over one family of edges: the start and the speed across the edges and along them, the largest number of
// crossings, and the smallest slope that is resolved.
struct Walk {
    across: vec2f,
    along: vec2f,
    max_crossings: u32,
    min_slope: f32,
}

// The highest slope at the crossings of one family of edges, and at least `known`.
fn highest_slope(edges: u32, walk: Walk, z: f32, known: f32) -> f32 {
    let across = walk.across;
    let along = walk.along;
    let min_slope = walk.min_slope;
    var slope = known;
    let step = 1.0 / abs(across.y);
    let sign_across = sign(across.y);
    var first = select(ceil(across.x) - 1.0, floor(across.x) + 1.0, across.y > 0.0);
    // A point on an edge does not block itself.
    if (first - across.x) * sign_across < 1e-6 {
        first += sign_across;
    }
    let begin = (first - across.x) * sign_across * step;
    for (var k = 0u; k < walk.max_crossings; k++) {
        let distance = begin + step * f32(k);
        let highest = (params.top - z) / distance;
        if highest <= slope {
            break;
        }
        if highest <= min_slope {
            return max(slope, min(min_slope, (params.top - z) / begin));
        }
        let line = first + sign_across * f32(k);
        let position = along.x + along.y * distance;
        let low = floor(position);
        var column = line;
        var row = low;
        var next = vec2f(0.0, 1.0);
        if edges == ROWS {
            column = low;
            row = line;
            next = vec2f(1.0, 0.0);
        }
        let below = height_at(column, row);
        let above = height_at(column + next.x, row + next.y);
        slope = max(slope, (below + (above - below) * (position - low) - z) / distance);
    }
    return slope;
}

@compute @workgroup_size(64)
fn march(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.facet_count {
        return;
    }
    let azimuth = params.first_azimuth + id.y;
    let direction = directions[azimuth];
    let start = facets[id.x].position;
    let normal = facets[id.x].normal;
    var slope = max(-(dot(normal.xy, direction) + params.facing_margin) / max(normal.z, 1e-6), 0.0);
    if params.top > start.z {
        let at = start.xy * params.samples_from_tile - 0.5;
        let speed = direction * params.samples_from_tile;
        let along_x = abs(direction.y) < 1e-6;
        let along_y = abs(direction.x) < 1e-6;
        // Along an axis, everything repeats after one tile, at a larger distance, so that the walk is exact.
        var max_crossings = MIN_LINES + 16u * (params.size.x + params.size.y);
        if along_x {
            max_crossings = params.size.x + 1u;
        } else if along_y {
            max_crossings = params.size.y + 1u;
        }
        let min_slope = select(MIN_SLOPE, 0.0, along_x || along_y);
        let x = vec2f(at.x, speed.x);
        let y = vec2f(at.y, speed.y);
        if !along_y {
            slope = highest_slope(COLUMNS, Walk(x, y, max_crossings, min_slope), start.z, slope);
        }
        if !along_x {
            slope = highest_slope(ROWS, Walk(y, x, max_crossings, min_slope), start.z, slope);
        }
    }
    horizons[id.x * params.azimuths + azimuth] = select(FREE, min(slope, BLOCKED), slope > 0.0);
}
