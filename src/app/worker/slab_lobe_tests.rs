use super::*;
use crate::scene;

fn job(slab: &str) -> SlabLobeJob {
    let text = format!("[tile]\ngeometry = {{ kind = \"flat\" }}\n[quality]\npreset = \"draft\"\n[slab]\n{slab}");
    let scene = scene::parse(&text).unwrap();
    let loaded = LoadedScene { scene, base_dir: "".into(), name: "slab".into(), painted: Default::default() };
    SlabLobeJob { loaded: Arc::new(loaded), light: Vec3::new(-0.6, 0.0, 0.8), log: false }
}

const ROUGH: &str = "absorption = [0.2, 0.1, 0.1]\nthickness = 0.4\ndiffuse = [0.1, 0.0, 0.0]\n\
    [slab.top]\nkind = \"beckmann\"\nroughness = 0.2\n[slab.bottom]\nkind = \"ggx\"\nroughness = 0.15\n";

#[test]
fn photons_narrow_with_each_batch_and_agree_with_the_sum_over_facets() {
    let job = job(ROUGH);
    let reported = std::cell::RefCell::new(Vec::new());
    let cancel = Cancel::default();
    let report = |result: SlabLobeResult| {
        let SlabLobeResult::Lobe(lobe) = result else { panic!() };
        reported.borrow_mut().push(*lobe);
        if reported.borrow().len() == 5 {
            cancel.set();
        }
    };
    assert!(matches!(refine(&Pipeline::new(), &job, &cancel, &report), Err(Error::Cancelled)));
    let reported = reported.into_inner();
    assert!(reported[0].truth.is_none() && reported[0].curves.len() == 2);
    let states: Vec<&TruthState> = reported[1..].iter().map(|lobe| lobe.truth.as_ref().unwrap()).collect();
    assert!(states[3].noise < 0.6 * states[0].noise, "{states:?}");
    let last = states[3];
    let faces = last.models.iter().find(|(name, _)| *name == "faces").unwrap().1;
    assert!(faces < 0.1, "{last:?}");
    let through: f32 = reported[4].parts[..3].iter().map(|(_, part)| part).sum();
    // The models add half of what masking removes from the photons.
    assert!((f64::from(through) - last.transmitted[0]).abs() < 0.04, "{through} {last:?}");
    // The peak of the truth lies opposite the light, as that of the models.
    let peak = |curve: &LobeCurve| {
        let largest = curve.values.iter().copied().fold(0.0, f32::max);
        curve.values.iter().position(|value| *value == largest).unwrap() as i32
    };
    let peaks: Vec<i32> = reported[4].curves.iter().map(peak).collect();
    assert!((peaks[0] - peaks[2]).abs() < 8 && peaks[0] > 70, "{peaks:?}");
}

#[test]
fn the_parts_of_the_light_are_all_of_it_and_a_window_passes_it_straight() {
    let draft = |slab: &str| {
        let job = job(slab);
        let outcome = Pipeline::new().slab(&job.loaded).unwrap();
        Models::new(&outcome, &job, false).parts
    };
    for slab in [ROUGH, "bounces = \"off\"\n", ""] {
        let parts = draft(slab);
        let total: f32 = parts.iter().map(|(_, part)| part).sum();
        assert!((total - 1.0).abs() < 1e-3 && parts.iter().all(|(_, part)| *part >= 0.0), "{slab}: {parts:?}");
    }
    let [through, bounced, straight, reflected, absorbed] = draft("").map(|(_, part)| part);
    assert!(through < 1e-6 && bounced < 1e-6 && absorbed < 1e-3, "{through} {bounced} {absorbed}");
    assert!(straight > 0.85 && reflected > 0.05, "{straight} {reflected}");
    let bounced = draft(ROUGH)[1].1;
    assert!(bounced > 0.001, "{bounced}");
}
