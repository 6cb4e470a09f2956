// (n·i)(n·o)/π

//!import lobe_angles

fn lambertian(angles: LobeAngles) -> f32 {
    return angles.n_dot_i * angles.n_dot_o * 0.318309886183791;
}
