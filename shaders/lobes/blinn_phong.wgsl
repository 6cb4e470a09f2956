// (e+8)/(8π) (n·h)^e (n·i)(n·o), the power as exp(e/2 ln(1-sin²)).

//!import exp_negative
//!import lobe_angles

// ln(1 - s) for 0 <= s < 1. The error is relative to s, so that large exponents do not magnify it.
fn ln_one_minus(s: f32) -> f32 {
    if s > 0.5 {
        return log(1.0 - s);
    }
    let r = -s / (2.0 - s);
    let r2 = r * r;
    return 2.0 * r
        * (1.0 + r2 * (1.0 / 3.0 + r2 * (1.0 / 5.0 + r2 * (1.0 / 7.0 + r2 * (1.0 / 9.0 + r2 * (1.0 / 11.0))))));
}

fn blinn_phong(angles: LobeAngles, half_exponent: f32, scale: f32) -> f32 {
    let power = exp_negative(min(half_exponent * ln_one_minus(min(angles.sin2, 0.999999)), 0.0));
    return scale * power * angles.n_dot_i * angles.n_dot_o;
}
