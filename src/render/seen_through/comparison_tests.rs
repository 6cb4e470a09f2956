//! Figure 7 of Dai et al. 2009: a checkerboard behind patterned glass by other models.

use std::path::Path;

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::tests::rms;
use super::*;
use crate::base::Cancel;
use crate::effective::{PathEnd, PathKind, VaryingSurface, ViewLobe, ViewLobes, ViewPaths, Viewer};
use crate::pipeline::Pipeline;
use crate::render::RenderScene;
use crate::render::image::pixels::Image;
use crate::render::image::tone_map::ToneMap;
use crate::slab::fresnel::{reflectance, refract};
use crate::slab::{Ndf, Profile, SlabView, normal};

/// A surface that is the same everywhere.
struct Everywhere<P>(P);

/// A place of it.
struct Place<'a, P>(&'a P);

impl<P: ViewPaths> VaryingSurface for Everywhere<P> {
    type Point<'a>
        = Place<'a, P>
    where
        Self: 'a;

    fn at(&self, _: Vec2) -> Place<'_, P> {
        Place(&self.0)
    }
}

impl<P: ViewPaths> ViewPaths for Place<'_, P> {
    fn follow(&self, viewer: &Viewer, end: impl FnMut(PathEnd)) -> [Vec3; 2] {
        self.0.follow(viewer, end)
    }

    fn lobes(&self, o: Vec3) -> ViewLobes {
        self.0.lobes(o)
    }

    fn straight(&self, o: Vec3) -> [Vec3; 2] {
        self.0.straight(o)
    }
}

/// One refraction at a GGX face (Walter et al. 2007): light leaves along its direction inside.
struct OneRefraction {
    slopes: Vec<DVec2>,
    eta: f64,
}

impl OneRefraction {
    fn new(roughness: f64, eta: f64) -> Self {
        let face = Ndf::analytic(Profile::Ggx, DVec2::splat(roughness), 0.0);
        let even = |k: usize, step: f64| (0.5 + k as f64 * step).fract();
        let slope = |k| face.facet(even(k, 0.754_877_666_246_692_7), even(k, 0.569_840_290_998_053_2)).0;
        Self { slopes: (0..4096).map(slope).collect(), eta }
    }

    /// The directions inside of so many paths, with their weights.
    fn refracted(&self, viewer: &Viewer) -> impl Iterator<Item = (Vec3, f32)> {
        let (o, count) = (viewer.o.as_dvec3(), viewer.paths);
        let first = viewer.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) as usize % self.slopes.len();
        let slopes = (0..count).map(move |path| self.slopes[(first + path) % self.slopes.len()]);
        slopes.filter_map(move |slope| {
            let h = normal(slope);
            let cosine = o.dot(h);
            let d = refract(-o, h, self.eta).filter(|d| d.z < 0.0)?;
            let weight = cosine / (h.z * o.z) * (1.0 - reflectance(cosine, self.eta)) / count as f64;
            Some((d.as_vec3(), weight as f32))
        })
    }
}

impl ViewPaths for OneRefraction {
    fn follow(&self, viewer: &Viewer, mut end: impl FnMut(PathEnd)) -> [Vec3; 2] {
        for (direction, weight) in self.refracted(viewer) {
            end(PathEnd { kind: PathKind::Transmitted, direction, weight: Vec3::splat(weight) });
        }
        [Vec3::ZERO; 2]
    }

    fn lobes(&self, o: Vec3) -> ViewLobes {
        let viewer = Viewer { o, paths: 256, seed: 0 };
        let (mut part, mut mean, mut second) = (0.0, Vec2::ZERO, [0.0; 3]);
        for (d, weight) in self.refracted(&viewer) {
            part += weight;
            mean += weight * d.truncate();
            second.iter_mut().zip([d.x * d.x, d.x * d.y, d.y * d.y]).for_each(|(sum, value)| *sum += weight * value);
        }
        let mean = mean / part;
        let [xx, xy, yy] = second.map(|sum| sum / part);
        let covariance = [xx - mean.x * mean.x, xy - mean.x * mean.y, yy - mean.y * mean.y];
        let transmitted = ViewLobe { part: Vec3::splat(part), mean, covariance, tail: 0.0 };
        ViewLobes { transmitted, ..ViewLobes::default() }
    }

