"""Builds a binary glTF file (glTF 2.0): a JSON document and a buffer."""

import json
import math
import struct

import numpy

from faults import Fault

_FLOAT, _UINT = 5126, 5125
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Document:
    """A glTF document under construction. Methods add a part and return its index, equal parts once."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0", "generator": "caustique, from USD"}, "scene": 0,
                     "scenes": [{"nodes": []}]}
        self._buffer = bytearray()
        self._used = set()
        self._shared = {}

    def add(self, kind, entry):
        """Add an entry to a list such as `meshes`. Returns its index."""
        entries = self.json.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def share(self, kind, entry):
        """Add an entry unless an equal one exists. Returns its index."""
        key = kind, json.dumps(entry, sort_keys=True)
        if key not in self._shared:
            self._shared[key] = self.add(kind, entry)
        return self._shared[key]

    def use(self, extension):
        """Declare that the file uses an extension. Returns its name."""
        self._used.add(extension)
        return extension

    def light(self, entry):
        """Add a light of KHR_lights_punctual. Returns the node's properties that refer to it."""
        name = self.use("KHR_lights_punctual")
        lights = self.json.setdefault("extensions", {}).setdefault(name, {}).setdefault("lights", [])
        lights.append(entry)
        return {name: {"light": len(lights) - 1}}

    def node(self, entry):
        """Add the node `entry`, a glTF object as a dictionary, to the document's scene."""
        self.json["scenes"][0]["nodes"].append(self.add("nodes", entry))

    def floats(self, array, bounds=False):
        """Add an accessor of `array` (count, width), in single precision."""
        array = numpy.ascontiguousarray(array, numpy.float32)
        entry = {"bufferView": self._view(array.tobytes()), "componentType": _FLOAT, "count": len(array),
                 "type": _TYPES[array.shape[1]]}
        if bounds:
            entry["min"], entry["max"] = ([float(x) for x in edge] for edge in (array.min(0), array.max(0)))
        return self.add("accessors", entry)

    def indices(self, array):
        """Add an accessor of vertex indices. Returns the accessor's index."""
        array = numpy.ascontiguousarray(array, numpy.uint32)
        return self.add("accessors", {"bufferView": self._view(array.tobytes()), "componentType": _UINT,
                                      "count": len(array), "type": "SCALAR"})

    def image(self, data, mime, name):
        """Add an image from the bytes of a file, equal ones once."""
        key = "image", data
        if key not in self._shared:
            self._shared[key] = self.add("images", {"bufferView": self._view(data), "mimeType": mime, "name": name})
        return self._shared[key]

    def profile(self, data):
        """Add a buffer view of the bytes of a photometric profile, equal ones once. Returns its index."""
        key = "profile", data
        if key not in self._shared:
            self._shared[key] = self._view(data)
        return self._shared[key]

    def _view(self, data):
        self._buffer += b"\0" * (-len(self._buffer) % 4)
        view = self.add("bufferViews", {"buffer": 0, "byteOffset": len(self._buffer), "byteLength": len(data)})
        self._buffer += data
        return view

    def write(self, path):
        """Write the .glb; the format requires chunks padded to four bytes."""
        if not self.json["scenes"][0]["nodes"]:
            del self.json["scenes"][0]["nodes"]  # the format forbids empty lists
        self._buffer += b"\0" * (-len(self._buffer) % 4)
        if self._buffer:
            self.json["buffers"] = [{"byteLength": len(self._buffer)}]
        if self._used:
            self.json["extensionsUsed"] = sorted(self._used)
        _check_finite(self.json)
        text = json.dumps(self.json, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + (8 + len(self._buffer) if self._buffer else 0)
        with open(path, "wb") as file:
            file.write(struct.pack("<IIIII", 0x46546C67, 2, size, len(text), 0x4E4F534A) + text)
            if self._buffer:
                file.write(struct.pack("<II", len(self._buffer), 0x004E4942) + self._buffer)


def _check_finite(entry, where="/", key=""):
    """Raise a Fault if a number is not finite, such as an overflowing product: glTF cannot store it."""
    if isinstance(entry, float) and not math.isfinite(entry):
        raise Fault(where, f"its {key} comes to {entry}", "make its numbers smaller")
    if isinstance(entry, dict):
        for name, part in entry.items():
            _check_finite(part, entry.get("name", where), name)
    elif isinstance(entry, list):
        for part in entry:
            _check_finite(part, where, key)
