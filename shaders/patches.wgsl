// Runs of facets with one normal, and which elevations tell nothing apart among them.

//!import facets
//!import tint_row

struct Patch {
    normal: vec3f,
    first: u32,
    end: u32,
    area: f32,
    // All its weights together.
    whole: vec3f,
    // Rows of its lobes.
    terms: u32,
    terms_end: u32,
}

struct Term {
    tint: Tint,
    // One more than Lobe::numbers says (src/simd/lobes.rs), which tells shape and scale, too.
    lobe: u32,
    shape: f32,
    scale: f32,
}

// Of each patch three rows, and one for each azimuth (find_reach.wgsl); then three of each lobe.
@group(1) @binding(3) var<storage, read> patches: array<vec4u>;

const HEAD: u32 = 3u;
const TERM: u32 = 3u;

fn first_row(patch_index: u32) -> u32 {
    return patch_index * (HEAD + sum.azimuths);
}

fn patch_at(patch_index: u32) -> Patch {
    let row = first_row(patch_index);
    let a = patches[row];
    let b = patches[row + 1u];
    let c = patches[row + 2u];
    return Patch(bitcast<vec3f>(a.xyz), a.w, b.x, bitcast<f32>(b.y), bitcast<vec3f>(c.xyz), b.z, b.w);
}

fn term_at(row: u32) -> Term {
    let a = patches[row];
    let b = patches[row + 1u];
    let c = patches[row + 2u];
    let tint = Tint(bitcast<vec3f>(a.xyz), bitcast<f32>(a.w), bitcast<vec3f>(b.xyz), b.w);
    return Term(tint, c.x, bitcast<f32>(c.y), bitcast<f32>(c.z));
}

// How much of a patch a direction sees.
const NOTHING: u32 = 0u;
const PART: u32 = 1u;
const EVERYTHING: u32 = 2u;
