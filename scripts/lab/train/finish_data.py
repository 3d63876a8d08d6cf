"""Renders the training data of the finish: windows by the methods that people render with, at one bandwidth.

A view (data.py) has two windows, each by another method. Its folder has METHOD-target.npz as in data.py, and
METHOD-finish.npz with arrays by snapshot (of ITERATIONS), of float16, radiance times the exposure of the picture:

  mean, denoised  [h, w, 3]  the estimate, and the picture that the denoiser makes of it
  reach           [h, w, 3]  largest displacement of the estimate by the finish
  deviation       [h, w]     standard error of the estimate, the root mean square over RGB
  effects         [5, h, w]  additive parts of the estimate, means over RGB, in the order of data.PARTS
  albedo, normal  [h, w, 3]  guides of the denoiser with their noise
  depth           [h, w]     relative to the picture's median
  correlation     [h, w]     of the noise between neighbours (bound.py)
  transmission    [h, w]     share of light that the first hit transmits, for the weights of the loss alone
"""

import numpy as np

from . import bound, data, normalise
from .data import PARTS, rgb, small

ITERATIONS = (1, 4, 16, 64)
# Most views stop after 16 iterations, so that more views are rendered in the same time.
SHORT, LONG_SHARE, HELD_OUT_LONG_SHARE = 3, 1 / 3, 1 / 2
# Methods and the shares of windows that each has: `auto` renders most pictures by vcm.
METHODS = {"vcm": 0.4, "path": 0.2, "bdpt": 0.2, "sppm": 0.2}
METHODS_OF_VIEW = 2
LAYERS = ("beauty", "Noisy", "Variance", "Quarter", "albedo", "normal", "depth", "TransmissionColor")


def file_name(method):
    """The name of the file with the noisy stack of a window."""
    return f"{method}-finish.npz"


class View(data.View):
    """One view of the training data of the finish."""

    def __init__(self, folder, family, index, scene=None):
        super().__init__(folder, family, index, scene)
        share = HELD_OUT_LONG_SHARE if self.held_out else LONG_SHARE
        long = self.rng("finish iterations").random() < share
        self.iterations = ITERATIONS if long else ITERATIONS[:SHORT]
        rng, shares = self.rng("finish methods"), list(METHODS.values())
        self.methods = [str(name) for name in rng.choice(list(METHODS), METHODS_OF_VIEW, replace=False, p=shares)]


class Maker(data.Maker):
    """Renders views of the training data of the finish."""

    # Estimates after 64 iterations have little noise, and targets should not have more.
    target_seconds, held_out_seconds = 8.0, 12.0

    def noisy(self, view, note, scene, work):
        """Renders the noisy stacks of a view that are missing."""
        for method in view.methods:
            if (view.folder / file_name(method)).exists():
                continue
            settings = data.place(note, method) | {"method": method, "seed": 1, "denoise": "full"}
            settings["layers"] = ",".join([*LAYERS, *note["parts"]])
            if method in data.METHODS:
                settings["levels"] = 1
            if method == "sppm":
                settings["photons"] = data.PHOTONS
            arrays = self.snapshots(view, scene, work, settings, lambda picture: stack(picture, note))
            data.write(view.folder / file_name(method), arrays)
            self.store(view, note)


def stack(picture, note):
    """The arrays of a snapshot of a picture, of which `picture` has the layers."""
    scale = np.float32(note["exposure"])
    mean, samples = rgb(picture, "Noisy"), picture["iterations"]
    deviation = np.sqrt(np.where(rgb(picture, "Variance1") >= 0, rgb(picture, "Variance1"), np.inf))
    spread = bound.spread(mean, deviation, samples, picture.get("A"))
    quarters = np.stack([rgb(picture, f"Quarter{k + 1}") for k in range(4)])
    black = np.zeros(mean.shape, np.float32)
    effects = [rgb(picture, part) if part in note["parts"] else black for part in PARTS]
    transmission = rgb(picture, "TransmissionColor") if "TransmissionColor.R" in picture else black
    near = picture["depth.Z"] < normalise.BACKGROUND_DEPTH
    # No limit at all where the spread is zero would be no number.
    with np.errstate(invalid="ignore"):
        reach = np.where(spread > 0, bound.limit(samples) * spread, 0)
    return {
        "mean": small(mean * scale),
        "denoised": small(rgb(picture, "") * scale),
        "reach": small(reach * scale),
        "deviation": small(np.sqrt(np.square(deviation).mean(-1)) * scale),
        "effects": small(np.stack(effects).mean(-1) * scale),
        "albedo": small(rgb(picture, "albedo")),
        "normal": small(np.stack([picture[f"normal.{c}"] for c in "XYZ"], -1)),
        "depth": small(np.where(near, picture["depth.Z"] / note["depth"], data.LARGEST)),
        "correlation": small(bound.correlation(quarters)),
        "transmission": small(transmission.mean(-1)),
    }
