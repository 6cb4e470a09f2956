// (n·i)(n·o)/π

//!import lobe_input

fn lambertian(n: Seen) -> f32 {
    return n.n_dot_i * n.n_dot_o * 0.318309886183791;
}
