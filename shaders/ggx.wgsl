// D G2 / 4: GGX (Walter et al. 2007), height-correlated Smith shadowing (Heitz 2014).

//!import lobe_input

fn ggx(n: Seen, alpha2: f32, scale: f32) -> f32 {
    let rest = 1.0 - alpha2;
    let t = n.sin2 + alpha2 * n.n_dot_h * n.n_dot_h;
    let smith = n.n_dot_o * sqrt(alpha2 + rest * n.n_dot_i * n.n_dot_i) + n.n_dot_i * sqrt(alpha2 + rest * n.n_dot_o * n.n_dot_o);
    // One factor after the other: t² of a sharp lobe may be too small a number.
    return scale / t * (n.n_dot_i * n.n_dot_o / max(smith, 1e-20)) / t;
}
