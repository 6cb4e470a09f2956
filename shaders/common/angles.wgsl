// Angles to single precision. The built-in atan2 may be off by 4096 units in the last place, and sin and cos by 2^-11.

const PI: f32 = 3.14159265358979;
const TAU: f32 = 6.28318530717959;
const HALF_PI: f32 = 1.57079632679490;

// The angle of (x, y) in (-π, π]; 0 at the origin. The absolute error is 1e-7 plus rounding
// (Abramowitz and Stegun, 4.4.49).
fn angle_of(y: f32, x: f32) -> f32 {
    let longer = max(abs(x), abs(y));
    if !(longer > 0.0) {
        return 0.0;
    }
    let t = min(abs(x), abs(y)) / longer;
    let s = t * t;
    let high = s * (-0.0752896400 + s * (0.0429096138 + s * (-0.0161657367 + s * 0.0028662257)));
    var angle = t * (1.0 + s * (-0.3333314528 + s * (0.1999355085 + s * (-0.1420889944 + s * (0.1065626393 + high)))));
    angle = select(angle, HALF_PI - angle, abs(y) > abs(x));
    angle = select(angle, PI - angle, x < 0.0);
    return select(angle, -angle, y < 0.0);
}

// The azimuth of a direction in turns, in [0, 1).
fn azimuth_in_turns(d: vec2f) -> f32 {
    let turn = angle_of(d.y, d.x) / TAU;
    return fract(select(turn, turn + 1.0, turn < 0.0));
}
