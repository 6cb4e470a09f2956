//! Cases: a tile, a BRDF, and the files that they name.

/// A tile and its BRDF.
#[derive(Debug, Clone)]
pub struct Case {
    pub family: &'static str,
    pub name: &'static str,
    /// The table `[tile]` without its header.
    pub tile: String,
    pub brdf: String,
    /// The text of `tile.obj`, if the tile is a mesh.
    pub mesh: Option<String>,
}

const GLOSSY: &str = r#"{ kind = "cook_torrance", roughness = 0.3, f0 = [1.0, 0.8, 0.5] }"#;
const WHITE: &str = r#"{ kind = "lambertian", albedo = 1.0 }"#;
const PYRAMIDS: &str = r#"geometry = { kind = "pyramids", height = 0.15 }"#;

fn geometry(name: &'static str, tile: &str, mesh: Option<&str>) -> [Case; 2] {
    [("geometry, glossy", GLOSSY), ("geometry, white", WHITE)].map(|(family, brdf)| Case {
        family,
        name,
        tile: tile.to_owned(),
        brdf: brdf.to_owned(),
        mesh: mesh.map(str::to_owned),
    })
}

/// Returns the cases of a mesh, from the text of its OBJ file.
fn obj(name: &'static str, mesh: &str) -> [Case; 2] {
    geometry(name, r#"geometry = { kind = "mesh", path = "tile.obj" }"#, Some(mesh))
}

const PLANE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

/// Returns the plane and the corners of a box of side 0.5 above it, from `low` to `high`, with the given faces.
fn on_plane(low: f32, high: f32, faces: &str) -> String {
    let ring = |z: f32| format!("v .25 .25 {z}\nv .75 .25 {z}\nv .75 .75 {z}\nv .25 .75 {z}\n");
    format!("{PLANE}{}{}{faces}", ring(low), ring(high))
}

const BOX: &str = "f 5 8 7 6\nf 9 10 11 12\nf 5 6 10 9\nf 6 7 11 10\nf 7 8 12 11\nf 8 5 9 12\n";

fn slivers() -> String {
    // Ridges of triangles that are a thousand times as long as wide.
    let mut text = String::new();
    for k in 0..=64 {
        let (y, z) = (f64::from(k) / 64.0, if k % 2 == 0 { 0.0 } else { 0.01 });
        text += &format!("v 0 {y} {z}\nv 16 {y} {z}\n");
    }
    for k in 0..64 {
        let a = 2 * k + 1;
        text += &format!("f {a} {} {} {}\n", a + 1, a + 3, a + 2);
    }
    text
}

pub fn geometries() -> Vec<Case> {
    let heights = |values: &str, size: &str, scale: f32| {
        format!("size = {size}\ngeometry = {{ kind = \"heightfield\", values = {values}, height_scale = {scale} }}")
    };
    let egg = "[[0, 0.3, 0.1, 0.2], [0.5, 0.9, 0.4, 0.1], [0.2, 0.6, 1.0, 0.3], [0, 0.1, 0.5, 0.2]]";
    [
        geometry("flat", r#"geometry = { kind = "flat" }"#, None),
        geometry("height 0", r#"geometry = { kind = "grooves", depth = 0 }"#, None),
        geometry("height of 100 tiles", r#"geometry = { kind = "pyramids", height = 100 }"#, None),
        geometry("cliffs", &heights("[[0, 0, 1, 1], [0, 0, 1, 1]]", "[1.0, 1.0]", 1.0), None),
        geometry("cliffs of 100 tiles", &heights("[[0, 0, 1, 1], [0, 0, 1, 1]]", "[1.0, 1.0]", 100.0), None),
        geometry("walls of 90°", r#"geometry = { kind = "grooves", profile = "rectangular", depth = 0.5 }"#, None),
        geometry("one sample", &heights("[[5]]", "[1.0, 1.0]", 1.0), None),
        geometry("tile of 1e-6", &heights(egg, "[1e-6, 1e-6]", 3e-7), None),
        geometry("tile of 1e6", &heights(egg, "[1e6, 1e6]", 3e5), None),
        geometry("tile of 1 to 1000", &heights(egg, "[1.0, 1000.0]", 0.3), None),
        geometry("tile of 3 to 1", &heights(egg, "[3.0, 1.0]", 0.3), None),
        geometry("rods", r#"geometry = { kind = "rods", count = 24, radius = 0.04, length = 0.2 }"#, None),
        geometry("threads", r#"geometry = { kind = "weave", warp_count = 2, weft_count = 2 }"#, None),
        obj("one triangle", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        obj("inverted triangles", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 4 3 2 1\n"),
        obj("duplicate triangles", &format!("{PLANE}f 1 2 3 4\nf 1 2 3 4\n")),
        obj("no area at all", "v 0 0 0\nv 1 0 0\nv 0.5 0 0\nf 1 2 3\n"),
        obj("some without area", &format!("{PLANE}f 1 1 2\nf 1 2 2\nv 0.5 0 0\nf 1 5 2\n")),
        obj("slivers", &slivers()),
        obj("overhang", &on_plane(0.2, 0.5, BOX)),
        obj("closed cavity", &on_plane(0.0, 0.5, BOX)),
        obj("roof over all", &format!("{PLANE}v 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nf 5 6 7 8\nf 8 7 6 5\n")),
        obj("tile with holes", "v .1 .1 0\nv .6 .1 0\nv .6 .6 .1\nv .1 .6 0\nf 1 2 3 4\n"),
        obj("upright wall alone", "v .5 0 0\nv .5 1 0\nv .5 1 1\nv .5 0 1\nf 1 2 3 4\n"),
        obj("normals against faces", &format!("vn 0 0 -1\n{}", PLANE.replace("1 2 3 4", "1//1 2//1 3//1 4//1"))),
        obj("normals without length", &format!("vn 0 0 0\n{}", PLANE.replace("1 2 3 4", "1//1 2//1 3//1 4//1"))),
        obj(
            "seam between tiles",
            "v .7 0 0\nv 1.7 0 0\nv 1.7 1 0\nv .7 1 0\nv 1.2 .5 .3\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n",
        ),
    ]
    .concat()
}

fn brdf(name: &'static str, brdf: &str) -> Case {
    Case { family: "BRDFs", name, tile: PYRAMIDS.to_owned(), brdf: brdf.to_owned(), mesh: None }
}

pub fn brdfs() -> Vec<Case> {
    vec![
        brdf("black", r#"{ kind = "lambertian", albedo = 0 }"#),
        brdf("white", WHITE),
        brdf("gains energy", r#"{ kind = "lambertian", albedo = 3 }"#),
        brdf("Cook-Torrance 1e-4", r#"{ kind = "cook_torrance", roughness = 1e-4, f0 = 1 }"#),
        brdf("Cook-Torrance 0.01", r#"{ kind = "cook_torrance", roughness = 0.01, f0 = 1 }"#),
        brdf("Cook-Torrance 0.2", r#"{ kind = "cook_torrance", roughness = 0.2, f0 = 1 }"#),
        brdf("Cook-Torrance 1", r#"{ kind = "cook_torrance", roughness = 1, f0 = 1 }"#),
        brdf("grazing Fresnel", r#"{ kind = "cook_torrance", roughness = 0.4, f0 = 0 }"#),
        brdf("GGX 1e-4", r#"{ kind = "ggx", roughness = 1e-4, f0 = 1 }"#),
        brdf("GGX 0.1", r#"{ kind = "ggx", roughness = 0.1, f0 = 1 }"#),
        brdf("GGX 1", r#"{ kind = "ggx", roughness = 1, f0 = 1 }"#),
        brdf("Ward 1e-4", r#"{ kind = "ward", roughness = 1e-4, specular = 1 }"#),
        brdf("Ward 1", r#"{ kind = "ward", roughness = 1, specular = 1 }"#),
        brdf("Blinn-Phong 1", r#"{ kind = "blinn_phong", exponent = 1, specular = 1 }"#),
        brdf("Blinn-Phong 1e3", r#"{ kind = "blinn_phong", exponent = 1e3, specular = 1 }"#),
        brdf("Blinn-Phong 1e6", r#"{ kind = "blinn_phong", exponent = 1e6, specular = 1 }"#),
        brdf(
            "sum of all",
            r#"[{ kind = "lambertian", albedo = 0.2 }, { kind = "ggx", roughness = 0.5, f0 = 0.1 }, { kind = "ward", roughness = 0.3, specular = 0.2 }]"#,
        ),
    ]
}
