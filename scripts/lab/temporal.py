"""Errors that change from frame to frame: motion vectors, counterparts of pixels in the next frame, and flicker.

Vectors are displacements in pixels to the same surface point in another frame, as arrays of shape (rows, columns, 2)
with components to the right and downwards. Everything but `vectors` takes any such array, also one from a motion layer.
"""

from dataclasses import dataclass

import numpy as np

from .picture_errors import Layers, keep_best

# Depths of layers without a surface are larger than this.
FAR = 1e9
# Surfaces count as one if the depth is within the range of the 3 x 3 pixels around the counterpart, widened by this
# share, and the cosine of the angle between the normals is at least this.
DEPTH_TOLERANCE, MIN_NORMAL_COSINE = 0.01, 0.8


@dataclass
class Guides:
    """What a frame shows: positions in world space and camera depths of the first visible hits, normals at the first
    hits that are neither mirror nor clear glass, and the objects, as indices of `names` (-1: none)."""

    positions: np.ndarray
    depths: np.ndarray
    normals: np.ndarray
    objects: np.ndarray
    names: list

    @classmethod
    def read(cls, path):
        """Reads the guides from an EXR file with the layers P, Z, normal and CryptoObject00."""
        layers = Layers(path)
        identifiers = np.ascontiguousarray(layers.channels["CryptoObject00.r"], np.float32).view(np.uint32)
        manifest = layers.manifest("CryptoObject")
        names, objects = sorted(manifest), np.full(identifiers.shape, -1)
        for index, name in enumerate(names):
            objects[identifiers == int(manifest[name], 16)] = index
        positions, normals = layers.get("P", "XYZ").astype(float), layers.get("normal", "XYZ").astype(float)
        return cls(positions, layers.channels["Z"].astype(float), normals, objects, names)


def project(points, camera, shape):
    """The pixel coordinates (right, down) of points in world space, and their camera depths. `camera` is the transform
    to world space and the vertical field of view in radians; `shape` the rows and columns of the picture."""
    to_world, field = camera
    local = (points - to_world[:3, 3]) @ to_world[:3, :3] / np.square(to_world[:3, :3]).sum(0)
    depth = -local[..., 2]
    scale = shape[0] / 2 / np.tan(field / 2) / np.maximum(depth, 1e-12)
    return np.stack([shape[1] / 2 + scale * local[..., 0], shape[0] / 2 - scale * local[..., 1]], -1), depth


def rays(camera, shape):
    """The directions in world space, with a camera depth of one, through the centres of the pixels."""
    to_world, field = camera
    scale = 2 * np.tan(field / 2) / shape[0]
    rows, columns = np.mgrid[: shape[0], : shape[1]] + 0.5
    local = np.stack([(columns - shape[1] / 2) * scale, (shape[0] / 2 - rows) * scale, -np.ones(shape)], -1)
    return local @ to_world[:3, :3].T


@dataclass
class Moved:
    """Where a frame's pixels go in another frame: vectors, and there the camera depths and normals; `still_normals` are
    the normals as they were, for surfaces that are seen through moving glass."""

    vectors: np.ndarray
    depths: np.ndarray
    normals: np.ndarray
    still_normals: np.ndarray


def vectors(animation, guides, frame, other):
    """The motion of a frame's pixels to another frame, from the transforms of nodes and camera. A position is
    somewhere in its pixel, so the vector is the difference of two projections, not the distance to the pixel's centre.
    Deformations do not count: behind water that moves, the picture shows the ground, which stays."""
    shape = guides.depths.shape
    here, there = animation.worlds(frame), animation.worlds(other)
    nodes = {node.get("name"): index for index, node in enumerate(animation.document["nodes"])}
    positions, normals = guides.positions.copy(), guides.normals.copy()
    for index, name in enumerate(guides.names):
        if name not in nodes or np.array_equal(here[nodes[name]], there[nodes[name]]):
            continue
        shown = guides.objects == index
        move = there[nodes[name]] @ np.linalg.inv(here[nodes[name]])
        positions[shown] = positions[shown] @ move[:3, :3].T + move[:3, 3]
        normals[shown] = normals[shown] @ np.linalg.inv(move[:3, :3])
    camera, next_camera = animation.camera(frame), animation.camera(other)
    background = guides.depths > FAR
    before = guides.positions
    if background.any():
        sky = camera[0][:3, 3] + FAR * rays(camera, shape)
        before = np.where(background[..., None], sky, before)
        positions = np.where(background[..., None], sky, positions)
    start, _ = project(before, camera, shape)
    end, depths = project(positions, next_camera, shape)
    return Moved(end - start, np.where(background, guides.depths, depths), normals, guides.normals)


