"""Volume objects with OpenVDB files: a box with a medium, and grid files (.vol) beside the .glb for its density and glow."""

import importlib.machinery
import importlib.util
import os
import struct
import sys

import bpy
import numpy
from mathutils import Matrix, Vector

import lighting
from shading import VOLUME, constant, leaves, nodes_of, output_of, source, source_socket, warn_of_phase

# Stefan-Boltzmann constant over pi, in the unit of Cycles' Principled Volume.
_BLACKBODY = 5.670373e-8 * 1e-6 / numpy.pi
_TEMPERATURES = numpy.geomspace(800, 12000, 200)
_KEPT = {"VOLUME_ABSORPTION", "VOLUME_SCATTER", "PRINCIPLED_VOLUME", "VOLUME_COEFFICIENTS"}


def openvdb():
    """The module openvdb, which Blender 4.4 and newer bring, or None."""
    spec = importlib.util.find_spec("openvdb")
    if spec is None:
        # Blender as a module keeps it where no path leads.
        version = f"python{sys.version_info.major}.{sys.version_info.minor}"
        bundled = os.path.join(bpy.utils.resource_path("LOCAL"), "python", "lib", version, "site-packages")
        spec = importlib.machinery.PathFinder.find_spec("openvdb", [bundled])
    if spec is None:
        return None
    if spec.name not in sys.modules:
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        sys.modules[spec.name] = module
    return sys.modules[spec.name]


class Volume:
    """The grids of an OpenVDB file, as arrays over the voxels from `first` on, one voxel wider than the density on each
    side. `matrix`: from the space of voxels to that of the object. `scale`: factor of lengths that densities follow."""

    def __init__(self, path, density, library, scale):
        self._grids = {grid.name: grid for grid in library.readAllGridMetadata(path)}
        self._path, self._library, self.scale = path, library, scale
        grid = library.read(path, density)
        low, high = grid.evalActiveVoxelBoundingBox()
        self.first = [x - 1 for x in low]
        self._size = [b - a + 3 for a, b in zip(low, high)]
        self._transform = grid.transform
        origin, *axes = [grid.transform.indexToWorld(p) for p in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))]
        self.matrix = Matrix.Identity(4)
        for column, axis in enumerate(axes):
            for row in range(3):
                self.matrix[row][column] = axis[row] - origin[row]
        for row in range(3):
            self.matrix[row][3] = origin[row]
        self.density = self._array(grid)

    def _array(self, grid):
        values = numpy.zeros(self._size, numpy.float32)
        grid.copyToArray(values, ijk=tuple(self.first))
        return values

    def named(self, name):
        """The values of another grid at the same voxels; None if the file has none, or if its voxels lie elsewhere."""
        if name not in self._grids:
            return None
        grid = self._library.read(self._path, name)
        return self._array(grid) if grid.transform == self._transform else None

    def has(self, name):
        """Whether the file has a grid of this name."""
        return name in self._grids

    def corners(self):
        """Lower and upper corner of the box around the voxels, in the space of voxels."""
        return [x - 0.5 for x in self.first], [x + n - 0.5 for x, n in zip(self.first, self._size)]


