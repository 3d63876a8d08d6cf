"""Features of volume objects: grids of an OpenVDB file."""

import os

import bpy  # First, because it brings the others.

import numpy
import volumes

from .torture_stage import feature

CELLS, VOXEL = 24, 0.08


def _cloud(stage, temperature=None, **inputs):
    """Replace the body by a volume object with a Principled Volume, of a cloud in a box of 1.9 m. `temperature`: a
    function of the density, in kelvins."""
    openvdb = volumes.openvdb()
    if openvdb is None:
        raise RuntimeError("Blender before 4.4 has no module openvdb")
    bpy.data.objects.remove(stage.body)
    at = numpy.stack(numpy.meshgrid(*[numpy.linspace(-1, 1, CELLS)] * 3, indexing="ij"), -1)
    density = numpy.maximum(1 - numpy.linalg.norm(at * (1, 1.3, 1), axis=-1), 0) * (2 + 1.6 * numpy.sin(6 * at[..., 0]))
    values = {"density": density, **({"temperature": temperature(density)} if temperature else {})}
    grids = []
    for name, field in values.items():
        grid = openvdb.FloatGrid()
        grid.copyFromArray(field.astype(numpy.float32), ijk=(-CELLS // 2,) * 3)
        grid.name, grid.transform = name, openvdb.createLinearTransform(voxelSize=VOXEL)
        grids.append(grid)
    path = os.path.join(bpy.app.tempdir, "cloud.vdb")
    openvdb.write(path, grids=grids)
    data = bpy.data.volumes.new("cloud")
    data.filepath = path
    stage.body = stage.place("cloud", data, (0, 0, 0.95))
    stage.body.rotation_euler = (0.3, 0.2, 0.4)
    stage.output("Volume", stage.node("VolumePrincipled", **inputs))


@feature
def volume_smoke(stage):
    _cloud(stage, Color=(0.8, 0.6, 0.4), Density=3.0, Anisotropy=0.3)


@feature
def volume_scaled(stage):
    _cloud(stage, Color=(0.9, 0.9, 0.9), Density=5.0, Absorption_Color=(0.2, 0.1, 0.05))
    stage.body.scale = (0.6, 0.6, 0.8)


@feature
def volume_fire(stage):
    _cloud(
        stage,
        lambda density: 600 + 900 * density,
        Color=(0.4, 0.4, 0.4),
        Density=2.0,
        Blackbody_Intensity=1.0,
        Temperature=1.0,
    )
