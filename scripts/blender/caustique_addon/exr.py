"""Reads the EXR files that caustique writes with `--compression none`: one part, scan lines, 32-bit floats.

Blender's Python cannot read EXR files. Blender's loader of passes supports one view layer name only, and drops the
header, which holds the names of cryptomattes. Uncompressed files are plain arrays (OpenEXR, File Layout), so numpy maps
them without a copy.
"""

import mmap
import struct

import numpy

from .fault import Fault

_MAGIC = b"\x76\x2f\x31\x01\x02\x00\x00\x00"
_FLOAT = 2
_LINE_HEADER_BYTES = 8  # the line's y, and the size of its data


class Picture:
    """The pixels and header strings of an uncompressed EXR file of 32-bit floats.

    `text`: the header's strings. `window`: x and y of the upper left pixel. `width`, `height`: size of the data window.
    `display`: width and height of the whole picture. `channels`: {name: array (height, width), top row first}.
    """

    def __init__(self, path):
        with open(path, "rb") as file:
            data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        attributes, end = _header(data, path)
        if attributes["compression"] != b"\0" or attributes["lineOrder"] != b"\0":
            raise Fault(f"{path} is compressed", "render with '--compression none'")
        self.text = {name: value.decode("utf-8", "replace") for name, value in attributes.items()
                     if name.startswith("cryptomatte/") or name == "caustique"}
        left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
        whole = struct.unpack("<4i", attributes["displayWindow"])
        self.window = left - whole[0], top - whole[1]
        self.display = whole[2] - whole[0] + 1, whole[3] - whole[1] + 1
        self.width, self.height = right - left + 1, bottom - top + 1
        names = _channels(attributes["channels"], path)
        row = 4 * self.width
        line = _LINE_HEADER_BYTES + row * len(names)
        start = end + 8 * self.height  # behind the table of line offsets
        if len(data) != start + line * self.height:
            raise Fault(f"{path} is not complete", "render again")
        cube = numpy.ndarray((self.height, len(names), self.width), "<f4", data, start + _LINE_HEADER_BYTES, (line, row, 4))
        self.channels = {name: cube[:, index] for index, name in enumerate(names)}


def _header(data, path):
    """The attributes of an EXR file's header, {name: bytes}, and the offset in bytes of the header's end."""
    if data[:8] != _MAGIC:
        raise Fault(f"{path} is not an EXR file of one part", "render again")
    attributes, at = {}, 8
    while data[at] != 0:
        name = data.find(b"\0", at)
        value = data.find(b"\0", name + 1) + 5  # behind the attribute's type and size
        size = struct.unpack_from("<i", data, value - 4)[0]
        attributes[data[at:name].decode()] = data[value:value + size]
        at = value + size
    return attributes, at + 1


def _channels(data, path):
    """The names of an EXR file's channels in file order, from the header's attribute `channels`."""
    names, at = [], 0
    while data[at] != 0:
        end = data.index(b"\0", at)
        kind, _, x, y = struct.unpack_from("<4i", data, end + 1)
        if (kind, x, y) != (_FLOAT, 1, 1):
            raise Fault(f"{path}: channel {data[at:end].decode()} is not of 32-bit floats", "render again")
        names.append(data[at:end].decode())
        at = end + 17
    return names
