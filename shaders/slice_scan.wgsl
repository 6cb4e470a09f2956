// Vertical slices of the tile: the twin of src/visibility/scan.rs and slicer.rs, which say how and why. One thread walks for
// one facet along one azimuth.

//!import angles
//!import slice_entry

struct Params {
    tile_size: vec2f,
    cell_size: vec2f,
    cells: vec2i,
    top: f32,
    // See scan.rs.
    facing_margin: f32,
    azimuths: u32,
    facet_count: u32,
    // Cells and triangles that a walk looks at, at most.
    looks: u32,
    // A facet this near to a copy of its triangle lies on it.
    near: f32,
    // Of this dispatch.
    first_azimuth: u32,
    pad: u32,
}

struct Place {
    // Lifted off the facet.
    origin: vec3f,
    triangle: u32,
    normal: vec3f,
    pad: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// First entry of each cell, and the end of all.
@group(0) @binding(1) var<storage, read> starts: array<u32>;
// Those of a cell from the highest down.
@group(0) @binding(2) var<storage, read> entries: array<Entry>;
@group(0) @binding(3) var<storage, read> places: array<Place>;
// Unit vectors of the plane, one an azimuth.
@group(0) @binding(4) var<storage, read> directions: array<vec2f>;
// The azimuths of a facet side by side: horizons [rad], or what visibility_hanging.wgsl reads.
@group(0) @binding(5) var<storage, read_write> found: array<u32>;

// Whether what hangs above the horizon is told apart from it.
override HANGING: bool = false;
// Tests ask how many cells and triangles were looked at, and of these how many were cut (times 2²⁰), instead of what was seen.
override COUNTING: bool = false;

// Horizons::FREE and Horizons::BLOCKED.
const FREE: f32 = -0.02;
const BLOCKED: f32 = 1.59079632679490;
// Nothing below this slope is resolved, nor between this one and the vertical.
const LOWEST: f32 = 0.005;
const STEEPEST: f32 = 1e12;
const FAR: f32 = 1e30;
// Intervals that a walk tells apart, and those that are kept.
const MOST: u32 = 8u;
const KEPT: u32 = 4u;

// What is blocked: all below the ground, and intervals above it, sorted and disjoint.
var<private> ground: f32;
var<private> hanging: array<vec2f, MOST>;
var<private> count: u32;
var<private> cuts: u32;

// Facing surfaces share edges: a gap of rounding size is no gap.
fn reach(slope: f32) -> f32 {
    return slope + 1e-5 * (1.0 + slope * slope);
}

fn remove(first: u32, end: u32) {
    for (var k = end; k < count; k++) {
        hanging[first + k - end] = hanging[k];
    }
    count -= end - first;
}

fn insert(from_slope: f32, to_slope: f32) {
    var low = from_slope;
    var high = to_slope;
    if high <= ground {
        return;
    }
    if low <= reach(ground) {
        ground = high;
    } else {
        var first = 0u;
        while first < count && reach(hanging[first].y) < low {
            first++;
        }
        var end = first;
        while end < count && hanging[end].x <= reach(high) {
            low = min(low, hanging[end].x);
            high = max(high, hanging[end].y);
            end++;
        }
        if end > first {
            hanging[first] = vec2f(low, high);
            remove(first + 1u, end);
        } else if count < MOST {
            for (var k = count; k > first; k--) {
                hanging[k] = hanging[k - 1u];
            }
            hanging[first] = vec2f(low, high);
            count++;
        } else if first < count {
            hanging[first].x = low;
        } else {
            hanging[count - 1u].y = high;
        }
    }
    var absorbed = 0u;
    while absorbed < count && hanging[absorbed].x <= reach(ground) {
        ground = max(ground, hanging[absorbed].y);
        absorbed++;
    }
    remove(0u, absorbed);
}

// The cross product of the plane.
fn across(along: vec2f, p: vec2f) -> f32 {
    return along.x * p.y - along.y * p.x;
}


// Where an edge crosses the slice: how far ahead, and how high above the eye. It is given from the corner that comes first, so
// that neighbours agree about the edge they share.
fn crossing(from_corner: vec3f, to_corner: vec3f, eye: vec3f) -> vec2f {
    let width = to_corner.x - from_corner.x;
    let part = select(0.0, 1.0 / width, width > 0.0);
    return from_corner.yz + (eye.x - from_corner.x) * ((to_corner.yz - from_corner.yz) * part) - eye.yz;
}

// The slopes that an entry covers whose corners lie so far across the slice, on both sides of the eye; none, the second below
// the first, where the slice meets it behind.
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
    // Where a segment begins behind the point, it passes above or below: at distance 0 its slope is infinite.
    let turn = q.y * p.x - p.y * q.x;
    var slopes = vec2f(select(-STEEPEST, STEEPEST, turn < 0.0), select(-STEEPEST, STEEPEST, turn > 0.0));
    if p.x > 0.0 {
        slopes.x = p.y / p.x;
    }
    if q.x > 0.0 {
        slopes.y = q.y / q.x;
    }
    slopes = clamp(slopes, vec2f(0.0), vec2f(STEEPEST));
    return vec2f(min(slopes.x, slopes.y), max(slopes.x, slopes.y));
}

// Is this copy of a facet's triangle the one it lies on? Other copies block it like any other surface.
fn lies_on(origin: vec3f, entry: Entry) -> bool {
    let a = vec3f(entry.a, entry.heights.x);
    let normal = cross(vec3f(entry.b, entry.heights.y) - a, vec3f(entry.c, entry.heights.z) - a);
    // Its square may be too small a number.
    let largest = max(max(abs(normal.x), abs(normal.y)), abs(normal.z));
    let unit = normal / max(largest, 1e-38);
    return abs(dot(unit, origin - a)) <= length(unit) * params.near;
}