def box(thing, warn):
    """The mesh of a box with the medium of a volume object, and its Volume; None, with a warning, if it cannot be read."""
    where, data = f'object "{thing.name}"', thing.data
    library = openvdb()
    if not data.filepath:
        warn(where, "volumes that vary in space are not carried; "
                    "save them as an OpenVDB file, and import that as a Volume object")
        return None
    if library is None:
        warn(where, "volumes are carried with Blender 4.4 and newer only: it is left out; "
                    "use a newer Blender")
        return None
    data.grids.load()
    path = bpy.path.abspath(data.grids.frame_filepath or data.filepath)
    slot = thing.material_slots[0].material if thing.material_slots else None
    output = output_of(nodes_of(slot)) if slot is not None else None
    shaders = leaves(output.inputs["Volume"]) if output is not None else []
    densities = [_density(shader, around) for shader, around in shaders if shader.type in _KEPT]
    names = {name for _, name in filter(None, densities) if name}
    if len(names) != 1:
        warn(where, "its density is not one grid times a number: it is left out; "
                    "link an Attribute node to Density, at most times a number")
        return None
    direction = thing.matrix_world.to_3x3() @ Vector((1, 1, 1)).normalized()
    scale = direction.length if data.render.space == "OBJECT" else 1.0
    try:
        volume = Volume(path, names.pop(), library, scale)
    except (KeyError, OSError, RuntimeError, TypeError, ValueError) as error:
        warn(where, f"its grids cannot be read ({error}): it is left out; "
                    "check the file (Object Data > OpenVDB File)")
        return None
    low, high = volume.corners()
    points = [[(low, high)[bit][axis] for axis, bit in enumerate(bits)] for bits in numpy.ndindex(2, 2, 2)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(data.name)
    mesh.from_pydata(points, [], faces)
    return mesh, volume, slot.original


def _density(shader, around):
    """Factor and grid of the density of a volume shader in the groups `around`; None if it is something else."""
    if shader.type == "VOLUME_COEFFICIENTS":
        return None
    found = _grid(shader.inputs["Density"], around)
    if shader.type != "PRINCIPLED_VOLUME" or found is None:
        return found
    factor, name = found
    own = shader.inputs["Density Attribute"].default_value
    return None if name and own else (factor, name or own)


def _grid(socket, around):
    """Factor and name of the grid that a socket reads, as `density` or `density * 2`; the name is None for a constant,
    and the result None for other nodes."""
    value = constant(socket, around)
    if value is not None:
        return value, None
    output, around = source_socket(socket, around)
    node = output.node
    if node.type == "ATTRIBUTE":
        return 1.0, node.attribute_name
    if node.type == "VOLUME_INFO":
        return 1.0, output.name.lower()
    if node.type == "MATH" and node.operation == "MULTIPLY" and not node.use_clamp:
        parts = [_grid(s, around) for s in node.inputs[:2]]
        if None not in parts and not all(name for _, name in parts):
            return parts[0][0] * parts[1][0], parts[0][1] or parts[1][1]
    return None


def medium(material, volume, where, warn):
    """The coefficients at density 1 and the emission (array of voxels and RGB, or None) of a volume object's material."""
    sigma_a, sigma_s, moment, glow = [0.0] * 3, [0.0] * 3, 0.0, None
    tree = output_of(nodes_of(material)).inputs["Volume"]
    for shader, around in leaves(tree):
        density = _density(shader, around) if shader.type in _KEPT else None
        values = {s.name: constant(s, around) for s in shader.inputs if s.enabled and s.type in {"VALUE", "RGBA"}}
        needed = {name for name in values if name in ("Color", "Anisotropy", "Absorption Color")}
        if density is None or not density[1] or any(values[name] is None for name in needed):
            warn(where, f"the {shader.bl_label} node is not one grid times constants: it is not carried; "
                        "link an Attribute node to Density, and unlink the other inputs")
            continue
        if source(tree)[0].type == "MIX_SHADER":
            warn(where, "the weights of mixed volumes are not carried; "
                        "multiply Density by the weight instead")
        factor = density[0] / volume.scale
        absorb, scatter = [0.0] * 3, [0.0] * 3
        if shader.type == "VOLUME_ABSORPTION":
            absorb = [(1 - c) * factor for c in values["Color"]]
        else:
            scatter = [c * factor for c in values["Color"]]
        if shader.type == "PRINCIPLED_VOLUME":
            tint = values["Absorption Color"]
            absorb = [max(1 - c, 0) * max(1 - t ** 0.5, 0) * factor for c, t in zip(values["Color"], tint)]
            if volume.has(shader.inputs["Color Attribute"].default_value):
                warn(where, "the colours of the volume's grid are not carried; "
                            "clear Color Attribute, and choose one Color")
            own = _emission(shader, around, volume, where, warn)
            glow = own if glow is None or own is None else glow + own
        warn_of_phase(shader, where, warn)
        for i in range(3):
            sigma_a[i] += max(absorb[i], 0)
            sigma_s[i] += max(scatter[i], 0)
        moment += (values.get("Anisotropy") or 0.0) * sum(scatter) / 3
    total = sum(sigma_s) / 3
    return {"sigma_a": sigma_a, "sigma_s": sigma_s, "g": moment / total if total else 0.0}, glow


def _emission(shader, around, volume, where, warn):
    """Emission of a Principled Volume in the groups `around` as in Cycles, by voxel and channel; None without."""
    inside = (volume.density > 0)[..., None]
    glow = numpy.zeros((*volume.density.shape, 3))
    strength = _grid(shader.inputs["Emission Strength"], around)
    colour = constant(shader.inputs["Emission Color"], around)
    if strength is None or colour is None:
        warn(where, "its emission is not one grid times constants: it is not carried; "
                    "link an Attribute node to Emission Strength, and unlink Emission Color")
    elif strength[0] > 0:
        by = volume.named(strength[1]) if strength[1] else inside[..., 0]
        if by is None:
            warn(where, f'its grid "{strength[1]}" is missing, or its voxels differ: it does not glow; '
                                                 "write all grids with voxels of one size")
        else:
            glow += strength[0] * numpy.asarray(by)[..., None] * colour
    intensity, tint, temperature = (constant(shader.inputs[name], around)
                                    for name in ("Blackbody Intensity", "Blackbody Tint", "Temperature"))
    if None in (intensity, tint, temperature):
        warn(where, "its blackbody is not constant: it is not carried; "
                    "unlink Blackbody Intensity, Blackbody Tint and Temperature")
    elif intensity > 0:
        name = shader.inputs["Temperature Attribute"].default_value
        by = volume.named(name) if volume.has(name) else inside[..., 0]
        if by is None:
            warn(where, f'the voxels of its grid "{name}" differ: it does not glow; '
                                                        "write all grids with voxels of one size")
        else:
            kelvins = temperature * numpy.maximum(by, 0)
            power = _BLACKBODY * ((1 - intensity) + intensity * kelvins.astype(float) ** 4) * (kelvins > 0)
            table = numpy.array(lighting.blackbodies(_TEMPERATURES) or numpy.ones((len(_TEMPERATURES), 3)))
            colours = numpy.stack([numpy.interp(kelvins, _TEMPERATURES, column) for column in table.T], -1)
            glow += power[..., None] * colours * tint
    return glow / volume.scale if glow.max() > 0 else None


def embed(document, volumes, path, warn):
    """Give the materials of volume objects their media, and write the grids beside the .glb at `path`."""
    for entry in document.get("materials", []):
        extras = entry.get("extras", {})
        if VOLUME not in extras:
            continue
        index = int(extras.pop(VOLUME))
        volume, material, _ = volumes[index]
        where = f'material "{material.name}"'
        found, glow = medium(material, volume, where, warn)
        stem = f"{os.path.splitext(os.path.basename(path))[0]}.volume{index}"
        found["density"] = {"file": _write(path, f"{stem}.vol", volume, volume.density[..., None])}
        if glow is not None:
            found["emission"] = {"file": _write(path, f"{stem}.glow.vol", volume, glow)}
        extras.setdefault("caustique", {})["medium"] = found
        entry["name"], entry["extras"] = material.name, extras
    for *_, copy in volumes:
        bpy.data.materials.remove(copy)


def _write(path, name, volume, values):
    """Write a grid file, in glTF's axes; returns its name."""
    low, high = volume.corners()
    corners = (low[0], low[2], -high[1], high[0], high[2], -low[1])
    cells = values[:, ::-1].transpose(1, 2, 0, 3)
    header = struct.pack("<3sB5I6f", b"VOL", 3, 1, *cells.shape[2::-1], cells.shape[3], *corners)
    with open(os.path.join(os.path.dirname(path), name), "wb") as file:
        file.write(header + numpy.maximum(cells, 0).astype("<f4").tobytes())
    return name
