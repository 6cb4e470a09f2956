"""A BSDF for Mitsuba 3 that computes the effective BRDF of a scene and reads it from a table.

>>> import mitsuba as mi
>>> mi.set_variant("scalar_rgb")
>>> import biscale.mitsuba
>>> bsdf = mi.load_dict({"type": "biscale", "scene": "fig7a_shot_silk", "tile_geometry_warp_width": 0.8})  # doctest: +SKIP

Importing this module registers the plugin in the selected variant, and in every variant that is selected later. Keys of the scene are
written with underscores, because Mitsuba keeps dots for the names of objects. `mi.traverse` shows the keys that are numbers or colours,
and a change computes the table again. The material's x axis is the first tangent of the shading frame.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from . import InputError, Scene
from ._core import _renderer_tables

__all__ = ["register"]

#: Numbers of θ_h, φ_h, φ_d and θ_d of the table.
GRID = (33, 64, 16, 12)
#: Steps of the polar angle of the table of projected areas.
AREA_STEPS = 60
#: Part of the directions that a cosine lobe draws.
COSINE_PART = 0.1
#: Least value of G [1/sr] above the horizon.
LEAST = 1e-9
#: Properties of the plugin that are no keys of the scene.
OPTIONS = ("scene", "quality", "seed")


def _is_scalar() -> bool:
    return bool(mi.variant().startswith("scalar"))


def _stored(values: np.ndarray[Any, Any]) -> Any:
    flat = np.ascontiguousarray(values, dtype=np.float32).ravel()
    return mi.ArrayXf(flat) if _is_scalar() else mi.Float(flat)


def _number(values: Any) -> Any:
    return mi.ArrayXf(values) if _is_scalar() else mi.Float(values)


def _read(values: Any, index: Any, active: Any) -> Any:
    return values[index] if _is_scalar() else dr.gather(mi.Float, values, index, active)


def _read_four(values: Any, index: Any, active: Any) -> Any:
    if _is_scalar():
        return mi.Vector4f(*(values[4 * index + k] for k in range(4)))
    return dr.gather(mi.Vector4f, values, index, active)


def _split(at: Any, count: int) -> tuple[Any, Any]:
    """The cell of a coordinate among `count` nodes, and the place in it."""
    low = mi.UInt32(dr.clip(at, 0, count - 2))
    return low, at - mi.Float(low)


def _around(at: Any, count: int) -> tuple[Any, Any, Any]:
    """The two nodes around a coordinate on a periodic axis, and the place between them."""
    low = mi.UInt32(dr.clip(at, 0, count - 1))
    return low, dr.select(low + 1 == count, 0, low + 1), at - mi.Float(low)


def _turns(y: Any, x: Any) -> Any:
    """The angle of (x, y) in turns, from 0 to 1."""
    angle = dr.atan2(y, x) * dr.inv_two_pi
    return dr.select(angle < 0, angle + 1, angle)


class _EffectiveBsdf:
    """The methods of the plugin. The class that has them derives from `mi.BSDF` of one variant."""

    def __init__(self, properties: Any) -> None:
        mi.BSDF.__init__(self, properties)
        flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.Anisotropic
        self.m_components, self.m_flags = [flags], flags
        self.scene = Scene(properties.get("scene", "default"))
        self.options = {"quality": properties.get("quality", "standard"), "seed": int(properties.get("seed", 1))}
        keys = {field["key"].replace(".", "_"): field["key"] for field in self.scene.fields()}
        edits = {}
        for name in properties.keys():
            if name in OPTIONS:
                continue
            if name not in keys:
                expected = "a key of the scene with underscores for dots, or one of " + ", ".join(OPTIONS)
                text = f"{self.scene.name}: {name}: found an unknown property, expected {expected}"
                raise InputError(text, field=name, found="an unknown property", expected=expected)
            edits[keys[name]] = _plain(properties[name])
        self.scene.set(edits)
        #: Keys of the scene by the names that `mi.traverse` shows, and their values.
        self.keys = {}
        self.numbers = {}
        # After an edit of a kind, the scene has other keys.
        for key in (field["key"] for field in self.scene.fields()):
            value = self.scene[key]
            if _is_numeric(value):
                name = key.replace(".", "_")
                self.keys[name], self.numbers[name] = key, _number(value)
        self._build()

    def _build(self) -> None:
        """Computes the tables."""
        brdf = self.scene.effective(backend="cpu", **self.options)
        tables = _renderer_tables(brdf, GRID)
        self.crowding = float(tables["crowding"])
        self.values = _stored(tables["values"])
        self.areas = _stored(_even(tables["areas"]))
        self.area_azimuths = tables["areas"].shape[1]
        phi, theta = tables["phi"], tables["theta"]
        self.isotropic = len(phi) == 1
        self.luminance = mi.MarginalContinuous2D2(tables["luminance"], [phi, theta], True, True)
        self.vndf = mi.MarginalContinuous2D2(tables["vndf"], [phi, theta], True, True)

    def traverse(self, callback: Any) -> None:
        for name, value in self.numbers.items():
            callback.put(name, value, mi.ParamFlags.NonDifferentiable)

    def parameters_changed(self, keys: list[str]) -> None:
        changed = {}
        for name in keys or self.numbers:
            if name in self.numbers:
                values = [float(value) for value in np.ravel(self.numbers[name])]
                old = self.scene[self.keys[name]]
                single = int(values[0]) if isinstance(old, int) else values[0]
                changed[self.keys[name]] = values if isinstance(old, list) else single
        self.scene.set(changed)
        self._build()

    def _g(self, i: Any, o: Any, active: Any) -> Any:
        """G of light and viewer, interpolated in half and difference angles."""
        rings, azimuths, phi_ds, steps = GRID
        half = i + o
        across = dr.hypot(half.x, half.y)
        length = dr.maximum(dr.norm(half), 1e-20)
        sine, cosine = across / length, dr.maximum(half.z / length, 1e-20)
        pole = across < 1e-7 * length
        scale = 1 / dr.select(pole, 1, across)
        ax, ay = dr.select(pole, 1, half.x * scale), dr.select(pole, 0, half.y * scale)
        # The light in the frame of the half vector.
        dx = cosine * (ax * i.x + ay * i.y) - sine * i.z
        dy = ax * i.y - ay * i.x
        # The square root of (1 - cos θ_d) / (1 - cos θ_max), both divided by sin θ_d.
        n, m = sine * dr.abs(dx), cosine * dr.hypot(dx, dy)
        r = dr.hypot(n, m)
        u = dr.sqrt(dr.minimum(r * (r + n) / ((1 + 0.5 * length) * cosine * cosine), 1))
        c = 1 + self.crowding
        step = 2 * u / (c + dr.sqrt(dr.maximum(c * c - 4 * self.crowding * u, 0)))
        ring = dr.sqrt(dr.minimum(sine * sine / (1 + cosine), 1))
        sign = dr.select(dy < 0, -1, 1)
        turn = dr.minimum(dr.atan2(dy * sign, dx * sign) * dr.inv_pi, 1)
        ring, t = _split(ring * (rings - 1), rings)
        first, second, a = _around(_turns(ay, ax) * azimuths, azimuths)
        left, right, d = _around(turn * phi_ds, phi_ds)
        low, x = _split(dr.minimum(step, 1) * (steps - 1), steps)
        # Catmull and Rom 1974.
        along = (
            x * (-0.5 + x * (1 - 0.5 * x)),
            1 + x * x * (-2.5 + 1.5 * x),
            x * (0.5 + x * (2 - 1.5 * x)),
            x * x * (-0.5 + 0.5 * x),
        )
        total = mi.Vector4f(0)
        for on_ring, weight_ring in ((ring, 1 - t), (ring + 1, t)):
            for azimuth, weight_azimuth in ((first, 1 - a), (second, a)):
                for phi_d, weight_phi_d in ((left, 1 - d), (right, d)):
                    start = ((on_ring * azimuths + azimuth) * phi_ds + phi_d) * (steps + 2) + low
                    weight = weight_ring * weight_azimuth * weight_phi_d
                    for node, weight_node in enumerate(along):
                        total += weight * weight_node * _read_four(self.values, start + node, active)
        # A cubic may be below zero. Mitsuba takes a value of exactly zero for a sample that is not valid.
        return mi.Color3f(*(dr.maximum(one, LEAST) for one in (total.x, total.y, total.z)))

    def _area(self, o: Any, active: Any) -> Any:
        """The visible projected area of the tile over the area of its base."""
        polar, low = _split(dr.acos(dr.clip(o.z, 0, 1)) * (2 * AREA_STEPS / dr.pi), AREA_STEPS + 1)
        first, second, a = _around(_turns(o.y, o.x) * self.area_azimuths, self.area_azimuths)
        ratio = mi.Float(0)
        for ring, weight in ((polar, 1 - low), (polar + 1, low)):
            ratio += weight * (1 - a) * _read(self.areas, ring * self.area_azimuths + first, active)
            ratio += weight * a * _read(self.areas, ring * self.area_azimuths + second, active)
        return ratio * o.z

    def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
        active &= (si.wi.z > 0) & (wo.z > 0)
        value = self._g(wo, si.wi, active) / dr.maximum(self._area(si.wi, active), 1e-6)
        return dr.select(active, value, 0)

    def _slice(self, viewer: Any) -> tuple[Any, Any]:
        """Azimuth and polar angle of the viewer, as the tables of the sampler take them, and the rotation of these."""
        phi, theta = dr.atan2(viewer.y, viewer.x), dr.acos(dr.clip(viewer.z, 0, 1))
        return mi.Point2f(0 if self.isotropic else phi, theta), phi if self.isotropic else 0

    def sample(self, context: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        active &= si.wi.z > 0
        at, rotation = self._slice(si.wi)
        drawn, _ = self.luminance.sample(sample2, at, active)
        drawn, _ = self.vndf.sample(drawn, at, active)
        theta, phi = drawn.x * drawn.x * (dr.pi / 2), (2 * drawn.y - 1) * dr.pi + rotation
        sin_theta, cos_theta = dr.sincos(theta)
        sin_phi, cos_phi = dr.sincos(phi)
        half = mi.Vector3f(cos_phi * sin_theta, sin_phi * sin_theta, cos_theta)
        cosine = dr.dot(half, si.wi)
        wo = 2 * cosine * half - si.wi
        from_cosine = sample1 < COSINE_PART
        active &= from_cosine | (cosine > 0)
        result = dr.zeros(mi.BSDFSample3f)
        result.wo = dr.select(from_cosine, mi.warp.square_to_cosine_hemisphere(sample2), wo)
        active &= result.wo.z > 0
        result.pdf = self.pdf(context, si, result.wo, active)
        active &= result.pdf > 0
        result.eta = 1.0
        result.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        result.sampled_component = mi.UInt32(0)
        value = self.eval(context, si, result.wo, active)
        return result, dr.select(active, value / dr.select(active, result.pdf, 1), 0)

    def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
        active &= (si.wi.z > 0) & (wo.z > 0)
        at, rotation = self._slice(si.wi)
        half = dr.normalize(si.wi + wo)
        theta = dr.atan2(dr.hypot(half.x, half.y), half.z)
        turn = (dr.atan2(half.y, half.x) - rotation) * dr.inv_two_pi + 0.5
        place = mi.Point2f(dr.sqrt(dr.minimum(theta * (2 / dr.pi), 1)), turn - dr.floor(turn))
        drawn, density = self.vndf.invert(place, at, active)
        density *= self.luminance.eval(drawn, at, active)
        jacobian = 8 * dr.pi**2 * place.x * dr.sin(theta) * dr.dot(si.wi, half)
        warped = dr.select(jacobian > 0, density / dr.select(jacobian > 0, jacobian, 1), 0)
        return dr.select(active, COSINE_PART * wo.z * dr.inv_pi + (1 - COSINE_PART) * warped, 0)

    def eval_pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

    def to_string(self) -> str:
        return f"biscale[scene = {self.scene.name}]"


def _make_class() -> type[Any]:
    """The plugin of the selected variant. (Mitsuba's classes do not take a second base.)"""
    methods = {name: value for name, value in vars(_EffectiveBsdf).items() if name not in ("__dict__", "__weakref__")}
    return type("EffectiveBsdf", (mi.BSDF,), methods)


def _is_numeric(value: Any) -> bool:
    """Whether a value is a number or a colour."""
    if isinstance(value, bool):
        return False
    if isinstance(value, list):
        return len(value) == 3 and all(_is_numeric(one) and not isinstance(one, list) for one in value)
    return isinstance(value, (int, float))


def _plain(value: Any) -> Any:
    """A property as a value of a scene."""
    return value if isinstance(value, (bool, int, float, str)) else [float(one) for one in np.ravel(value)]


def _even(areas: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Projected areas over the cosine at even steps of the polar angle, from those at the middles of rings and at the horizon."""
    rings, azimuths = areas.shape
    theta = np.concatenate([[0.0], (np.arange(rings - 1) + 0.5) * (np.pi / 2 / (rings - 1)), [np.pi / 2]])
    known = np.concatenate([np.full((1, azimuths), areas[0].mean()), areas])
    steps = np.linspace(0, np.pi / 2, AREA_STEPS + 1)
    return np.stack([np.interp(steps, theta, column) for column in known.T], axis=1)


_registered: set[str] = set()


def register() -> None:
    """Registers the plugin `biscale` in the selected variant of Mitsuba."""
    variant = mi.variant()
    if variant and variant not in _registered:
        _registered.add(variant)
        mi.register_bsdf("biscale", _make_class())


def _on_variant(*_: object) -> None:
    register()


register()
mi.detail.add_variant_callback(_on_variant)
