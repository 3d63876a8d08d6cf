"""Reads and writes EXR pictures for the comparison: linear RGB, top row first."""

import numpy as np
import OpenEXR


def read(path):
    """The RGB picture of an EXR: (height, width, 3), 32-bit floats."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        # The picture may be in a named layer.
        prefix = "" if "R" in channels else next(name for name in channels if name.endswith(".R"))[:-1]
        return np.stack([channels[prefix + c].pixels for c in "RGB"], axis=-1).astype(np.float32)


def write(path, picture):
    """Write a picture (height, width, 3)."""
    channels = {c: np.ascontiguousarray(picture[..., i], np.float32) for i, c in enumerate("RGB")}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(str(path))


def sample(image, u, v):
    """Bilinear lookup of a latitude-longitude image at `u` and `v` (shares of width and height)."""
    height, width, _ = image.shape
    for axis, size, at in ((0, height, v * height - 0.5), (1, width, u * width - 0.5)):
        low = np.floor(at).astype(int)
        share = (at - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        index = (lambda i: np.clip(i, 0, size - 1)) if axis == 0 else (lambda i: i % size)
        image = np.take(image, index(low), axis) * (1 - share) + np.take(image, index(low + 1), axis) * share
    return image
