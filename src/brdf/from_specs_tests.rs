use super::*;

fn build(toml: &str, base_dir: &Path, cache: &mut MeasuredCache) -> Result<Brdf> {
    #[derive(serde::Deserialize)]
    struct Wrapper {
        brdf: BrdfSpec,
    }
    let wrapper: Wrapper = toml::from_str(toml).unwrap();
    Brdf::from_specs(&wrapper.brdf, base_dir, cache)
}

#[test]
fn one_term_and_a_list_become_terms() {
    let mut cache = MeasuredCache::default();
    let one = "brdf = { kind = 'ggx', roughness = 0.2, f0 = [0.9, 0.6, 0.3] }";
    assert!(matches!(build(one, Path::new(""), &mut cache).unwrap().terms[..], [Term::Ggx { .. }]));
    let two = "brdf = [{ kind = 'lambertian', albedo = [0.5, 0.5, 0.5] }, { kind = 'ward', roughness = 0.3, specular = [1.0, 1.0, 1.0] }]";
    assert_eq!(build(two, Path::new(""), &mut cache).unwrap().terms.len(), 2);
}

#[test]
fn numbers_out_of_range_are_refused_by_field() {
    let cases = [
        (
            "kind = 'ggx', roughness = 0.0, f0 = [1.0, 1.0, 1.0]",
            "brdf.roughness: found 0, expected a number from 0.0001 to 2",
        ),
        ("kind = 'ward', roughness = nan, specular = [1.0, 1.0, 1.0]", "brdf.roughness: found NaN"),
        ("kind = 'lambertian', albedo = [0.5, -0.1, 0.5]", "brdf.albedo: found -0.1"),
        ("kind = 'blinn_phong', exponent = inf, specular = [1.0, 1.0, 1.0]", "brdf.exponent: found inf"),
    ];
    for (spec, message) in cases {
        let error = build(&format!("brdf = {{ {spec} }}"), Path::new(""), &mut MeasuredCache::default()).unwrap_err();
        assert!(error.to_string().contains(message) && error.exit_code() == 2, "{error}");
    }
    let empty = Brdf::from_specs(&BrdfSpec::Sum(Vec::new()), Path::new(""), &mut MeasuredCache::default());
    assert!(empty.unwrap_err().to_string().contains("at least one term"));
}

#[test]
fn a_measured_file_is_read_once_until_it_changes() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("white.binary");
    let mut bytes: Vec<u8> = [90_i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    bytes.extend(std::iter::repeat_n(1000.0_f64.to_le_bytes(), 3 * 90 * 90 * 180).flatten());
    std::fs::write(&path, &bytes).unwrap();
    let mut cache = MeasuredCache::default();
    let spec = "brdf = { kind = 'merl', path = 'white.binary' }";
    let mut table = || build(spec, directory.path(), &mut cache).map(|brdf| brdf.terms[0].measured().cloned().unwrap());
    let (first, second) = (table().unwrap(), table().unwrap());
    assert!(std::sync::Arc::ptr_eq(&first, &second));
    bytes.pop();
    std::fs::write(&path, &bytes).unwrap();
    assert!(table().unwrap_err().to_string().contains("found 34992011 bytes"));
    std::fs::remove_file(&path).unwrap();
    assert!(table().unwrap_err().to_string().contains("white.binary"));
}