def neighbourhood(values, function):
    """A minimum or maximum over 3 x 3 pixels."""
    padded = np.pad(values, 1, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return function(windows, axis=(-2, -1))


def counterparts(moved, there):
    """For each pixel, the nearest row and column in the other frame, and whether that pixel shows the surface.

    The nearest pixel keeps the variance of independent noise; interpolation would lower it."""
    shape = there.depths.shape
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    finite = np.isfinite(moved.vectors).all(-1)
    steps = np.where(finite[..., None], np.clip(moved.vectors, -1e6, 1e6), 0.0)
    rows = rows + np.floor(steps[..., 1] + 0.5).astype(int)
    columns = columns + np.floor(steps[..., 0] + 0.5).astype(int)
    seen = finite & (rows >= 0) & (rows < shape[0]) & (columns >= 0) & (columns < shape[1])
    rows, columns = np.where(seen, rows, 0), np.where(seen, columns, 0)
    low, high = neighbourhood(there.depths, np.min)[rows, columns], neighbourhood(there.depths, np.max)[rows, columns]
    seen &= (moved.depths > low * (1 - DEPTH_TOLERANCE)) & (moved.depths < high * (1 + DEPTH_TOLERANCE))
    found = there.normals[rows, columns]
    seen &= agree(moved.normals, found) | agree(moved.still_normals, found)
    return rows, columns, seen


def agree(first, second):
    """Whether two arrays of normals have nearly one direction, or both none."""
    lengths = [np.linalg.norm(one, axis=-1) for one in (first, second)]
    product = lengths[0] * lengths[1]
    return ((first * second).sum(-1) >= MIN_NORMAL_COSINE * product) & ((product > 0) | (lengths[0] == lengths[1]))


def flicker(pictures, references, matches):
    """The flicker of a sequence: the root of the mean, over pixels and pairs of frames, of the squared difference
    between the error of a pixel's counterpart in the next frame and the pixel's error, relative like relMSE.

    `references` has a picture_errors.Reference for each frame; the product of the differences with the two halves
    cancels the references' noise. `matches` has `counterparts` for each frame but the last. The trimmed value leaves
    out the share picture_errors.TRIM of each pair's pixels, the ones with the largest differences. `compared` is the
    share of pixels with a counterpart."""
    sums, counts, trimmed_sums, trimmed_counts, pixels = 0.0, 0, 0.0, 0, 0
    for frame, (rows, columns, seen) in enumerate(matches):
        here, there = references[frame], references[frame + 1]
        counted = seen & here.finite & there.finite[rows, columns] & np.isfinite(pictures[frame]).all(-1)
        counted &= np.isfinite(pictures[frame + 1]).all(-1)[rows, columns]
        first, second = (
            (pictures[frame + 1] - there.halves[half])[rows, columns] - (pictures[frame] - here.halves[half])
            for half in (0, 1)
        )
        square = ((first * second).mean(-1) * here.weight)[counted]
        size = np.where(counted, np.square((first + second) / 2).mean(-1) * here.weight, 0.0)
        kept = square[keep_best(size, counted)]
        sums, counts, pixels = sums + square.sum(), counts + len(square), pixels + seen.size
        trimmed_sums, trimmed_counts = trimmed_sums + kept.sum(), trimmed_counts + len(kept)
    return {
        "flicker": float(np.sqrt(max(sums / max(counts, 1), 0.0))),
        "flicker_trimmed": float(np.sqrt(max(trimmed_sums / max(trimmed_counts, 1), 0.0))),
        "compared": counts / max(pixels, 1),
    }
