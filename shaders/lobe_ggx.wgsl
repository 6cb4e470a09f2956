// D G2 / 4: GGX (Walter et al. 2007), height-correlated Smith shadowing (Heitz 2014); shape is α².

//!import lobe_input
//!import tint_fresnel

fn lobe(n: Seen, pair: Pair) -> f32 {
    let rest = 1.0 - sum.shape;
    let t = n.sin2 + sum.shape * n.n_dot_h * n.n_dot_h;
    let smith = n.n_dot_o * sqrt(sum.shape + rest * n.n_dot_i * n.n_dot_i) + n.n_dot_i * sqrt(sum.shape + rest * n.n_dot_o * n.n_dot_o);
    // One factor after the other: t² of a sharp lobe may be too small a number.
    return sum.scale / t * (n.n_dot_i * n.n_dot_o / max(smith, 1e-20)) / t;
}
