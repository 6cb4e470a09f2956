// D G2 / 4: GGX (Walter et al. 2007), height-correlated Smith shadowing (Heitz 2014).

//!import lobe_angles

fn ggx(angles: LobeAngles, alpha2: f32, scale: f32) -> f32 {
    let rest = 1.0 - alpha2;
    let t = angles.sin2 + alpha2 * angles.n_dot_h * angles.n_dot_h;
    let smith = angles.n_dot_o * sqrt(alpha2 + rest * angles.n_dot_i * angles.n_dot_i)
        + angles.n_dot_i * sqrt(alpha2 + rest * angles.n_dot_o * angles.n_dot_o);
    // Divides by t twice, because t² of a sharp lobe may underflow.
    return scale / t * (angles.n_dot_i * angles.n_dot_o / max(smith, 1e-20)) / t;
}
