// Any lobe. Its number is 1 plus the kind that Lobe::numbers returns (src/math/simd/lobes.rs); 0 is black.
// Shape and scale come from Lobe::numbers as well.

//!import lobe_angles
//!import lambertian
//!import blinn_phong
//!import cook_torrance
//!import ward
//!import ggx

fn lobe_by_number(number: u32, angles: LobeAngles, i_dot_h: f32, shape: f32, scale: f32) -> f32 {
    switch number {
        case 0u: {
            return 0.0;
        }
        case 1u: {
            return lambertian(angles);
        }
        case 2u: {
            return blinn_phong(angles, shape, scale);
        }
        case 3u: {
            return cook_torrance(angles, i_dot_h, shape, scale);
        }
        case 4u: {
            return ward(angles, shape, scale);
        }
        default: {
            return ggx(angles, shape, scale);
        }
    }
}