fn elevation(slope: f32) -> f32 {
    if slope <= 0.0 {
        return FREE;
    }
    return select(angle_of(slope, 1.0), BLOCKED, slope >= STEEPEST);
}

// In 65,535 steps, 0.000024 apart.
fn steps_of(slope: f32) -> u32 {
    return u32(clamp(elevation(slope) / BLOCKED, 0.0, 1.0) * 65535.0 + 0.5);
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

// Walks until nothing further can tell anything new; returns how much it looked at.
fn walk(place: Place, along: vec2f, overhead: f32) -> u32 {
    let origin = place.origin;
    let clearance = params.top - origin.z;
    if clearance <= 0.0 {
        return 0u;
    }
    let at = origin.xy / params.cell_size;
    let position = floor(at);
    let speed = along / params.cell_size;
    let steps = vec2i(sign(speed));
    let in_x = axis(at.x, speed.x, position.x);
    let in_y = axis(at.y, speed.y, position.y);
    var next = vec2f(in_x.x, in_y.x);
    let delta = vec2f(in_x.y, in_y.y);
    // Half a cell further in, where no rounding of the division matters.
    var tile = vec2i(floor((position + 0.5) / vec2f(params.cells)));
    var local = clamp(vec2i(position) - tile * params.cells, vec2i(0), params.cells - 1);
    // Along an axis all comes back after one tile, only further away: what did not rise above the ground never will.
    let period = 1.001 * min(
        select(FAR, params.tile_size.x, abs(along.y) < 1e-6),
        select(FAR, params.tile_size.y, abs(along.x) < 1e-6),
    );
    var entered = 0.0;
    var looks = 0u;
    while looks < params.looks {
        // What a cell at distance r can block at most: clearance / r.
        var open = min(clearance / max(entered, 1e-20), 1e20);
        if count > 0u && hanging[0].y >= open {
            open = min(hanging[0].x, open);
        }
        if open <= max(ground, LOWEST) || (entered > period && !(count > 0u && hanging[0].x < overhead)) {
            break;
        }
        looks++;
        let cell = u32(local.y * params.cells.x + local.x);
        let home = origin - vec3f(vec2f(tile) * params.tile_size, 0.0);
        let began = entered;
        // On to the next cell, of the next tile where this one ends.
        if next.x <= next.y {
            entered = next.x;
            next.x += delta.x;
            local.x += steps.x;
        } else {
            entered = next.y;
            next.y += delta.y;
            local.y += steps.y;
        }
        let over = vec2i(local == params.cells) - vec2i(local < vec2i(0));
        local -= over * params.cells;
        tile += over;

        let ceiling = origin.z + entered * open;
        let eye = vec3f(across(along, home.xy), dot(along, home.xy), home.z);
        for (var k = starts[cell]; k < starts[cell + 1u] && looks < params.looks; k++) {
            looks++;
            if entries[k].z_max <= origin.z + began * ground {
                break;
            }
            let a = across(along, entries[k].a);
            let b = across(along, entries[k].b);
            let c = across(along, entries[k].c);
            // What stands higher throughout blocks nothing in this cell that is still open.
            if min(min(a, b), c) >= eye.x || max(max(a, b), c) < eye.x || entries[k].z_min >= ceiling {
                continue;
            }
            cuts++;
            let slopes = cut(k, vec3f(a, b, c), along, eye);
            if slopes.y <= ground || (count > 0u && hanging[0].x <= slopes.x && slopes.y <= hanging[0].y) {
                continue;
            }
            if slopes.x <= slopes.y && (entries[k].triangle != place.triangle || !lies_on(home, entries[k])) {
                insert(slopes.x, slopes.y);
            }
        }
    }
    return looks;
}

@compute @workgroup_size(64)
fn scan(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.facet_count {
        return;
    }
    let place = places[id.x];
    let azimuth = params.first_azimuth + id.y;
    let along = directions[azimuth];
    // What a facet is turned away from: nothing else about it needs to be known.
    let ahead = dot(place.normal.xy, along) + params.facing_margin;
    count = 0u;
    cuts = 0u;
    ground = 0.0;
    var overhead = FAR;
    if ahead >= 0.0 {
        if place.normal.z < -1e-5 {
            overhead = ahead / -place.normal.z;
            hanging[0] = vec2f(overhead, STEEPEST);
            count = 1u;
        }
    } else if place.normal.z > 1e-5 {
        ground = min(-ahead / place.normal.z, STEEPEST);
    } else {
        ground = STEEPEST;
    }
    var looks = 0u;
    if ground < STEEPEST {
        looks = walk(place, along, overhead);
    }
    let slice = id.x * params.azimuths + azimuth;
    if COUNTING {
        found[slice] = min(looks, 0xfffffu) | (min(cuts, 0xfffu) << 20u);
        return;
    }
    if !HANGING {
        var highest = ground;
        if count > 0u {
            highest = hanging[count - 1u].y;
        }
        found[slice] = bitcast<u32>(elevation(highest));
        return;
    }
    let first = slice * (1u + KEPT);
    found[first] = bitcast<u32>(elevation(ground));
    // Of more than are kept the last reaches up to the highest.
    for (var k = 0u; k < KEPT; k++) {
        var steps = 0u;
        if k < count && hanging[k].x < overhead {
            var end = k;
            while k + 1u == KEPT && end + 1u < count && hanging[end + 1u].x < overhead {
                end++;
            }
            steps = steps_of(hanging[k].x) | (max(steps_of(hanging[end].y), 1u) << 16u);
        }
        found[first + 1u + k] = steps;
    }
}
