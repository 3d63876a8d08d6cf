"""Errors of pictures against two independent halves of a reference, whose own noise cancels."""

import json

import flip_evaluator
import numpy as np
import OpenEXR

# The share of pixels, the worst ones, that trimmed errors leave out.
TRIM = 0.005


class Layers:
    """The layers of an EXR file, as arrays of shape (rows, columns, 3)."""

    def __init__(self, path):
        with OpenEXR.File(str(path), separate_channels=True) as file:
            self.channels = {name: channel.pixels for name, channel in file.channels().items()}
            self.header = dict(file.header())

    def get(self, name, components="RGB"):
        """A layer by name, the picture itself by the empty name; None if the file does not have it."""
        names = [f"{name}.{component}" if name else component for component in components]
        if not all(name in self.channels for name in names):
            return None
        return np.stack([self.channels[name] for name in names], -1).astype(np.float32)

    def manifest(self, name):
        """The identifiers, as hexadecimal texts, of a Cryptomatte layer by name of object or material."""
        keys = [key for key, value in self.header.items() if key.startswith("cryptomatte/") and value == name]
        return json.loads(self.header[keys[0].removesuffix("name") + "manifest"])

    def smooth(self):
        """Which pixels show smooth glass or a mirror, as `caustique compare` finds them."""
        ids, names = self.manifest("CryptoMaterial"), json.loads(self.header["caustique"])["smooth_materials"]
        wanted = np.array([int(ids[name], 16) for name in names], np.uint32)
        ranks = [self.channels[f"CryptoMaterial{index:02}.{pair[0]}"] for index in range(3) for pair in ("rg", "ba")]
        shares = [self.channels[f"CryptoMaterial{index:02}.{pair[1]}"] for index in range(3) for pair in ("rg", "ba")]
        ids = [np.ascontiguousarray(rank, np.float32).view(np.uint32) for rank in ranks]
        return sum(np.where(np.isin(of, wanted), share, 0) for of, share in zip(ids, shares, strict=True)) > 0.5


def write(path, **layers):
    """Writes an EXR file of layers with three components: X Y Z for `normal`, else R G B; `picture` is the root layer."""
    channels = {}
    for name, values in layers.items():
        for i, component in enumerate("XYZ" if name == "normal" else "RGB"):
            channels[component if name == "picture" else f"{name}.{component}"] = np.ascontiguousarray(
                values[..., i], np.float32
            )
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))


def window_means(values, counted):
    """For each pixel, the mean over the counted ones of the 3 x 3 pixels around it."""

    def total(array):
        array = np.pad(array, [(1, 1), (1, 1)] + [(0, 0)] * (array.ndim - 2))
        rows = array[:-2] + array[1:-1] + array[2:]
        return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]

    count = total(counted.astype(float))
    return total(np.where(counted[..., None], values, 0.0)) / np.maximum(count, 1.0)[..., None]


def keep_best(values, counted):
    """Indices, among the counted pixels, of all but the share TRIM with the largest values."""
    values = values[counted]
    return np.sort(np.argsort(values, kind="stable")[: len(values) - int(TRIM * len(values))])


class Reference:
    """Two independent halves of a reference, and errors of pictures against them, also inside glass and mirrors: of the
    pixels `inside`, if there are any."""

    inside = None

    def __init__(self, first, second):
        self.halves = [half.astype(float) for half in (first, second)]
        self.mean = (self.halves[0] + self.halves[1]) / 2
        self.finite = np.isfinite(self.mean).all(-1)
        self.weight = 1.0 / (np.where(self.finite, self.mean.mean(-1), 0.0) ** 2 + 0.01)
        difference = np.where(self.finite[..., None], self.halves[0] - self.halves[1], 0.0)
        # The variance of the mean is a quarter of the squared difference of the halves.
        self.error = float((np.square(difference).mean(-1) * self.weight)[self.finite].mean() / 4)

    @classmethod
    def read(cls, folder):
        """Reads the halves from a folder that references.py has written."""
        return cls(*(Layers(folder / f"half{half}.exr").get("") for half in (1, 2)))

    def measure(self, picture):
        """The errors of a picture by name. Errors below the reference's noise may come out negative."""
        counted = np.isfinite(picture).all(-1) & self.finite
        picture = np.where(counted[..., None], picture, self.mean).astype(float)
        first, second = (picture - half for half in self.halves)
        error = (first * second).mean(-1) * self.weight
        kept = keep_best(np.square(picture - self.mean).mean(-1) * self.weight, counted)
        first, second = (half - window_means(half, counted) for half in (first, second))
        rough = ((first * second).mean(-1) * self.weight)[counted]
        # Window means spread errors of bright pixels into dark neighbours, where relative errors are large: without
        # trimming, the edges of lights dominate the grain.
        smooth = keep_best(np.square((first + second) / 2).mean(-1) * self.weight, counted)
        ratio, ratio_error = self._mean_ratio(picture, counted)
        flips = self._flips(picture, counted)
        inside = None if self.inside is None else self.inside[counted]
        within = {"flip_inside": flips[inside], "grain_inside": rough[inside]} if np.any(inside) else {}
        return {
            "relmse": float(error[counted].mean()),
            "relmse_trimmed": float(error[counted][kept].mean()),
            "flip": float(flips.mean()),
            "grain": float(rough.mean()),
            "grain_trimmed": float(rough[smooth].mean()),
            "mean_ratio": ratio,
            "mean_ratio_error": ratio_error,
            "pixels_not_finite": int((~counted).sum()),
            **{name: float(values.mean()) for name, values in within.items()},
        }

    def _mean_ratio(self, picture, counted):
        """The picture's mean over the reference's, and its standard error for independent errors of pixels."""
        whole = self.mean[counted].mean()
        if whole == 0:
            return None, None
        squares = np.square(picture - self.mean).mean(-1)[counted]
        return float(picture[counted].mean() / whole), float(np.sqrt(squares.mean() / counted.sum()) / whole)

    def _flips(self, picture, counted):
        show = [
            np.ascontiguousarray(np.where(counted[..., None], np.maximum(x, 0.0), 0.0), np.float32)
            for x in (self.mean, picture)
        ]
        flips = flip_evaluator.evaluate(*show, "HDR", inputsRGB=False, applyMagma=False)[0]
        return np.asarray(flips).reshape(counted.shape)[counted]
