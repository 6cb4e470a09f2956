// exp(-tan²/α²) sqrt((n·i)(n·o)) / (4πα²) (Ward 1992); shape is 1/α².

//!import exp_negative
//!import lobe_input
//!import tint_fixed

fn lobe(n: Seen, pair: Pair) -> f32 {
    return sum.scale * exp_negative(-n.sin2 / (n.n_dot_h * n.n_dot_h) * sum.shape) * sqrt(n.n_dot_i * n.n_dot_o);
}