    fn straight(&self, _: Vec3) -> [Vec3; 2] {
        [Vec3::ZERO; 2]
    }
}

/// The lobe of the middle of the image for all pixels, about the straight direction.
struct OneLobe {
    lobes: ViewLobes,
    o: Vec3,
}

impl ViewPaths for OneLobe {
    fn follow(&self, _: &Viewer, _: impl FnMut(PathEnd)) -> [Vec3; 2] {
        [Vec3::ZERO; 2]
    }

    fn lobes(&self, o: Vec3) -> ViewLobes {
        let mut lobes = self.lobes;
        let turn = self.o.truncate() - o.truncate();
        lobes.transmitted.mean += turn;
        lobes.reflected.mean += turn;
        lobes
    }

    fn straight(&self, _: Vec3) -> [Vec3; 2] {
        self.lobes.straight
    }
}

/// Writes the images into `docs/slabs/` and prints a table of them with their errors.
#[test]
#[ignore = "makes figures: cargo bench --bench measure -- slab-figure-7"]
fn figure_7_by_the_slab_by_one_refraction_by_one_lobe_and_by_very_many_paths() {
    let loaded = crate::scene::open("slab_fig7_leaf_glass", &[]).unwrap();
    let pipeline = Pipeline::new();
    let outcome = pipeline.slab(&loaded).unwrap();
    let render_scene = RenderScene::with(&pipeline, &loaded).unwrap();
    let backdrop = SlabScene::backdrop(&pipeline, &loaded, &render_scene).unwrap();
    let view = SlabView::new(outcome.slab.clone());
    let frame = Frame { render_scene: &render_scene, backdrop: &backdrop, slab: &outcome.slab };
    let truth = frame.rendered(&view, 4096);
    let (sin, cos) = 20f32.to_radians().sin_cos();
    let o = Vec3::new(sin, 0.0, cos);
    let one_lobe = Everywhere(OneLobe { lobes: view.lobes(o), o });
    let roughness = outcome.slab.deviation();
    let one_refraction = Everywhere(OneRefraction::new(roughness, outcome.slab.optics.eta.x));
    let rows = [
        ("truth", "4096 paths", truth.clone()),
        ("paths64", "64 paths", frame.rendered(&view, 64)),
        ("draft", "a lobe per pixel", frame.rendered(&view, 0)),
        ("one_lobe", "one lobe for all pixels", frame.rendered(&one_lobe, 0)),
        ("ggx", "one refraction, GGX", frame.rendered(&one_refraction, 256)),
    ];
    let tone_map = ToneMap::new(&render_scene.camera).unwrap();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/slabs");
    for (name, _, image) in &rows {
        image.write(&folder.join(format!("fig7_{name}.png")), &tone_map).unwrap();
    }
    let cells = |cell: &dyn Fn(&(&str, &str, Image)) -> String| {
        println!("| {} |", rows.iter().map(cell).collect::<Vec<_>>().join(" | "));
    };
    cells(&|row| row.1.to_owned());
    cells(&|_| "---".to_owned());
    cells(&|row| format!("![](slabs/fig7_{}.png)", row.0));
    cells(&|row| format!("RMS of grey {:.3}", rms(&row.2, &truth)));
    let means = rows.each_ref().map(|row| row.2.pixels.iter().map(|pixel| pixel.as_dvec3()).sum::<DVec3>().x);
    assert!(means.iter().all(|mean| (mean / means[0] - 1.0).abs() < 0.3), "{means:?}");
}

/// The inputs that all images share.
struct Frame<'a> {
    render_scene: &'a RenderScene,
    backdrop: &'a Backdrop,
    slab: &'a crate::slab::Slab,
}

impl Frame<'_> {
    fn rendered<S: VaryingSurface>(&self, surface: &S, paths: usize) -> Image {
        let input = SeenThrough {
            mesh: self.render_scene.mesh(),
            camera: &self.render_scene.camera,
            backdrop: self.backdrop,
            surface,
            places: Places { origin: Vec2::ZERO, scale: Vec2::ONE },
            reflectance: self.slab,
            transmittance: self.slab,
            lights: &[],
            size: [240, 240],
            samples_per_side: 1,
            paths,
            seed: 1,
            cancel: Cancel::default(),
        };
        render(&input).unwrap().image
    }
}
