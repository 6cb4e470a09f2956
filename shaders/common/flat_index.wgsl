// A thread index over both axes of a dispatch, for more threads than one axis holds.

const THREADS: u32 = 64u;

fn flat_index(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * THREADS + id.x;
}
