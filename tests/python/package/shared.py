"""Scenes of numpy arrays that the tests of the package share."""

import sys
from pathlib import Path

import numpy as np

import caustique as cq

ROOT = Path(__file__).resolve().parents[3]
#: Translation of scenes to Mitsuba and from it.
sys.path.append(str(ROOT / "scripts" / "compare" / "peers"))
TORUS = ROOT / "scenes" / "torus.glb"


def sphere(steps=24):
    """Vertices and triangles of a closed unit sphere, seen from outside."""
    theta = np.linspace(0, np.pi, steps + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, 2 * steps, endpoint=False)
    around = np.stack([np.cos(phi), np.zeros_like(phi), -np.sin(phi)], -1)
    rings = np.sin(theta)[:, None, None] * around + np.cos(theta)[:, None, None] * np.array([0.0, 1.0, 0.0])
    vertices = np.concatenate([[[0, 1, 0]], rings.reshape(-1, 3), [[0, -1, 0]]])
    n, last = len(phi), len(vertices) - 1
    triangles = []
    for i in range(n):
        j = (i + 1) % n
        triangles.append((0, 1 + i, 1 + j))
        triangles.append((last, last - n + j, last - n + i))
        for ring in range(len(theta) - 1):
            a, b = 1 + ring * n + i, 1 + ring * n + j
            triangles += [(a, a + n, b), (b, a + n, b + n)]
    return vertices, np.array(triangles)


def square(size=2.0, y=0.0):
    """Vertices and triangles of a square that faces up."""
    h = size / 2
    return np.array([[-h, y, h], [h, y, h], [h, y, -h], [-h, y, -h]]), np.array([[0, 1, 2], [0, 2, 3]])


def ground(lights, albedo=0.6, **options):
    """A Lambertian ground seen from above."""
    matte = cq.Material(base_color=[albedo] * 3, specular=0.0)
    camera = cq.Camera(position=(0, 1, 0), target=(0, 0, 0), up=(0, 0, -1), fov=10)
    return cq.Scene.from_meshes([cq.Mesh(vertices=square(40.0)[0], triangles=square()[1], material=matte)],
                                lights=lights, cameras=[camera], **options)


def still_life():
    """A matte ball on a matte ground, in light from all around: every pixel has noise."""
    ball, faces = sphere(8)
    matte = cq.Material(base_color=(0.7, 0.7, 0.7), specular=0.0)
    floor, squares = square(40.0)
    meshes = [
        cq.Mesh(vertices=floor, triangles=squares, material=matte),
        cq.Mesh(vertices=ball + (0, 1.0, 0), triangles=faces, material=matte),
    ]
    camera = cq.Camera(position=(0, 2, 6), target=(0, 0.5, 0))
    return cq.Scene.from_meshes(meshes, cameras=[camera], environment=(1.0, 1.0, 1.0))
