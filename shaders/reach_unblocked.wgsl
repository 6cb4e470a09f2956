// A flat tile hides nothing.

//!import patches
//!import visibility_unblocked

fn reach(patch_index: u32, sight: Sight) -> u32 {
    return EVERYTHING;
}
