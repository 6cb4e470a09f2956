// Normal clusters, and the horizon bounds outside of which their facets need no test.

//!import facets
//!import tint_row

struct Cluster {
    normal: vec3f,
    first: u32,
    end: u32,
    area: f32,
    // The sum of the weights of its facets.
    total_weight: vec3f,
    // The rows of its lobes.
    terms: u32,
    terms_end: u32,
}

struct Term {
    tint: Tint,
    // The number of lobe_by_number.wgsl, with shape and scale.
    lobe: u32,
    shape: f32,
    scale: f32,
}

// Three rows of each cluster, and one for each azimuth (horizon_bounds.wgsl); then three rows of each lobe.
@group(1) @binding(3) var<storage, read> clusters: array<vec4u>;

const HEAD: u32 = 3u;
const TERM: u32 = 3u;

fn first_row(cluster: u32) -> u32 {
    return cluster * (HEAD + sum.azimuths);
}

fn cluster_at(cluster: u32) -> Cluster {
    let row = first_row(cluster);
    let a = clusters[row];
    let b = clusters[row + 1u];
    let c = clusters[row + 2u];
    return Cluster(bitcast<vec3f>(a.xyz), a.w, b.x, bitcast<f32>(b.y), bitcast<vec3f>(c.xyz), b.z, b.w);
}

fn term_at(row: u32) -> Term {
    let a = clusters[row];
    let b = clusters[row + 1u];
    let c = clusters[row + 2u];
    let tint = Tint(bitcast<vec3f>(a.xyz), bitcast<f32>(a.w), bitcast<vec3f>(b.xyz), b.w);
    return Term(tint, c.x, bitcast<f32>(c.y), bitcast<f32>(c.z));
}

// The facets of a cluster that are visible along a direction.
const NONE_VISIBLE: u32 = 0u;
const SOME_VISIBLE: u32 = 1u;
const ALL_VISIBLE: u32 = 2u;
