"""Renders the training data of the finish: windows by the methods that people render with, at one bandwidth.

A view (data.py) has two windows, each by another method. Its folder has METHOD-target.npz as in data.py, and
METHOD-finish.npz with arrays by snapshot (of ITERATIONS), of float16, radiance times the exposure of the picture:

  mean, denoised  [h, w, 3]  the estimate, and the picture that the denoiser makes of it and of its parts
  whole           [h, w, 3]  the picture that the denoiser makes of the estimate alone
  reach           [h, w, 3]  largest displacement of the estimate by the finish
  deviation       [h, w]     standard error of the estimate, the root mean square over RGB
  effects         [5, h, w]  additive parts of the estimate, means over RGB, in the order of data.PARTS
  albedo, normal  [h, w, 3]  guides of the denoiser with their noise
  depth           [h, w]     relative to the picture's median
  correlation     [h, w]     of the noise between neighbours (bound.py)
  transmission    [h, w]     share of light that the first hit transmits, for the weights of the loss alone

METHOD-clean.npz has `clean` [h, w, 3]: the mean of both halves of the target, denoised. Targets have as much noise as
pictures to finish, from which networks learn slowly; validation reads the halves.
"""

import numpy as np
import OpenEXR

from . import bound, data, normalise
from .data import PARTS, rgb, small
from ..commands import command

ITERATIONS = (1, 4, 16, 64)
# Most views stop after 16 iterations, so that more views are rendered in the same time.
SHORT, LONG_SHARE, HELD_OUT_LONG_SHARE = 3, 1 / 3, 1 / 2
# Methods and the shares of windows that each has: `auto` renders most pictures by vcm.
METHODS = {"vcm": 0.4, "path": 0.2, "bdpt": 0.2, "sppm": 0.2}
METHODS_OF_VIEW = 2
# Largest displacement of a target by the denoiser, in its standard errors over windows of this reach.
CLEANED, REACH = 5.0, 2
LAYERS = ("beauty", "Noisy", "Variance", "Quarter", "albedo", "normal", "depth", "TransmissionColor")


def file_name(method):
    """The name of the file with the noisy stack of a window."""
    return f"{method}-finish.npz"


def clean_name(method):
    """The name of the file with the denoised target of a window."""
    return f"{method}-clean.npz"


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
        """Renders the noisy stacks of a view that are missing, and denoises the targets."""
        for method in view.methods:
            if (view.folder / clean_name(method)).exists():
                continue
            settings = data.place(note, method) | {"method": method, "seed": 1, "denoise": "full"}
            settings["layers"] = ",".join([*LAYERS, *note["parts"]])
            if method in data.METHODS:
                settings["levels"] = 1
            if method == "sppm":
                settings["photons"] = data.PHOTONS
            arrays_of = lambda picture: stack(self.with_whole(picture, work), note)
            arrays = self.snapshots(view, scene, work, settings, arrays_of)
            data.write(view.folder / file_name(method), arrays)
            clean = self.clean(view.folder / f"{method}-target.npz", arrays, work)
            data.write(view.folder / clean_name(method), {"clean": clean})
            self.store(view, note)

    def with_whole(self, picture, work):
        """The channels of a picture, and Whole: its estimate denoised without parts."""
        channels = {name: value for name, value in picture.items() if name.split(".")[0] not in (*PARTS, "iterations")}
        whole = self.denoised(channels, work)
        return picture | {f"Whole.{c}": whole[..., k] for k, c in enumerate("RGB")}

    def clean(self, target, arrays, work):
        """The denoised target of a window, with the guides of its last snapshot."""
        halves = np.load(target)["halves"]
        mean, variance = halves.mean(0), np.square(halves[0] - halves[1]) / 4
        channels = {}
        for name, value in (("", mean), ("Noisy", mean), ("Variance1", variance), ("albedo", arrays["albedo"][-1])):
            channels |= {f"{name}.{c}".lstrip("."): value[..., k] for k, c in enumerate("RGB")}
        channels |= {f"normal.{c}": arrays["normal"][-1][..., k] for k, c in enumerate("XYZ")}
        most = CLEANED * np.sqrt(np.moveaxis(bound.window_means(np.moveaxis(variance, -1, 0), REACH), 0, -1))
        return (mean + (self.denoised(channels, work) - mean).clip(-most, most)).astype(np.float32)

    def denoised(self, channels, work):
        """The picture [h, w, 3] that the finish without a bound makes of channels."""
        source, out = work / "source.exr", work / "denoised.exr"
        planes = {name: np.ascontiguousarray(value, np.float32) for name, value in channels.items()}
        OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, planes).write(str(source))
        self.run(command("finish", source, "-o", out, program=self.binary, threads=1, denoise="full"))
        return rgb(data.channels_of(out), "")


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
        "whole": small(rgb(picture, "Whole") * scale),
        "reach": small(reach * scale),
        "deviation": small(np.sqrt(np.square(deviation).mean(-1)) * scale),
        "effects": small(np.stack(effects).mean(-1) * scale),
        "albedo": small(rgb(picture, "albedo")),
        "normal": small(np.stack([picture[f"normal.{c}"] for c in "XYZ"], -1)),
        "depth": small(np.where(near, picture["depth.Z"] / note["depth"], data.LARGEST)),
        "correlation": small(bound.correlation(quarters)),
        "transmission": small(transmission.mean(-1)),
    }
