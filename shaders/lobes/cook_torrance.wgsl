// D G / 4: Beckmann's distribution and V-cavity shadowing (Cook and Torrance 1982).

//!import exp_negative
//!import lobe_angles

fn cook_torrance(angles: LobeAngles, i_dot_h: f32, inverse_m2: f32, scale: f32) -> f32 {
    let inverse_cos2 = 1.0 / (angles.n_dot_h * angles.n_dot_h);
    let d = exp_negative(-angles.sin2 * inverse_cos2 * inverse_m2) * inverse_cos2 * inverse_cos2 * scale;
    return d * min(2.0 / max(i_dot_h, 1e-20) * angles.n_dot_h * min(angles.n_dot_i, angles.n_dot_o), 1.0);
}
