"""Triangle meshes as arrays. Lengths are metres; front faces are counter-clockwise."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Mesh:
    """positions: (n, 3); triangles: (m, 3) indices; normals: (n, 3), or None for flat faces."""

    positions: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None = None

    def flipped(self):
        """The surface with front and back exchanged."""
        return replace(self, triangles=self.triangles[:, ::-1], normals=None if self.normals is None else -self.normals)

    def without(self, triangles):
        """The mesh without these triangles."""
        return replace(self, triangles=np.delete(self.triangles, triangles, axis=0))

    def flat(self):
        """The mesh without normals and without shared vertices: one vertex for every corner."""
        corners = self.triangles.ravel()
        return Mesh(self.positions[corners], np.arange(corners.size).reshape(-1, 3))


def joined(*meshes):
    """One mesh from several, which all have normals or all have none."""
    starts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes[:-1])])
    normals = None if meshes[0].normals is None else np.concatenate([mesh.normals for mesh in meshes])
    return Mesh(
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts)]),
        normals,
    )


def quad(middle, right, up):
    """A parallelogram around `middle` with the half edges `right` and `up`; its front normal is right x up."""
    middle, right, up = (np.asarray(v, float) for v in (middle, right, up))
    corners = np.array([middle - right - up, middle + right - up, middle + right + up, middle - right + up])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def floor(half, height=0.0):
    """A horizontal square that faces up, with edges of 2 `half`."""
    return quad((0, height, 0), (half, 0, 0), (0, 0, -half))


def ceiling(half, height):
    """A horizontal square that faces down, with edges of 2 `half`."""
    return quad((0, height, 0), (half, 0, 0), (0, 0, half))


def grid(half, count, height=0.0):
    """floor() as `count` x `count` squares that share vertices."""
    at = np.linspace(-half, half, count + 1)
    x, z = np.meshgrid(at, -at)
    positions = np.stack([x, np.full_like(x, height), z], axis=-1).reshape(-1, 3)
    row, column = (index.ravel() for index in np.mgrid[:count, :count])
    a = row * (count + 1) + column
    b, c, d = a + 1, a + count + 2, a + count + 1
    return Mesh(positions, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def box(low, high):
    """A closed box that faces outwards; its faces share no vertices."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    middle, half, sides = (low + high) / 2, (high - low) / 2, []
    for axis in range(3):
        for sign in (1, -1):
            out, right, up = np.zeros((3, 3))
            out[axis], right[(axis + 1) % 3], up[(axis + 2) % 3] = sign, sign, 1
            sides.append(quad(middle + out * half, right * half, up * half))
    return joined(*sides)


def sphere(middle, radius, rings=24, smooth=True):
    """A closed sphere of `rings` rings of 2 `rings` faces around the vertical; with smooth normals, or without normals."""
    polar = np.linspace(0, np.pi, rings + 1)[1:-1]
    around = np.arange(2 * rings) * np.pi / rings
    t, p = np.meshgrid(polar, around, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1).reshape(-1, 3)
    unit = np.concatenate([unit, [[0, 1, 0], [0, -1, 0]]])
    row, column = (index.ravel() for index in np.mgrid[: rings - 2, : 2 * rings])
    after = (column + 1) % (2 * rings)
    a, b = row * 2 * rings + column, row * 2 * rings + after
    c, d = (row + 1) * 2 * rings + after, (row + 1) * 2 * rings + column
    top, bottom = len(unit) - 2, len(unit) - 1
    edge, last = np.arange(2 * rings), (rings - 2) * 2 * rings
    following = (edge + 1) % (2 * rings)
    triangles = np.concatenate(
        [
            np.stack([a, b, c], 1),
            np.stack([a, c, d], 1),
            np.stack([np.full_like(edge, top), following, edge], 1),
            np.stack([np.full_like(edge, bottom), last + edge, last + following], 1),
        ]
    )
    return Mesh(unit * radius + np.asarray(middle, float), triangles, unit if smooth else None)
