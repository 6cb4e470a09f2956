use super::*;
use crate::scene;

fn images(text: &str, size: [usize; 2], passes: usize) -> Vec<MethodImage> {
    let scene = scene::parse(text).unwrap();
    let loaded =
        Arc::new(LoadedScene { scene, base_dir: "".into(), name: "methods".into(), painted: Default::default() });
    let cancel = Cancel::default();
    let last = std::cell::RefCell::new(Vec::new());
    let job = MethodsJob { version: 1, loaded, size };
    let done = MethodsWorker::default().compare(&job, &cancel, &|result| {
        if let MethodsResult::Images(_, images) = result {
            if images.iter().any(|image| image.passes >= passes) {
                cancel.set();
            }
            *last.borrow_mut() = images;
        }
    });
    assert!(matches!(done, Ok(()) | Err(Error::Cancelled)), "{done:?}");
    last.into_inner()
}

const QUALITY: &str = "[quality]\npreset = \"draft\"\nbackend = \"cpu\"\n[light]\ncount = 4\n";

#[test]
fn the_filtered_image_of_a_colour_map_is_nearer_to_the_truth_than_the_naive_one() {
    let text = format!(
        "{QUALITY}[[material]]\nname = \"default\"\nbrdf = {{ kind = \"lambertian\", albedo = 0.9 }}\n\
         [tile]\ngeometry = {{ kind = \"heightfield\", path = \"asset:hammered.png\" }}\n\
         [object]\nkind = \"sphere\"\n[camera]\ndistance = 2.2\nfov_deg = 8\n[[color_map.layer]]\n\
         driver = {{ kind = \"height\" }}\nstops = [[-0.5, [0.9, 0.1, 0.0]], [-0.5, [0.0, 0.1, 0.6]], [0.8, 0.1], [0.8, 1]]\n"
    );
    let images = images(&text, [48, 36], 24);
    let names: Vec<_> = images.iter().map(|image| image.name).collect();
    assert_eq!(names, ["naive", "reference", "filtered"]);
    let [naive, truth, filtered] = &images[..] else { panic!() };
    println!("{:?} {:?} {:?}", naive.difference, truth.noise, filtered.difference);
    assert!(truth.noise.is_some_and(|noise| (1e-4..0.2).contains(&noise)), "{:?}", truth.noise);
    let [naive, filtered] = [naive, filtered].map(|image| image.difference.unwrap());
    assert!(filtered < 0.6 * naive && naive > 0.1, "naive {naive}, filtered {filtered}");
}

#[test]
fn slabs_by_both_models_are_near_the_truth_and_its_error_narrows() {
    let text = format!(
        "{QUALITY}[tile]\ngeometry = {{ kind = \"flat\" }}\n[object]\nkind = \"sheet\"\n[background]\n\
         kind = \"checkerboard\"\ndistance = 0.2\n[slab]\ntop = {{ kind = \"beckmann\", roughness = 0.15 }}\n\
         bottom = {{ kind = \"beckmann\", roughness = 0.1 }}\n"
    );
    let few = images(&text, [40, 30], 2);
    let many = images(&text, [40, 30], 8);
    assert_eq!(many.iter().map(|image| image.name).collect::<Vec<_>>(), ["Eq. 11", "faces", "reference"]);
    let noise = |images: &[MethodImage]| images[0].noise.unwrap();
    println!("{:?}", many.iter().map(|image| (image.noise, image.difference)).collect::<Vec<_>>());
    assert!(noise(&many) < 0.8 * noise(&few), "{} {}", noise(&many), noise(&few));
    for image in &many[..2] {
        assert!(image.difference.is_some_and(|difference| difference < 0.06), "{image:?}");
    }
}
