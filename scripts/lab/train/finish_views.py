"""The windows of finish_data.py as training samples."""

from pathlib import Path

import numpy as np

from . import views
from .data import LARGEST, manifest
from .finish_data import METHODS, clean_name, file_name
from .views import mapped

# Input planes, in order: groups with their numbers of planes. src/finish/network.rs makes the same ones.
# Radiance is in units of the mean of the picture, the iterations are a logarithm of base 2.
PLANES = {
    "mean": 3,
    "denoised": 3,
    "deviation": 1,
    "reach": 3,
    "albedo": 3,
    "normal": 3,
    "depth": 1,
    "effects": 5,
    "correlation": 1,
    "iterations": 1,
    "whole": 3,
}
# Version of these planes, in the metadata of network files.
VERSION = 2
# Share of the samples without additive parts, which a picture to finish may lack.
WITHOUT_EFFECTS = 0.1


def files(folder, held_out, methods=tuple(METHODS)):
    """The finished windows (folder of a view, method) of held-out views, or of all others."""
    found = []
    for view in manifest(folder).values():
        present = [method for method in methods if clean_name(method) in view["files"]]
        found += [(Path(folder) / "views" / view["view"], method) for method in present if view["held_out"] == held_out]
    return found


def read(item):
    """The arrays of a window by name, the two independent halves of its target, `halves`, and their denoised mean,
    `clean`."""
    folder, method = item
    files = [file_name(method), f"{method}-target.npz", clean_name(method)]
    return {key: array for file in files for key, array in mapped(folder / file).items()}


def sample(stack):
    """The input [planes, h, w] of the network for a stack, its targets [3, 3, h, w]: two halves and their denoised mean,
    and the share of transmitted light [1, h, w]."""
    height, width = stack["depth"].shape
    stack = stack | {"iterations": np.full((height, width), np.log2(stack["iterations"]), np.float32)}
    stack["depth"] = np.minimum(stack["depth"], np.float32(LARGEST))
    planes = lambda x: x.reshape(-1, height, width) if x.shape[-2:] == (height, width) else np.moveaxis(x, -1, -3)
    image = np.concatenate([planes(stack[name]) for name in PLANES]).astype(np.float32)
    # Sums with negative weights are not radiance.
    image[:6], image[-3:] = np.maximum(image[:6], 0), np.maximum(image[-3:], 0)
    targets = np.concatenate([planes(stack["halves"]).reshape(2, 3, height, width), planes(stack["clean"])[None]])
    return image, targets.astype(np.float32), stack["transmission"][None]


class Pool(views.Pool):
    """Random samples of all windows; those that are finished later join within a minute."""

    open = staticmethod(read)

    def __init__(self, folder):
        super().__init__(folder, tuple(METHODS), None, None)

    def files(self):
        return files(self.folder, False)

    def sample(self, arrays, rng, side, version):
        part = views.random_part(arrays, rng, side)
        stack = views.augment(views.snapshot(arrays, rng.integers(len(arrays["iterations"])), part=part), rng)
        if rng.random() < WITHOUT_EFFECTS:
            stack["effects"], stack["denoised"] = np.zeros_like(stack["effects"]), stack["whole"]
        return sample(stack)
