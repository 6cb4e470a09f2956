// Any lobe, by one more than Lobe::numbers says (src/simd/lobes.rs), which tells shape and scale, too; black for 0.

//!import lobe_input
//!import lambertian
//!import blinn_phong
//!import cook_torrance
//!import ward
//!import ggx

fn lobe_by_number(number: u32, n: Seen, i_dot_h: f32, shape: f32, scale: f32) -> f32 {
    switch number {
        case 0u: {
            return 0.0;
        }
        case 1u: {
            return lambertian(n);
        }
        case 2u: {
            return blinn_phong(n, shape, scale);
        }
        case 3u: {
            return cook_torrance(n, i_dot_h, shape, scale);
        }
        case 4u: {
            return ward(n, shape, scale);
        }
        default: {
            return ggx(n, shape, scale);
        }
    }
}
