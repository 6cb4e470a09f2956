// Where things may hang above a horizon, only the facets tell.

//!import patches
//!import visibility_unblocked

fn reach(patch_index: u32, sight: Sight) -> u32 {
    return PART;
}
