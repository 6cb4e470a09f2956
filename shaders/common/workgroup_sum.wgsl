// The sum of the values of all threads of a workgroup.

//!import flat_index

var<workgroup> partial_sums: array<vec2f, THREADS>;

// All threads of the workgroup must call it.
fn workgroup_sum(thread: u32, part: vec2f) -> vec2f {
    partial_sums[thread] = part;
    workgroupBarrier();
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        if thread < half {
            partial_sums[thread] += partial_sums[thread + half];
        }
        workgroupBarrier();
    }
    let total = partial_sums[0];
    workgroupBarrier();
    return total;
}
