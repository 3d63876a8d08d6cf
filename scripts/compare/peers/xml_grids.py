"""Grids of density of Mitsuba's XML: the same files (.vol) as caustique's, with another box."""

import struct
from dataclasses import dataclass, replace

import numpy as np

#: Magic and version, type of the values, cells along x, y and z, channels, and corners of the box.
HEADER = struct.Struct("<3sB5i6f")
#: {type of the values: bytes of one}
VALUE_BYTES = {1: 4, 2: 2, 3: 1}
#: Box of a grid in the space of its `to_world`.
UNIT_BOX = (0.0, 0.0, 0.0, 1.0, 1.0, 1.0)


@dataclass(eq=False)
class Grid:
    """The bytes of a .vol file, and the transform (4, 4) from the space of its box to the world."""

    data: bytes
    space: np.ndarray


def density(medium):
    """The grid of a medium's density. None without one, or with a warning that drops the medium."""
    volume = medium.child("sigma_t", "density") if medium.type == "heterogeneous" else None
    if volume is None or volume.type != "gridvolume":
        if volume is not None and volume.tag == "volume" and volume.type != "constvolume":
            medium.drop(f"it is left out, because its density is a volume of type {volume.type}; known is gridvolume")
        return None
    path, space = volume.document.file(volume), volume.transform()
    try:
        data = path.read_bytes()
    except OSError as error:
        raise volume.fault(f"{path.name} cannot be read: {error.strerror}") from error
    header = HEADER.unpack_from(data) if len(data) >= HEADER.size else (b"", 0)
    if header[:2] != (b"VOL", 3) or header[2] not in VALUE_BYTES or min(header[3:7]) < 1:
        raise volume.fault(f"{path.name} is no .vol file of version 3")
    if len(data) < HEADER.size + VALUE_BYTES[header[2]] * int(np.prod(header[3:7], dtype=object)):
        raise volume.fault(f"{path.name} is cut off")
    if header[6] != 1:
        medium.drop(f"it is left out, because its density has {header[6]} channels; caustique's has one")
        return None
    if not abs(np.linalg.det(space[:3, :3])) > 0.0:
        medium.drop("it is left out, because the transform of its density is singular")
        return None
    if volume.text("filter_type", "trilinear") != "trilinear":
        volume.document.lose(f"{volume.title}: its values are interpolated linearly")
    if volume.text("wrap_mode", "clamp") != "clamp":
        volume.document.lose(f"{volume.title}: its outermost values are clamped")
    # Mitsuba 0.x has no switch: the box is the file's.
    if not volume.boolean("use_grid_bbox", volume.version < 2):
        data = HEADER.pack(*header[:7], *UNIT_BOX) + data[HEADER.size :]
    return Grid(data, space)


def in_space(mesh, matrix, space):
    """The triangles that `space` places as `matrix` places `mesh`."""
    to = np.linalg.inv(space) @ matrix
    turn, triangles = to[:3, :3], mesh.triangles
    normals = mesh.normals
    if normals is not None:
        normals = normals @ np.linalg.inv(turn)
        normals = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
    if np.linalg.det(turn) < 0.0:
        triangles = triangles[:, ::-1]
    return replace(mesh, vertices=mesh.vertices @ turn.T + to[:3, 3], triangles=triangles, normals=normals)
