// exp(-tan²/α²) sqrt((n·i)(n·o)) / (4πα²) (Ward 1992)

//!import exp_negative
//!import lobe_input

fn ward(n: Seen, inverse_alpha2: f32, scale: f32) -> f32 {
    return scale * exp_negative(-n.sin2 / (n.n_dot_h * n.n_dot_h) * inverse_alpha2) * sqrt(n.n_dot_i * n.n_dot_o);
}
