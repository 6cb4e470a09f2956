// Above or below all horizons of a patch there is nothing to be summed.

//!import patches
//!import azimuth_sight

fn reach(patch_index: u32, sight: Sight) -> u32 {
    let row = patches[first_row(patch_index) + HEAD + sight.lower];
    if sight.elevation <= bitcast<f32>(row.x) {
        return NOTHING;
    }
    return select(PART, EVERYTHING, sight.elevation >= bitcast<f32>(row.y));
}
