// More threads than one axis of a dispatch holds, in order.

const THREADS: u32 = 64u;

fn flat_index(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * THREADS + id.x;
}
