//! Errors of the models of slabs against photons, and their times.

use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Instant;

use biscale::Cancel;
use biscale::reference::photons::lobe::cell_means;
use biscale::reference::photons::{LobeSettings, TrueLobe};
use biscale::slab::{ChannelSlab, Inner, Ndf, Optics, Profile, Slab, virtual_face, walter};
use glam::{DVec2, DVec3};

const ANGLES: [f64; 5] = [0.0, 30.0, 45.0, 60.0, 75.0];
const SIDE: usize = 96;

fn polar(degrees: f64) -> DVec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    DVec3::new(sin, 0.0, cos)
}

fn face(profile: Profile, roughness: f64) -> Arc<Ndf> {
    Arc::new(Ndf::analytic(profile, DVec2::splat(roughness), 0.0))
}

/// Prints the tables.
pub fn slabs(print: &mut dyn FnMut(String)) {
    errors(print);
    print(String::new());
    times(print);
}

/// Relative L2 in per cent over solid angle to 85° against photons, one row per pair of faces, one figure per angle.
fn errors(print: &mut dyn FnMut(String)) {
    print("| faces | Eq. 11, % at 0, 30, 45, 60, 75° | 64 facets | 256 facets | one refraction (Walter) | all light, 64 facets | T: photons, model |".to_owned());
    print("|---|---|---|---|---|---|---|".to_owned());
    use Profile::{Beckmann, Ggx};
    for (profile, top, bottom) in [
        (Beckmann, 0.2, 0.0),
        (Beckmann, 0.0, 0.2),
        (Beckmann, 0.1, 0.1),
        (Beckmann, 0.2, 0.2),
        (Beckmann, 0.4, 0.4),
        (Beckmann, 0.1, 0.3),
        (Beckmann, 0.3, 0.1),
        (Ggx, 0.1, 0.1),
        (Ggx, 0.2, 0.2),
    ] {
        let (t, b) = (face(profile, top), face(profile, bottom));
        let dual = Slab::new(t.clone(), b.clone(), Optics::default(), 512);
        let [few, many] = [64, 256].map(|count| dual.clone().by_faces(count));
        let Ok(inner) = Inner::new(&t, &b, &dual.optics, 24_576, 1, &Cancel::default()) else { return };
        let mut columns: [Vec<String>; 6] = Default::default();
        for degrees in ANGLES {
            let i = polar(degrees);
            let walk = ChannelSlab { top: &t, bottom: &b, channel: dual.optics.channel(0) };
            let settings = LobeSettings { side: SIDE, photons: 1_000_000, target: 0.01, seed: 1 };
            let Ok(truth) = TrueLobe::trace(&walk, i, &settings, &Cancel::default()) else { return };
            let rough = if t.is_smooth() { &b } else { &t };
            let single = |slab: &Slab| cell_means(SIDE, 3, |o| slab.single_pass(i, o).x);
            // Photons lose masked light, of which the model adds half.
            let masked = 0.5 * inner.parts(i, 0).masked / PI;
            let all = cell_means(SIDE, 3, |o| few.single_pass(i, o).x + inner.btdf(i, o).x - masked);
            let of_walter = cell_means(SIDE, 3, |o| walter(rough, i, o, 1.5));
            let total = all.iter().sum::<f64>() * (2.0 / SIDE as f64).powi(2);
            let percent = |bins, cells: &[f64]| format!("{:.1}", 100.0 * truth.relative_l2(bins, cells));
            columns[0].push(percent(&truth.single, &single(&dual)));
            columns[1].push(percent(&truth.single, &single(&few)));
            columns[2].push(percent(&truth.single, &single(&many)));
            columns[3].push(percent(&truth.single, &of_walter));
            columns[4].push(percent(&truth.all, &all));
            columns[5].push(format!("{:.3} {total:.3}", truth.totals.transmitted.value));
        }
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|k: usize| columns[k].join(" "));
        print(format!("| {profile:?} {top}/{bottom} | {a} | {b} | {c} | {d} | {e} | {} |", columns[5].join(", ")));
    }
}

/// Times on this machine.
fn times(print: &mut dyn FnMut(String)) {
    print("| what | time |".to_owned());
    print("|---|---|".to_owned());
    let ms = |work: &mut dyn FnMut()| {
        work();
        let best = (0..5).map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64() * 1e3
        });
        best.fold(f64::MAX, f64::min)
    };
    let (a, b) = (face(Profile::Ggx, 0.2), face(Profile::Ggx, 0.3));
    for side in [256, 512] {
        let time = ms(&mut || {
            std::hint::black_box(virtual_face(&a, &b, side));
        });
        print(format!("| correlation of two GGX faces, {side} x {side} | {time:.1} ms |"));
    }
    let directions: Vec<DVec3> = (0..145)
        .map(|k| {
            let (u, v) = ((f64::from(k) + 0.5) / 145.0, f64::from(k) * 0.618_034);
            (u.sqrt() * DVec2::from_angle(2.0 * PI * v)).extend((1.0 - u).sqrt())
        })
        .collect();
    let klems = |slab: &Slab| {
        let mut sum = 0.0;
        for i in &directions {
            for o in &directions {
                sum += slab.single_pass(*i, DVec3::new(o.x, o.y, -o.z)).x;
            }
        }
        std::hint::black_box(sum);
    };
    for (name, profile) in [("Beckmann", Profile::Beckmann), ("GGX, table", Profile::Ggx)] {
        let slab = Slab::new(face(profile, 0.2), face(profile, 0.2), Optics::default(), 256);
        let time = ms(&mut || klems(&slab));
        print(format!(
            "| Eq. 11, {name}: 145 x 145 pairs, one core | {time:.1} ms, {:.0} ns a pair |",
            time * 1e6 / 21_025.0
        ));
        let slab = slab.by_faces(64);
        let time = ms(&mut || klems(&slab));
        print(format!(
            "| 64 facets, {name}: 145 x 145 pairs, one core | {time:.0} ms, {:.0} ns a pair |",
            time * 1e6 / 21_025.0
        ));
    }
    let table = |photons: usize| Inner::new(&a, &b, &Optics::default(), photons, 1, &Cancel::default());
    let slab = Slab::new(a.clone(), b.clone(), Optics::default(), 256).by_faces(64);
    let Ok(fine) = table(1 << 18) else { return };
    for photons in [1024, 24_576, 98_304] {
        let Ok(coarse) = table(photons) else { return };
        let time = ms(&mut || {
            std::hint::black_box(table(photons).is_ok());
        });
        let error = |degrees: &f64| {
            let i = polar(*degrees);
            let all = |inner: &Inner| cell_means(SIDE, 2, |o| slab.single_pass(i, o).x + inner.btdf(i, o).x);
            let (found, expected) = (all(&coarse), all(&fine));
            let difference: f64 = found.iter().zip(&expected).map(|(a, b)| (a - b).powi(2)).sum();
            format!("{:.1}", 100.0 * (difference / expected.iter().map(|b| b * b).sum::<f64>()).sqrt())
        };
        let errors = [0.0, 45.0, 75.0].iter().map(error).collect::<Vec<_>>().join(", ");
        print(format!(
            "| table of inner reflections, {photons} photons a ring; noise in all light at 0, 45, 75°: {errors} % | {time:.0} ms |"
        ));
    }
}
