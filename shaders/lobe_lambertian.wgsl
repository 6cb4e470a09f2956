// (n·i)(n·o)/π

//!import lobe_input
//!import tint_fixed

fn lobe(n: Seen, pair: Pair) -> f32 {
    return n.n_dot_i * n.n_dot_o * 0.318309886183791;
}
