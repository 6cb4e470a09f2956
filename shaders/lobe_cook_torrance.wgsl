// D G / 4: Beckmann's distribution and V-cavity shadowing (Cook and Torrance 1982); shape is 1/m².

//!import exp_negative
//!import lobe_input
//!import tint_fresnel

fn lobe(n: Seen, pair: Pair) -> f32 {
    let inverse_cos2 = 1.0 / (n.n_dot_h * n.n_dot_h);
    let d = exp_negative(-n.sin2 * inverse_cos2 * sum.shape) * inverse_cos2 * inverse_cos2 * sum.scale;
    return d * min(2.0 / max(pair.i_dot_h, 1e-20) * n.n_dot_h * min(n.n_dot_i, n.n_dot_o), 1.0);
}
