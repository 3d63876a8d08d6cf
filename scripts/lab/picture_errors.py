"""Pictures and their errors against two independent halves of a reference, whose own noise drops out."""

import flip_evaluator
import numpy as np
import OpenEXR

# The share of pixels that is left out, the worst ones.
TRIM = 0.005


class Layers:
    """The layers of an EXR file as arrays of rows, columns and three components."""

    def __init__(self, path):
        with OpenEXR.File(str(path), separate_channels=True) as file:
            self.channels = {name: channel.pixels for name, channel in file.channels().items()}

    def get(self, name, components="RGB"):
        """A layer, the picture itself where the name is empty; nothing where the file has none."""
        names = [f"{name}.{component}" if name else component for component in components]
        if not all(name in self.channels for name in names):
            return None
        return np.stack([self.channels[name] for name in names], -1).astype(np.float32)


def write(path, **layers):
    """Writes layers of three components: R G B, or X Y Z of normals; `picture` is the one without a name."""
    channels = {}
    for name, values in layers.items():
        for i, component in enumerate("XYZ" if name == "normal" else "RGB"):
            channels[component if name == "picture" else f"{name}.{component}"] = np.ascontiguousarray(
                values[..., i], np.float32
            )
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))


def around(values, counted):
    """The mean over the 3 x 3 pixels about each, of those that are there and counted."""

    def total(array):
        array = np.pad(array, [(1, 1), (1, 1)] + [(0, 0)] * (array.ndim - 2))
        rows = array[:-2] + array[1:-1] + array[2:]
        return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]

    count = total(counted.astype(float))
    return total(np.where(counted[..., None], values, 0.0)) / np.maximum(count, 1.0)[..., None]


def best(values, counted):
    """Which of the pixels that count are not among the worst by some value, as places among those that count."""
    values = values[counted]
    return np.sort(np.argsort(values, kind="stable")[: len(values) - int(TRIM * len(values))])


class Reference:
    """Two halves of a reference."""

    def __init__(self, first, second):
        self.halves = [half.astype(float) for half in (first, second)]
        self.mean = (self.halves[0] + self.halves[1]) / 2
        self.finite = np.isfinite(self.mean).all(-1)
        self.weight = 1.0 / (np.where(self.finite, self.mean.mean(-1), 0.0) ** 2 + 0.01)
        difference = np.where(self.finite[..., None], self.halves[0] - self.halves[1], 0.0)
        # A quarter of the halves' squared difference is the variance of their mean.
        self.error = float((np.square(difference).mean(-1) * self.weight)[self.finite].mean() / 4)

    @classmethod
    def read(cls, folder):
        """The halves in a folder that _references.py has made."""
        return cls(*(Layers(folder / f"half{half}.exr").get("") for half in (1, 2)))

    def measure(self, picture):
        """The figures of a picture. Errors smaller than what the reference's noise lets see may be below zero."""
        counted = np.isfinite(picture).all(-1) & self.finite
        picture = np.where(counted[..., None], picture, self.mean).astype(float)
        first, second = (picture - half for half in self.halves)
        error = (first * second).mean(-1) * self.weight
        kept = best(np.square(picture - self.mean).mean(-1) * self.weight, counted)
        first, second = (half - around(half, counted) for half in (first, second))
        rough = ((first * second).mean(-1) * self.weight)[counted]
        # Errors of bright pixels spread into dark neighbours, where a little counts for much: edges of lamps rule the
        # grain of all pixels.
        smooth = best(np.square((first + second) / 2).mean(-1) * self.weight, counted)
        ratio, doubt = self._mean_ratio(picture, counted)
        return {
            "relmse": float(error[counted].mean()),
            "relmse_trimmed": float(error[counted][kept].mean()),
            "flip": self._flip(picture, counted),
            "grain": float(rough.mean()),
            "grain_trimmed": float(rough[smooth].mean()),
            "mean_ratio": ratio,
            "mean_ratio_error": doubt,
            "pixels_not_finite": int((~counted).sum()),
        }

    def _mean_ratio(self, picture, counted):
        """The picture's mean over the reference's, and its standard error if errors of pixels are independent."""
        whole = self.mean[counted].mean()
        if whole == 0:
            return None, None
        squares = np.square(picture - self.mean).mean(-1)[counted]
        return float(picture[counted].mean() / whole), float(np.sqrt(squares.mean() / counted.sum()) / whole)

    def _flip(self, picture, counted):
        show = [
            np.ascontiguousarray(np.where(counted[..., None], np.maximum(x, 0.0), 0.0), np.float32)
            for x in (self.mean, picture)
        ]
        flips = flip_evaluator.evaluate(*show, "HDR", inputsRGB=False, applyMagma=False)[0]
        return float(np.asarray(flips)[counted].mean())
