//! Valid inputs from which mutations start.

use std::io::Cursor;

use biscale::scene::shipped;

pub fn scenes() -> Vec<Vec<u8>> {
    let mut all: Vec<Vec<u8>> =
        shipped::names().filter_map(|name| shipped::source(name).map(|text| text.as_bytes().to_vec())).collect();
    all.push(b"[tile]\nsize = [1, 2]\ngeometry = { kind = \"heightfield\", values = [[0, 1], [1, 0.5]], height_scale = 0.2 }\n[[material]]\nname = \"default\"\nbrdf = [{ kind = \"ggx\", roughness = 0.4, f0 = [1, 0.8, 0.2] }, { kind = \"ward\", roughness = 0.3, specular = 0.1 }]\ncolor = [0.1, 0.2, 0.3]\n[object]\nkind = \"cup\"\n[light]\nenvironment = \"sun\"\ncount = 4\ndirectional = [{ direction = [0, 1, 0], irradiance = 2 }]\n[camera]\nazimuth_deg = 10\ndistance = 3\n[quality]\npreset = \"draft\"\nfacets = 64\nazimuths = 4\ngrid = [4, 8]\n".to_vec());
    all
}

/// Returns small scenes of every geometry, with settings that take milliseconds.
pub fn quick_scenes() -> Vec<Vec<u8>> {
    let quality = "[quality]\npreset = \"draft\"\nbackend = \"cpu\"\nfacets = 48\nazimuths = 8\nrings = 4\n";
    let geometries = [
        "kind = \"grooves\", profile = \"v\", count = 2, depth = 0.2, side_angle_deg = 50, rotation_deg = 10",
        "kind = \"grooves\", profile = \"u\", count = 1, depth = 0.3, bottom_width = 0.5",
        "kind = \"pyramids\", height = 0.2, base_size = 0.8, truncation = 0.2, face_ratio = 1.1, spacing = 0.5, sides = 5",
        "kind = \"rods\", radius = 0.1, length = 0.3, taper = 0.2, lean_deg = 20, spread_deg = 10, jitter = 0.5, count = 4",
        "kind = \"weave\", warp_width = 0.8, weft_width = 0.7, warp_height = 0.1, crimp = 0.4, warp_count = 2, weft_count = 1",
        "kind = \"flat\", pattern = \"stripes\", ratio = 0.3, count = 3",
        "kind = \"heightfield\", values = [[0, 0.5, 1], [0.3, 0.1, 0.7]], height_scale = 0.3",
    ];
    let brdfs = [
        "kind = \"cook_torrance\", roughness = 0.3, f0 = 0.9",
        "kind = \"blinn_phong\", exponent = 20, specular = 0.4",
        "kind = \"ward\", roughness = 0.2, specular = 0.4",
        "kind = \"lambertian\", albedo = [0.2, 0.4, 0.6]",
    ];
    let mut all = Vec::new();
    for (k, geometry) in geometries.iter().enumerate() {
        let text = format!(
            "[tile]\nsize = [1.0, 0.8]\ngeometry = {{ {geometry} }}\n[[material]]\nname = \"default\"\nbrdf = {{ {} }}\ncolor = \
             0.9\n{quality}",
            brdfs[k % brdfs.len()]
        );
        all.push(text.into_bytes());
    }
    let layers = [
        "driver = { kind = \"height\", noise = 0.3 }\nunit = \"value\"\nstops = [[0, 0], [0.1, [1, 0.5, 0]], [0.1, 0.2]]",
        "driver = { kind = \"slope\", azimuth_deg = 40 }\nstops = [[-1, [0.1, 0.2, 0.3]], [0.5, 1]]\nweight = { driver = { kind = \
         \"steepness\" }, stops = [[0, 0], [1, 1]] }",
        "driver = { kind = \"noise\", basis = \"gabor\", cells = 3, octaves = 2 }\nstops = [[-1, 0], [1, 1]]\nweight = 0.5",
        "driver = { kind = \"sum\", terms = [{ driver = { kind = \"height\" }, weight = 1 }, { driver = { kind = \"slope\" }, \
         weight = -2 }] }\nstops = [[0, 0], [0, 1]]",
    ];
    for (k, layer) in layers.iter().enumerate() {
        let keys = ["combine = \"product\"", "gaussianize = \"on\"", "taps = 16", "distribution = \"smith\""][k];
        let text = format!(
            "[tile]\ngeometry = {{ {} }}\n[color_map]\n{keys}\n[[color_map.layer]]\n{layer}\n{quality}",
            geometries[6]
        );
        all.push(text.into_bytes());
    }
    all
}

