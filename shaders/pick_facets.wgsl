// Picks facets for the sums about each half vector: the twin of Direct::about (src/filtering/sampled.rs), which says how and
// why. A workgroup a half vector.

//!import table_pairs
//!import table_picks
//!import two_lobes
//!import facets
//!import together

@group(0) @binding(2) var<storage, read_write> picks: array<Pick>;

// See sampled.rs.
const EVENLY: f32 = 0.25;
const CERTAIN: f32 = 65536.0;
const ROUNDS: u32 = 2u;
// What reflects less is black: its inverse might be no number.
const DARKEST: f32 = 1e-36;

var<workgroup> steps: array<u32, THREADS>;

// What those before a thread and the thread itself hold. All must call it.
fn up_to(thread: u32, step: u32) -> u32 {
    steps[thread] = step;
    workgroupBarrier();
    for (var reach = 1u; reach < THREADS; reach *= 2u) {
        var before = 0u;
        if thread >= reach {
            before = steps[thread - reach];
        }
        workgroupBarrier();
        steps[thread] += before;
        workgroupBarrier();
    }
    return steps[thread];
}

// What a facet reflects of light that comes and goes along h, by both lobes.
fn reflected(s: u32, along_h: Pair) -> vec2f {
    let seen = see(facets[s].xyz, along_h);
    if !is_lit(seen) {
        return vec2f(0.0);
    }
    return facets[s].w * two_lobes(seen, 1.0);
}

@compute @workgroup_size(THREADS)
fn pick(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) thread: u32) {
    let azimuth = workgroup.x % nodes.pairs.y;
    if angles[azimuth].image != azimuth {
        return;
    }
    let h = pair_at(workgroup.x / nodes.pairs.y, angles[azimuth], angles[nodes.pairs.y], 0u).h;
    let along_h = Pair(h, h, h, 1.0);
    let count = f32(sum.end - sum.first);
    var reflects = vec2f(0.0);
    for (var s = sum.first + thread; s < sum.end; s += THREADS) {
        reflects += reflected(s, along_h);
    }
    let whole = together(thread, reflects);
    let lobes = select(vec2f(0.5), vec2f(1.0, 0.0), SECOND == 0u) * (1.0 - EVENLY);
    // A black lobe asks for none more than for another.
    let is_bright = whole > vec2f(DARKEST);
    let per_lobe = select(vec2f(0.0), lobes / whole, is_bright);
    let even = (EVENLY + dot(lobes, select(vec2f(1.0), vec2f(0.0), is_bright))) / count;
    var scale = nodes.picked;
    for (var round = 0u; round < ROUNDS; round++) {
        var expected = 0.0;
        for (var s = sum.first + thread; s < sum.end; s += THREADS) {
            expected += min(scale * (even + dot(per_lobe, reflected(s, along_h))), 1.0);
        }
        scale *= nodes.picked / max(together(thread, vec2f(expected)).x, 1e-9);
    }
    let row = workgroup.x * nodes.room;
    var walked = u32(0.5 * CERTAIN);
    for (var start = sum.first; start < sum.end; start += THREADS) {
        let s = start + thread;
        var chance = 0u;
        if s < sum.end {
            let share = even + dot(per_lobe, reflected(s, along_h));
            chance = u32(clamp(scale * share * CERTAIN + 0.5, 1.0, CERTAIN));
        }
        let after = walked + up_to(thread, chance);
        let place = after / u32(CERTAIN);
        if place > (after - chance) / u32(CERTAIN) && place < nodes.room {
            picks[row + place] = Pick(s, CERTAIN / f32(chance));
        }
        walked += steps[THREADS - 1u];
        workgroupBarrier();
    }
    if thread == 0u {
        picks[row] = Pick(min(walked / u32(CERTAIN), nodes.room - 1u), 0.0);
    }
}
