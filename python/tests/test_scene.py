"""Scenes: keys, errors, copies and pickles."""

import copy
import pickle
from types import MappingProxyType

import numpy as np
import pytest

import biscale as bs
from conftest import pairs

WI, WO = pairs(50)


def test_a_key_is_read_and_set_as_the_command_line_does():
    scene = bs.Scene("default")
    assert scene["tile.geometry.kind"] == "grooves"
    scene["tile.geometry.depth"] = 0.1
    assert scene["tile.geometry.depth"] == 0.1
    scene.set({"material.default.brdf.roughness": np.float32(0.25), "material.*.color": [0.5, 0.25, 1]})
    assert scene["material.default.brdf"]["roughness"] == 0.25
    assert scene["material.default.color"] == [0.5, 0.25, 1.0]
    scene["material.default.brdf"] = {"kind": "lambertian", "albedo": 0.5}
    assert scene["material.default.brdf.kind"] == "lambertian"
    assert scene["color_map"] is None


def test_a_scene_survives_its_text():
    scene = bs.Scene("fig7a_shot_silk")
    scene["tile.geometry.warp_width"] = 0.7
    again = bs.Scene.parse(scene.to_toml())
    assert again.to_toml() == scene.to_toml()


def test_a_copy_is_independent():
    scene = bs.Scene("default")
    for other in [scene.copy(), copy.copy(scene), copy.deepcopy(scene)]:
        other["quality.seed"] = 9
        assert scene["quality.seed"] != 9


def test_the_fields_are_the_catalogue_with_the_values_of_the_scene():
    fields = {field["key"]: field for field in bs.Scene("fig4b_bicolor_cup").fields()}
    depth = fields["tile.geometry.depth"]
    assert depth["unit"] == "tile units" and depth["type"] == "number" and depth["doc"]
    assert depth["range"][0] <= depth["value"] <= depth["range"][1]
    assert "grooves" in fields["tile.geometry.kind"]["choices"]


def test_all_shipped_scenes_open():
    scenes = bs.scenes()
    assert len(scenes) >= 29
    for name, description in scenes.items():
        assert bs.Scene(name).name == name and len(description) > 20


@pytest.mark.parametrize(
    "act, field, hint",
    [
        (lambda scene: scene["tile.geometry.dept"], "tile.geometry.dept", "did you mean `tile.geometry.depth`?"),
        (lambda scene: scene.set({"tile.geometry.depth": "deep"}), "tile.geometry.depth", None),
        (lambda scene: scene.set({"tile.geometry.depth": -1}), "tile.geometry.depth", None),
        (lambda scene: scene.set({"tile.geometry.depth": object()}), "tile.geometry.depth", None),
        (lambda scene: scene.effective(quality="best"), "quality.preset", None),
        (lambda scene: scene.effective(effects={"nothing": "on"}), "effects", None),
        (lambda scene: scene.effective(effects={"interreflection": "of"}), "effects", None),
        (lambda scene: scene.effective(backend="gpu"), "quality.backend", None),
        (lambda scene: bs.mirror_biased_pairs(2**62, 1), "count", None),
        (lambda scene: bs.from_angles([0.1, np.nan], 0.0), "theta, phi[1]", None),
        (lambda scene: scene.reference(WI, WO, target=2.0), "target", None),
    ],
)
def test_bad_input_names_the_field_what_was_found_and_what_was_expected(act, field, hint):
    scene = bs.Scene("fig4b_bicolor_cup")
    before = scene.to_toml()
    with pytest.raises(bs.InputError) as raised:
        act(scene)
    error = raised.value
    assert isinstance(error, ValueError) and isinstance(error, bs.Error)
    assert error.field == field and error.found and error.expected and error.found in str(error)
    assert hint is None or error.hint == hint
    assert scene.to_toml() == before
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.field, again.hint) == (str(error), error.field, error.hint)


def test_edits_and_effects_are_any_mapping_and_keys_are_in_a_scene():
    scene = bs.Scene("fig4b_bicolor_cup")
    scene.set(MappingProxyType({"tile.geometry.depth": 0.3}))
    assert scene["tile.geometry.depth"] == 0.3
    scene.effective(quality="draft", effects=MappingProxyType({"interreflection": "off"}))
    assert "quality.facets" in scene and scene["quality.facets"] is None and "quality.facet" not in scene


def test_progress_does_not_fall():
    scene, parts = bs.Scene("fig4b_bicolor_cup"), []
    wi, wo = bs.mirror_biased_pairs(400, 1)
    scene.reference(wi, wo, target=5e-3, progress=parts.append)
    assert parts == sorted(parts) and max(parts) > 0.0, parts


def test_a_bad_file_is_named(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("[tile]\ngeometry = { kind = 'grooves', dept = 0.1 }\n")
    with pytest.raises(bs.InputError) as raised:
        bs.Scene(path)
    assert raised.value.file == str(path) and "line 2" in raised.value.field
    with pytest.raises(bs.InputError):
        bs.Scene("no_such_scene")


def test_a_pickle_holds_the_files_of_the_scene(tmp_path):
    import zlib, struct  # noqa: E401

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = b"".join(b"\0" + bytes((7 * x * y) % 256 for x in range(16)) for y in range(16))
    header = struct.pack(">IIBBBBB", 16, 16, 8, 0, 0, 0, 0)
    image = tmp_path / "heights.png"
    image.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    )
    path = tmp_path / "scene.toml"
    path.write_text("[tile]\ngeometry = { kind = 'heightfield', path = 'heights.png', height_scale = 0.2 }\n")
    scene = bs.Scene(path)
    values = scene.effective(quality="draft").eval(WI, WO)
    data = pickle.dumps(scene)
    image.unlink()
    again = pickle.loads(data)
    assert again.name == "scene"
    np.testing.assert_array_equal(again.effective(quality="draft").eval(WI, WO), values)


def test_a_change_runs_only_what_depends_on_it():
    scene = bs.Scene("default")
    first = scene.effective(quality="draft", backend="cpu").times_ms
    scene["material.default.brdf.roughness"] = 0.3
    second = scene.effective(quality="draft", backend="cpu").times_ms
    assert "visibility" in first and "visibility" not in second


def test_values_that_contain_themselves_and_numbers_beyond_64_bits_name_their_key():
    scene = bs.Scene("default")
    loop = []
    loop.append(loop)
    with pytest.raises(bs.InputError, match="contains itself"):
        scene["tile.size"] = loop
    with pytest.raises(bs.InputError, match="quality.seed.*64 bits"):
        scene["quality.seed"] = 10**30