pub fn merl() -> Vec<Vec<u8>> {
    let header: Vec<u8> = [90_i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    let mut whole = header.clone();
    whole.extend((0..3 * 90 * 90 * 180).flat_map(|k| (200.0 + f64::from(k % 1000)).to_le_bytes()));
    // A complete file takes a second, so most seeds are headers and truncated files.
    let truncated = |bytes: usize| whole[..bytes].to_vec();
    vec![
        truncated(12),
        truncated(100),
        truncated(5000),
        truncated(0),
        header.repeat(3),
        truncated(64),
        truncated(4096),
        whole.clone(),
    ]
}

/// Returns a tensor file of fields with name, type, shape and bytes.
fn tensor_file(fields: &[(&str, u8, Vec<usize>, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = b"tensor_file\0".to_vec();
    bytes.extend([1, 0]);
    bytes.extend((fields.len() as u32).to_le_bytes());
    let table: usize = fields.iter().map(|(name, _, shape, _)| 2 + name.len() + 2 + 1 + 8 + 8 * shape.len()).sum();
    let mut offset = bytes.len() + table;
    for (name, kind, shape, data) in fields {
        bytes.extend((name.len() as u16).to_le_bytes());
        bytes.extend(name.bytes());
        bytes.extend((shape.len() as u16).to_le_bytes());
        bytes.push(*kind);
        bytes.extend((offset as u64).to_le_bytes());
        shape.iter().for_each(|n| bytes.extend((*n as u64).to_le_bytes()));
        offset += data.len();
    }
    fields.iter().for_each(|field| bytes.extend(&field.3));
    bytes
}

pub fn rgl() -> Vec<Vec<u8>> {
    let floats = |count: usize, value: &dyn Fn(usize) -> f32| -> Vec<u8> {
        (0..count).flat_map(|k| value(k).to_le_bytes()).collect()
    };
    let one = |_: usize| 1.0_f32;
    let (n, thetas) = (4, 4);
    let theta = move |k: usize| k as f32 / 3.0 * 1.5;
    let square = n * n;
    let sized = |spectral: bool| {
        let mut fields = vec![
            ("description", 1, vec![5], b"paint".to_vec()),
            ("theta_i", 10, vec![thetas], floats(thetas, &theta)),
            ("phi_i", 10, vec![1], floats(1, &|_| 0.0)),
            ("ndf", 10, vec![n, n], floats(square, &one)),
            ("sigma", 10, vec![n, n], floats(square, &one)),
            ("vndf", 10, vec![1, thetas, n, n], floats(thetas * square, &one)),
            ("luminance", 10, vec![1, thetas, n, n], floats(thetas * square, &one)),
            ("jacobian", 1, vec![1], vec![1]),
        ];
        if spectral {
            fields.push(("wavelengths", 10, vec![5], floats(5, &|k| 400.0 + 75.0 * k as f32)));
            fields.push(("spectra", 10, vec![1, thetas, 5, n, n], floats(5 * thetas * square, &one)));
        } else {
            fields.push(("rgb", 10, vec![1, thetas, 3, n, n], floats(3 * thetas * square, &|k| 0.1 + (k % 7) as f32)));
        }
        tensor_file(&fields)
    };
    vec![sized(false), sized(true)]
}

pub fn utia() -> Vec<Vec<u8>> {
    let whole: Vec<u8> = (0..3 * 288 * 288).flat_map(|k| (0.1 + f64::from(k % 13)).to_le_bytes()).collect();
    vec![whole[..64].to_vec(), Vec::new(), whole]
}

/// Returns the `.npz` export of a small isotropic material.
pub fn npz() -> Vec<Vec<u8>> {
    use biscale::export;
    use biscale::export::{ExportMeta, ExportOptions, ExportResolution};
    let text =
        "[tile]\ngeometry = { kind = \"flat\" }\n[quality]\npreset = \"draft\"\nfacets = 16\nbackend = \"cpu\"\n";
    let scene = biscale::scene::parse(text).unwrap();
    let painted = biscale::scene::Painted::default();
    let loaded = biscale::scene::LoadedScene { scene, base_dir: "".into(), name: "flat".into(), painted };
    let outcome = biscale::pipeline::Pipeline::new().effective(&loaded).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let steps = ExportResolution { theta_i: 3, phi_i: 4, theta_o: 3, phi_o: 4 };
    let options = ExportOptions { resolution: Some(steps), ..ExportOptions::default() };
    let path = folder.path().join("flat.npz");
    let meta = ExportMeta::of(&loaded, &outcome, true);
    export::write(&outcome.brdf, &meta, &options, &path, &|_| true).unwrap();
    vec![std::fs::read(path).unwrap()]
}

pub fn rigs() -> Vec<Vec<u8>> {
    let rig = "eta = 1.5\nsample_size = [0.08, 0.06]\ndistance = 0.04\nmonitor = [1, 0.9, 0.8]\nsaturation = 0.99\n\
               dots = { count = [4, 3], from = [-0.09, -0.05], to = [0.01, 0.05] }\n[[camera]]\ndirection = [1, 0, -1]\n\
               images = \"a/dot_%04d_%d.exr\"\nexposures = [0.1, 1]\ndark = \"dark.exr\"\n";
    let second = "eta = 1.4\nsample_size = [1, 1]\ndistance = 2\npixels = [8, 8]\n[dots]\npositions = [[0, 0], [1, 0]]\n\
                  [[camera]]\ndirection = [0, 0, -1]\nimages = \"%d.png\"\ncorners = [[0, 0], [9, 0], [9, 9], [0, 9]]\n\
                  [[camera]]\ndirection = [0, 0.5, -1]\nimages = \"b%d.hdr\"\n";
    vec![rig.as_bytes().to_vec(), second.as_bytes().to_vec()]
}

/// Returns a sheet of 2 x 2 pixels between two models.
pub fn svbtdfs() -> Vec<Vec<u8>> {
    use biscale::slab::capture::lobe::{LobeOptics, PointModel, SlopeGrid};
    use biscale::slab::capture::svbtdf::Svbtdf;
    let grid = SlopeGrid { side: 8, span: 0.5 };
    let model = |alpha: f64| {
        let ln_density = (0..64).map(|k| -20.0 * grid.node(k).length_squared()).collect();
        PointModel { grid, alpha, ln_density }
    };
    let sheet = Svbtdf {
        size: [2, 2],
        optics: LobeOptics::new(1.5, 0.2),
        grid,
        models: vec![model(0.2), model(0.8)],
        neighbours: 2,
        index: [0, 1].repeat(4),
        weight: [0.25, 0.75].repeat(4),
        scale: vec![glam::Vec3::ONE; 4],
        diffuse: vec![glam::Vec3::splat(0.1); 4],
        bounced: None,
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    sheet.write(&path).unwrap();
    vec![std::fs::read(path).unwrap()]
}

pub fn objs() -> Vec<Vec<u8>> {
    [
        "# a plane\nmtllib x.mtl\no plane\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\nusemtl a b\ns 1\nf 1/1/1 2/2/1 3/1/1 4/2/1\nusemtl c\nf -4 -3 -1\n",
        "v 0 0 0\nv 2 0 0\nv 2 1 0.5\nv 1 1 0\nv 1 2 0\nv 0 2 -0.5\nf 4 5 6 1 2 3\nf 1//\\\n 2 3\n",
        "v .4 .4 .2\nv .6 .4 .2\nv .5 .6 .2\nv .5 .5 .5\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

fn exr(channels_by_line: bool) -> Vec<u8> {
    use exr::prelude::{Encoding, Image, SpecificChannels, Vec2, WritableImage};
    let channels = SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32, at.y() as f32, 0.5_f32));
    let mut image = Image::from_channels((8, 5), channels);
    if channels_by_line {
        image.layer_data.encoding = Encoding::UNCOMPRESSED;
    }
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn hdr() -> Vec<u8> {
    let pixels: Vec<_> = (0..16 * 8).map(|k| image::Rgb([k as f32, 1.0, 0.25])).collect();
    let mut bytes = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 16, 8).unwrap();
    bytes
}

fn encoded(image: &image::DynamicImage, format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

pub fn heights() -> Vec<Vec<u8>> {
    let wide =
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_fn(6, 4, |x, y| image::Luma([(x * 997 + y) as u16]));
    let color = image::RgbImage::from_fn(5, 5, |x, y| image::Rgb([x as u8 * 40, y as u8 * 50, 9]));
    vec![
        encoded(&wide.into(), image::ImageFormat::Png),
        encoded(&color.clone().into(), image::ImageFormat::Png),
        encoded(&color.clone().into(), image::ImageFormat::Jpeg),
        encoded(&color.into(), image::ImageFormat::Tiff),
        exr(false),
        exr(true),
        hdr(),
    ]
}

pub fn environments() -> Vec<Vec<u8>> {
    vec![exr(false), exr(true), hdr()]
}
