"""Training crops on disk, independent of the units of light and length.

Crops are scaled by the exposure and the median depth of their whole image, as in inference. Variances are averaged over
RGB and stored as standard deviations. All values are float16, whose relative error of 0.0005 is far below the noise.
Files are named SCENE--VARIANT-ANYTHING.npz.
"""

import pathlib

import numpy as np

from . import normalise

# Scenes without training data.
HELD_OUT = ("gems", "lamp")

LARGEST = 6e4  # below float16's maximum, 65504


def save(path, stack, box=None):
    """Write the part `box` = (y0, x0, side) of a stack (see normalise.py) with its `reference`; returns False if its values
    are not finite or too large."""
    scale, middle = normalise.exposure(stack["levels"]), normalise.median_depth(stack["depth"])
    y, x, side = box or (0, 0, None)
    cut = np.s_[..., y : y + side, x : x + side] if side else np.s_[...]
    colour = np.s_[..., y : y + side, x : x + side, :] if side else np.s_[...]
    levels, reference = stack["levels"][colour] * scale, stack["reference"][colour] * scale
    if not (np.isfinite(levels).all() and np.isfinite(reference).all()) or max(levels.max(), reference.max()) > LARGEST:
        return False
    deviations = np.sqrt(np.maximum(normalise.finite(stack["variances"][colour]), 0).mean(-1)) * scale
    depth = stack["depth"][cut] / middle
    depth = np.where(np.isfinite(depth) & (stack["depth"][cut] < normalise.BACKGROUND_DEPTH), depth, np.inf)
    arrays = {
        "levels": levels,
        "deviations": deviations.clip(0, LARGEST),
        "albedo": normalise.finite(stack["albedo"][colour]),
        "normal": normalise.finite(stack["normal"][colour]),
        "depth": np.where(depth < LARGEST, depth, np.inf),
        "reference": reference,
    }
    np.savez_compressed(path, **{k: v.astype(np.float16) for k, v in arrays.items()})
    return True


def load(path):
    """(input tensor, levels [m, 3, h, w], reference [3, h, w]), float32."""
    crop = {k: v.astype(np.float32) for k, v in np.load(path).items()}
    crop["variances"] = crop.pop("deviations")[..., None] ** 2
    image = normalise.tensor(crop, scale=1, middle=1)
    return image, crop["levels"].transpose(0, 3, 1, 2), crop["reference"].transpose(2, 0, 1)


def files(folder):
    """The sorted crops of a folder, {scene: [files]}."""
    scenes = {}
    for file in sorted(pathlib.Path(folder).glob("*.npz")):
        scenes.setdefault(file.stem.split("--")[0], []).append(file)
    return scenes


def held_out(scenes, names):
    """The crops that training must not use, {scene: [files]}: all of the scenes `names`, and variant 0 (the unchanged
    scene) of every other scene."""
    chosen = {
        s: [f for f in files if s in names or f.stem.split("--")[1].split("-")[0] == "0"] for s, files in scenes.items()
    }
    return {s: files for s, files in chosen.items() if files}
