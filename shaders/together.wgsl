// What the threads of a workgroup hold together.

//!import flat_index

var<workgroup> parts: array<vec2f, THREADS>;

// All must call it.
fn together(thread: u32, part: vec2f) -> vec2f {
    parts[thread] = part;
    workgroupBarrier();
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        if thread < half {
            parts[thread] += parts[thread + half];
        }
        workgroupBarrier();
    }
    let whole = parts[0];
    workgroupBarrier();
    return whole;
}
