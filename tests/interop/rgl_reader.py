"""A reader of RGL tensor files in numpy, written from the published layout (Dupuy and Jakob 2018). It requires of a file what
pbrt-v4 and brdf-loader require, and evaluates it as they do. The checks share this module.
"""

import struct

import numpy as np

DTYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8", 9: "<f2", 10: "<f4", 11: "<f8"}


def fields(path):
    """Returns the arrays of a file by name."""
    data = open(path, "rb").read()
    assert data[:12] == b"tensor_file\0" and data[12:14] == b"\1\0", data[:14]
    (count,), at, found = struct.unpack_from("<I", data, 14), 18, {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, at)
        name = data[at + 2 : at + 2 + length].decode()
        ndim, dtype, offset = struct.unpack_from("<HBQ", data, at + 2 + length)
        at += 2 + length + 11
        shape = struct.unpack_from(f"<{ndim}Q", data, at)
        at += 8 * ndim
        found[name] = np.frombuffer(data, DTYPES[dtype], int(np.prod(shape)), offset).reshape(shape)
    return found


def check_structure(found, colors="rgb"):
    """Returns the reasons for which brdf-loader refuses a file."""
    other = {"rgb": "spectra", "spectra": "rgb"}[colors]
    assert other not in found, "RGB and spectral variants refuse each other's files"
    phis, thetas = len(found["phi_i"]), len(found["theta_i"])
    for name, ndim in [("theta_i", 1), ("phi_i", 1), ("ndf", 2), ("sigma", 2), ("vndf", 4), ("luminance", 4), (colors, 5)]:
        assert found[name].dtype == "<f4" and found[name].ndim == ndim, name
    for name in ["description", "jacobian"]:
        assert found[name].dtype == "u1" and found[name].ndim == 1, name
    luminance, values = found["luminance"], found[colors]
    assert found["vndf"].shape[:2] == luminance.shape[:2] == values.shape[:2] == (phis, thetas)
    assert luminance.shape[2] == luminance.shape[3] and values.shape[3:] == luminance.shape[2:]
    assert values.shape[2] == (3 if colors == "rgb" else len(found["wavelengths"])) and len(found["jacobian"]) == 1
    span = found["phi_i"][-1] - found["phi_i"][0]
    assert phis <= 2 or round(2 * np.pi / float(span)) == 1, "a reduction of 1"
    for name in ["vndf", "luminance"]:
        assert (found[name] >= 0).all() and (found[name].sum((2, 3)) > 0).all(), f"a slice of {name} is all zero"


def bilinear(values, at):
    """Interpolates arrays [..., y, x] at points of the unit square, whose vertices hold the values."""
    height, width = values.shape[-2:]
    x, y = np.clip(at[:, 0], 0, 1) * (width - 1), np.clip(at[:, 1], 0, 1) * (height - 1)
    left, low = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    x, y, flat = x - left, y - low, values.reshape(-1, height, width)
    first = np.arange(len(at)) if len(flat) == len(at) else np.zeros(len(at), int)
    row = lambda dy: (1 - x) * flat[first, low + dy, left] + x * flat[first, low + dy, left + 1]
    return (1 - y) * row(0) + y * row(1)


class Rgl:
    """A table that evaluates as pbrt-v4 and brdf-loader do: `f(i, o)` is the BRDF times the cosine of `o`."""

    def __init__(self, path, colors="rgb"):
        self.fields = fields(path)
        check_structure(self.fields, colors)
        self.values = self.fields[colors]
        vndf = self.fields["vndf"].astype(float)
        along = np.cumsum(0.5 * (vndf[..., 1:] + vndf[..., :-1]), axis=-1)
        along = np.concatenate([np.zeros_like(along[..., :1]), along], axis=-1)
        over = np.cumsum(0.5 * (along[..., 1:, -1] + along[..., :-1, -1]), axis=-1)
        over = np.concatenate([np.zeros_like(over[..., :1]), over], axis=-1)
        total = over[..., -1:]
        self.vndf, self.along, self.over = vndf / total[..., None], along / total[..., None], over / total

    def slices(self, phi, theta):
        """Returns four slices per direction, and their weights."""
        def between(axis, at):
            lower = np.clip(np.searchsorted(axis, at, side="right") - 1, 0, len(axis) - 2)
            return lower, np.clip((at - axis[lower]) / (axis[lower + 1] - axis[lower]), 0, 1)

        p, u = between(self.fields["phi_i"].astype(float), phi)
        t, v = between(self.fields["theta_i"].astype(float), theta)
        return [((p + a, t + b), (u if a else 1 - u) * (v if b else 1 - v)) for a in (0, 1) for b in (0, 1)]

    def invert(self, slices, at):
        """Returns the uniform numbers that the warp of the interpolated slices maps to points of the unit square."""
        height, width = self.vndf.shape[2:]
        x, y = at[:, 0] * (width - 1), at[:, 1] * (height - 1)
        column, row = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
        x, y = x - column, y - row
        mix = lambda of: sum(weight * of(*index) for index, weight in slices)
        part = lambda a, b, t: t * (a + 0.5 * t * (b - a))
        totals, partial = [], []
        for r in (row, row + 1):
            totals.append(mix(lambda p, t: self.along[p, t, r, -1]))
            a, b = (mix(lambda p, t: self.vndf[p, t, r, column + k]) for k in (0, 1))
            partial.append(mix(lambda p, t: self.along[p, t, r, column]) + part(a, b, x))
        below = mix(lambda p, t: self.over[p, t, row])
        across = ((1 - y) * partial[0] + y * partial[1]) / np.maximum((1 - y) * totals[0] + y * totals[1], 1e-300)
        return np.stack([across, below + part(*totals, y)], axis=1)

    def __call__(self, i, o):
        h = i + o
        h /= np.linalg.norm(h, axis=1, keepdims=True)
        unit = lambda v: np.stack([np.sqrt(np.arctan2(np.hypot(v[:, 0], v[:, 1]), v[:, 2]) * 2 / np.pi), (np.arctan2(v[:, 1], v[:, 0]) + np.pi) / (2 * np.pi)], 1)
        u_i, u_m = unit(i), unit(h)
        slices = self.slices(u_i[:, 1] * 2 * np.pi - np.pi, u_i[:, 0] ** 2 * np.pi / 2)
        at = self.invert(slices, u_m)
        channels = [
            sum(weight * bilinear(self.values[index[0], index[1], c], at) for index, weight in slices)
            for c in range(self.values.shape[2])
        ]
        scale = bilinear(self.fields["ndf"], u_m) / (4 * bilinear(self.fields["sigma"], u_i))
        return np.maximum(np.stack(channels, 1), 0) * scale[:, None]
