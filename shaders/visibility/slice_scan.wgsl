// Computes horizons and overhangs along vertical slices of the tiling: the twin of src/visibility/scan.rs and
// slicer.rs, which describe the algorithm. One thread walks from one facet along one azimuth.

//!import slice_entry

struct Params {
    tile_size: vec2f,
    cell_size: vec2f,
    cells: vec2i,
    top: f32,
    // FACING_MARGIN of src/visibility/scan.rs.
    facing_margin: f32,
    azimuths: u32,
    facet_count: u32,
    // The step limit of a walk; a step visits one cell or triangle.
    max_steps: u32,
    // A facet lies on a copy of its triangle if their distance is at most this.
    near: f32,
    // The first azimuth of this dispatch.
    first_azimuth: u32,
    pad: u32,
}

struct Facet {
    // Lifted off the facet.
    origin: vec3f,
    triangle: u32,
    normal: vec3f,
    pad: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// First entry of each cell, and the end of all.
@group(0) @binding(1) var<storage, read> starts: array<u32>;
// The entries of a cell, highest first.
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read> facets: array<Facet>;
// Unit vectors of the plane, one per azimuth.
@group(0) @binding(4) var<storage, read> directions: array<vec2f>;
// Output: slopes of horizons, or the input of visibility_packed_intervals.wgsl. The azimuths of a facet are adjacent.
@group(0) @binding(5) var<storage, read_write> output: array<u32>;

// True if overhangs are stored apart from the horizon.
override OVERHANGS: bool = false;

// HorizonMap::FREE and HorizonMap::BLOCKED.
const FREE: f32 = -0.020002667;
const BLOCKED: f32 = 1e9;
// The lowest slope that is resolved, as in src/visibility/mod.rs, and the highest below the vertical.
const MIN_SLOPE: f32 = 0.005;
const MAX_SLOPE: f32 = 1e12;
const FAR: f32 = 1e30;
// Overhangs that a walk distinguishes, and overhangs that a slice stores.
const MAX_OVERHANGS: u32 = 8u;
const STORED_OVERHANGS: u32 = 4u;

// The blocked slopes: everything below `ground`, and the intervals `overhangs` above it, sorted and disjoint.
var<private> ground: f32;
var<private> overhangs: array<vec2f, MAX_OVERHANGS>;
var<private> count: u32;

// The slope up to which an interval that begins there joins this one: surfaces share edges up to rounding.
fn joining_slope(slope: f32) -> f32 {
    return slope + 1e-5 * (1.0 + slope * slope);
}

fn remove(first: u32, end: u32) {
    for (var k = end; k < count; k++) {
        overhangs[first + k - end] = overhangs[k];
    }
    count -= end - first;
}

fn insert(from_slope: f32, to_slope: f32) {
    var low = from_slope;
    var high = to_slope;
    if high <= ground {
        return;
    }
    if low <= joining_slope(ground) {
        ground = high;
    } else {
        var first = 0u;
        while first < count && joining_slope(overhangs[first].y) < low {
            first++;
        }
        var end = first;
        while end < count && overhangs[end].x <= joining_slope(high) {
            low = min(low, overhangs[end].x);
            high = max(high, overhangs[end].y);
            end++;
        }
        if end > first {
            overhangs[first] = vec2f(low, high);
            remove(first + 1u, end);
        } else if count < MAX_OVERHANGS {
            for (var k = count; k > first; k--) {
                overhangs[k] = overhangs[k - 1u];
            }
            overhangs[first] = vec2f(low, high);
            count++;
        } else if first < count {
            overhangs[first].x = low;
        } else {
            overhangs[count - 1u].y = high;
        }
    }
    var absorbed = 0u;
    while absorbed < count && overhangs[absorbed].x <= joining_slope(ground) {
        ground = max(ground, overhangs[absorbed].y);
        absorbed++;
    }
    remove(0u, absorbed);
}

// The cross product in the plane.
fn across(along: vec2f, p: vec2f) -> f32 {
    return along.x * p.y - along.y * p.x;
}

// The crossing of an edge and the slice: distance ahead of the eye, and height above it. Interpolation starts at the
// corner that comes first, so that neighbouring triangles agree on their shared edge.
fn crossing(from_corner: vec3f, to_corner: vec3f, eye: vec3f) -> vec2f {
    let width = to_corner.x - from_corner.x;
    let part = select(0.0, 1.0 / width, width > 0.0);
    return from_corner.yz + (eye.x - from_corner.x) * ((to_corner.yz - from_corner.yz) * part) - eye.yz;
}

// The range of slopes that an entry covers. `distances` are those of its corners across the slice, on both sides of it.
// The range is empty, with the second slope below the first, if the entry lies behind the eye.
fn cut(k: u32, distances: vec3f, along: vec2f, eye: vec3f) -> vec2f {
    let heights = entries[k].heights;
    var first = vec3f(distances.x, dot(along, entries[k].a), heights.x);
    var middle = vec3f(distances.y, dot(along, entries[k].b), heights.y);
    var last = vec3f(distances.z, dot(along, entries[k].c), heights.z);
    if middle.x < first.x {
        let other = first;
        first = middle;
        middle = other;
    }
    if last.x < middle.x {
        let other = middle;
        middle = last;
        last = other;
    }
    if middle.x < first.x {
        let other = first;
        first = middle;
        middle = other;
    }
    let none = vec2f(1.0, -1.0);
    let p = crossing(first, last, eye);
    var q: vec2f;
    if middle.x < eye.x {
        q = crossing(middle, last, eye);
    } else {
        q = crossing(first, middle, eye);
    }
    if p.x <= 0.0 && q.x <= 0.0 {
        return none;
    }
    // A segment that begins behind the eye passes above or below it, and its slope at distance 0 is infinite.
    let side = q.y * p.x - p.y * q.x;
    var slopes = vec2f(select(-MAX_SLOPE, MAX_SLOPE, side < 0.0), select(-MAX_SLOPE, MAX_SLOPE, side > 0.0));
    if p.x > 0.0 {
        slopes.x = p.y / p.x;
    }
    if q.x > 0.0 {
        slopes.y = q.y / q.x;
    }
    slopes = clamp(slopes, vec2f(0.0), vec2f(MAX_SLOPE));
    return vec2f(min(slopes.x, slopes.y), max(slopes.x, slopes.y));
}

// Returns true if the facet lies on this copy of its triangle. Other copies block it as any other surface does.
fn lies_on(origin: vec3f, entry: Entry) -> bool {
    let a = vec3f(entry.a, entry.heights.x);
    let normal = cross(vec3f(entry.b, entry.heights.y) - a, vec3f(entry.c, entry.heights.z) - a);
    // Scaled first, because the square of the normal may underflow.
    let largest = max(max(abs(normal.x), abs(normal.y)), abs(normal.z));
    let unit = normal / max(largest, 1e-38);
    return abs(dot(unit, origin - a)) <= length(unit) * params.near;
}

fn horizon(slope: f32) -> f32 {
    return select(FREE, min(slope, BLOCKED), slope > 0.0);
}

// A slope s as s/(1 + s), in 65,535ths. Neighbouring values are at most 0.000031 rad of elevation apart.
fn quantized(slope: f32) -> u32 {
    return u32(65535.0 * (slope / (1.0 + slope)) + 0.5);
}

fn axis(at: f32, speed: f32, cell: f32) -> vec2f {
    if speed > 0.0 {
        return vec2f((cell + 1.0 - at) / speed, 1.0 / speed);
    }
    if speed < 0.0 {
        return vec2f((at - cell) / -speed, -1.0 / speed);
    }
    return vec2f(FAR);
}

// Walks until nothing further can change the result.
fn walk(facet: Facet, along: vec2f, overhead: f32) {
    let origin = facet.origin;
    let clearance = params.top - origin.z;
    if clearance <= 0.0 {
        return;
    }
    let at = origin.xy / params.cell_size;
    let position = floor(at);
    let speed = along / params.cell_size;
    let cell_steps = vec2i(sign(speed));
    let in_x = axis(at.x, speed.x, position.x);
    let in_y = axis(at.y, speed.y, position.y);
    var next = vec2f(in_x.x, in_y.x);
    let delta = vec2f(in_x.y, in_y.y);
    // The centre of the cell, so that rounding of the division does not matter.
    var tile = vec2i(floor((position + 0.5) / vec2f(params.cells)));
    var local = clamp(vec2i(position) - tile * params.cells, vec2i(0), params.cells - 1);
    // Along axes and diagonals everything repeats after one period, as in PeriodicGrid::period_along.
    let tiles_per_length = abs(along / params.tile_size);
    let fewer = min(tiles_per_length.x, tiles_per_length.y);
    let more = max(tiles_per_length.x, tiles_per_length.y);
    let period = select(FAR, 1.001 / more, fewer < 1e-6 * more || more - fewer < 1e-6 * more);
    var period_end = period;
    var lowest_before = -1.0;
    var entered = 0.0;
    var step_count = 0u;
    while step_count < params.max_steps {
        // The highest slope that a cell at distance r can block: clearance / r.
        var open = min(clearance / max(entered, 1e-20), 1e20);
        if count > 0u && overhangs[0].y >= open {
            open = min(overhangs[0].x, open);
        }
        if open <= max(ground, MIN_SLOPE) {
            insert(0.0, open);
            break;
        }
        // The same surface returns after each period, farther away, and cannot rise above the ground.
        if entered > period_end {
            if count == 0u || overhangs[0].x >= overhead {
                break;
            }
            // If the copies of one period lower the interval without a gap, all farther ones do: they follow each other
            // at smaller relative distances.
            let lowest = overhangs[0];
            if open == lowest.x && lowest.x < lowest_before && lowest_before <= lowest.y {
                insert(0.0, lowest.x);
                break;
            }
            period_end += period;
            lowest_before = lowest.x;
        }
        step_count++;
        let cell = u32(local.y * params.cells.x + local.x);
        let home = origin - vec3f(vec2f(tile) * params.tile_size, 0.0);
        let began = entered;
        // Steps to the next cell, in the next tile if this tile ends.
        if next.x <= next.y {
            entered = next.x;
            next.x += delta.x;
            local.x += cell_steps.x;
        } else {
            entered = next.y;
            next.y += delta.y;
            local.y += cell_steps.y;
        }
        let over = vec2i(local == params.cells) - vec2i(local < vec2i(0));
        local -= over * params.cells;
        tile += over;

        let ceiling = origin.z + entered * open;
        let eye = vec3f(across(along, home.xy), dot(along, home.xy), home.z);
        for (var k = starts[cell]; k < starts[cell + 1u] && step_count < params.max_steps; k++) {
            step_count++;
            if entries[k].z_max <= origin.z + began * ground {
                break;
            }
            let a = across(along, entries[k].a);
            let b = across(along, entries[k].b);
            let c = across(along, entries[k].c);
            // An entry that lies entirely above the ceiling blocks no open slope in this cell.
            if min(min(a, b), c) >= eye.x || max(max(a, b), c) < eye.x || entries[k].z_min >= ceiling {
                continue;
            }
            let slopes = cut(k, vec3f(a, b, c), along, eye);
            if slopes.y <= ground || (count > 0u && overhangs[0].x <= slopes.x && slopes.y <= overhangs[0].y) {
                continue;
            }
            if slopes.x <= slopes.y && (entries[k].triangle != facet.triangle || !lies_on(home, entries[k])) {
                insert(slopes.x, slopes.y);
            }
        }
    }
}

@compute @workgroup_size(64)
fn scan(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.facet_count {
        return;
    }
    let facet = facets[id.x];
    let azimuth = params.first_azimuth + id.y;
    let along = directions[azimuth];
    // The slopes behind the facet count as blocked from the start.
    let ahead = dot(facet.normal.xy, along) + params.facing_margin;
    count = 0u;
    ground = 0.0;
    var overhead = FAR;
    if ahead >= 0.0 {
        if facet.normal.z < -1e-5 {
            overhead = ahead / -facet.normal.z;
            overhangs[0] = vec2f(overhead, MAX_SLOPE);
            count = 1u;
        }
    } else if facet.normal.z > 1e-5 {
        ground = min(-ahead / facet.normal.z, MAX_SLOPE);
    } else {
        ground = MAX_SLOPE;
    }
    if ground < MAX_SLOPE {
        walk(facet, along, overhead);
    }
    let slice = id.x * params.azimuths + azimuth;
    if !OVERHANGS {
        var highest = ground;
        if count > 0u {
            highest = overhangs[count - 1u].y;
        }
        output[slice] = bitcast<u32>(horizon(highest));
        return;
    }
    let first = slice * (1u + STORED_OVERHANGS);
    output[first] = bitcast<u32>(horizon(ground));
    // If there are more overhangs than are stored, the last stored one extends to the highest.
    for (var k = 0u; k < STORED_OVERHANGS; k++) {
        var packed = 0u;
        if k < count && overhangs[k].x < overhead {
            var end = k;
            while k + 1u == STORED_OVERHANGS && end + 1u < count && overhangs[end + 1u].x < overhead {
                end++;
            }
            packed = quantized(overhangs[k].x) | (max(quantized(overhangs[end].y), 1u) << 16u);
        }
        output[first + 1u + k] = packed;
    }
}
