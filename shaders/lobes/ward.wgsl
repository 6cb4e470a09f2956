// exp(-tan²/α²) sqrt((n·i)(n·o)) / (4πα²) (Ward 1992)

//!import exp_negative
//!import lobe_angles

fn ward(angles: LobeAngles, inverse_alpha2: f32, scale: f32) -> f32 {
    return scale * exp_negative(-angles.sin2 / (angles.n_dot_h * angles.n_dot_h) * inverse_alpha2)
        * sqrt(angles.n_dot_i * angles.n_dot_o);
}
