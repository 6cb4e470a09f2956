// Draws the subset of facets for the sums of each half vector: the twin of
// src/effective/shading_table/sampled_facets.rs, which describes the method. One workgroup serves one half vector.

//!import table_pairs
//!import facet_subsets
//!import two_lobes
//!import facets
//!import workgroup_sum

@group(0) @binding(2) var<storage, read_write> subsets: array<SampledFacet>;

// As in sampled_facets.rs: the share of the probability that all facets get equally, the probability 1 as a whole
// number, and the rounds that scale the probabilities.
const UNIFORM_SHARE: f32 = 0.25;
const ONE: f32 = 65536.0;
const ROUNDS: u32 = 2u;
// A lobe that reflects less counts as black, because its inverse may overflow.
const MIN_REFLECTED: f32 = 1e-36;

var<workgroup> prefix_sums: array<u32, THREADS>;

// The sum over all threads up to this one. All threads of the workgroup must call it.
fn prefix_sum(thread: u32, value: u32) -> u32 {
    prefix_sums[thread] = value;
    workgroupBarrier();
    for (var stride = 1u; stride < THREADS; stride *= 2u) {
        var addend = 0u;
        if thread >= stride {
            addend = prefix_sums[thread - stride];
        }
        workgroupBarrier();
        prefix_sums[thread] += addend;
        workgroupBarrier();
    }
    return prefix_sums[thread];
}

// The light that a facet reflects along h from light along h, by both lobes.
fn reflected(s: u32, along_h: Pair) -> vec2f {
    let angles = lobe_angles(facets[s].xyz, along_h);
    if !is_lit(angles) {
        return vec2f(0.0);
    }
    return facets[s].w * two_lobes(angles, 1.0);
}

@compute @workgroup_size(THREADS)
fn draw(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) thread: u32) {
    let azimuth = workgroup.x % nodes.pairs.y;
    if grid_angles[azimuth].image != azimuth {
        return;
    }
    let h = pair_at(workgroup.x / nodes.pairs.y, grid_angles[azimuth], grid_angles[nodes.pairs.y], 0u).h;
    let along_h = Pair(h, h, h, 1.0);
    let count = f32(sum.end - sum.first);
    var reflected_sum = vec2f(0.0);
    for (var s = sum.first + thread; s < sum.end; s += THREADS) {
        reflected_sum += reflected(s, along_h);
    }
    let total = workgroup_sum(thread, reflected_sum);
    let lobes = select(vec2f(0.5), vec2f(1.0, 0.0), SECOND == 0u) * (1.0 - UNIFORM_SHARE);
    // A black lobe samples all facets equally.
    let is_bright = total > vec2f(MIN_REFLECTED);
    let per_lobe = select(vec2f(0.0), lobes / total, is_bright);
    let uniform_share = (UNIFORM_SHARE + dot(lobes, select(vec2f(1.0), vec2f(0.0), is_bright))) / count;
    var scale = nodes.subset_size;
    for (var round = 0u; round < ROUNDS; round++) {
        var expected = 0.0;
        for (var s = sum.first + thread; s < sum.end; s += THREADS) {
            expected += min(scale * (uniform_share + dot(per_lobe, reflected(s, along_h))), 1.0);
        }
        scale *= nodes.subset_size / max(workgroup_sum(thread, vec2f(expected)).x, 1e-9);
    }
    let row = workgroup.x * nodes.row_length;
    var sum_so_far = u32(0.5 * ONE);
    for (var start = sum.first; start < sum.end; start += THREADS) {
        let s = start + thread;
        var probability = 0u;
        if s < sum.end {
            let share = uniform_share + dot(per_lobe, reflected(s, along_h));
            probability = u32(clamp(scale * share * ONE + 0.5, 1.0, ONE));
        }
        let after = sum_so_far + prefix_sum(thread, probability);
        let slot = after / u32(ONE);
        if slot > (after - probability) / u32(ONE) && slot < nodes.row_length {
            subsets[row + slot] = SampledFacet(s, ONE / f32(probability));
        }
        sum_so_far += prefix_sums[THREADS - 1u];
        workgroupBarrier();
    }
    if thread == 0u {
        subsets[row] = SampledFacet(min(sum_so_far / u32(ONE), nodes.row_length - 1u), 0.0);
    }
}
