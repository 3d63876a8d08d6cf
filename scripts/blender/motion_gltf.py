"""Writes motion around the frame into a glTF document, as an animation: transforms of nodes, projections of cameras, and
morph targets with weights that interpolate between the sampled shapes.

The first sample is at 0 s of the animation, because glTF has no negative times. `extras.caustique.time` is the time of
the frame.
"""

import math

import numpy
from mathutils import Quaternion

import export_guard as guard
import glb
import motion

_POINTER = "KHR_animation_pointer"
_FLOAT = 5126
_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


def has_labels(things):
    """Whether the mesh of an object has the attribute `motion.CORNER`."""
    return any(thing.type == "MESH" and motion.CORNER in thing.data.attributes for thing in things)


def keep_labels_alone(things):
    """If meshes of the objects have labels, remove other attributes that Blender's exporter would write with them."""
    if has_labels(things):
        for mesh in {thing.data.name: thing.data for thing in things if thing.type == "MESH"}.values():
            for name in [name for name in mesh.attributes.keys() if name.startswith("_") and name != motion.CORNER]:
                mesh.attributes.remove(mesh.attributes[name])


def write(document, buffer, recorder, bodies, warn):
    """Add the motion that `recorder` (`motion.Recorder`) has of the nodes of a document. Returns the buffer.

    `bodies`: the name of each node's object in the flat scene. `warn(where, what)` receives a warning for each node
    that fails.
    """
    writer = _Writer(document, buffer, recorder)
    labels = writer.take_labels()
    for index, name in enumerate(bodies):
        moving = recorder.of.get(name)
        if moving is not None:
            where = f'object "{document["nodes"][index].get("name")}"'
            guard.attempt(warn, where, None, motion.STANDS_STILL, writer.move, index, moving, labels)
    writer.finish()
    return bytes(writer.buffer)


def scene_keys(recorder):
    """Keys of the scene's `extras.caustique`: `shutter` (frames), and `time` of the frame in the animation (s)."""
    keys = {"shutter": list(recorder.shutter)} if recorder.shutter is not None else {}
    if recorder.shutter is not None or recorder.vectors:
        keys["time"] = -recorder.begins / recorder.rate
    return keys


class _Writer:
    def __init__(self, document, buffer, recorder):
        self.document, self.buffer = document, bytearray(buffer)
        self.animation = {"name": "shutter", "channels": [], "samplers": []}
        self.inputs, self.deformed, self.targets = {}, {}, set()
        self.rate, self.begins = recorder.rate, recorder.begins

    def take_labels(self):
        """Take the attribute `motion.CORNER` and others of its kind out of all meshes. Returns accessor and labels of
        each primitive, by the indices of mesh and primitive."""
        found = {}
        for at, mesh in enumerate(self.document.get("meshes", [])):
            for k, part in enumerate(mesh["primitives"]):
                for name in [name for name in part["attributes"] if name.startswith("_")]:
                    index = part["attributes"].pop(name)
                    if name == motion.CORNER:
                        found[at, k] = index, self._numbers(index)
        return found

    def _numbers(self, index):
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        return numpy.frombuffer(bytes(self.buffer[start:start + 4 * accessor["count"]]), "<f4").astype(numpy.int64)

    def _accessor(self, values, bounds=False, index=None):
        """Add an accessor of an array (count, components), or put it in the place of an unused one."""
        values = numpy.ascontiguousarray(values, "<f4").reshape(len(values), -1)
        entry = {"componentType": _FLOAT, "count": len(values), "type": _KINDS[values.shape[1]]}
        if bounds:
            entry |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        accessors = self.document.setdefault("accessors", [])
        if index is None:
            accessors.append(entry)
            entry["bufferView"] = glb.add_view(self.document, self.buffer, values.tobytes())
            return len(accessors) - 1
        view = accessors[index]["bufferView"]
        entry["bufferView"], accessors[index] = view, entry
        glb.add_view(self.document, self.buffer, values.tobytes(), view)
        return index

    def _animate(self, target, samples):
        """Add a channel for {time: numbers}, unless it is still or another one has its target."""
        key = tuple(sorted((name, str(value)) for name, value in target.items()))
        if motion.is_still(samples) or key in self.targets:
            return
        self.targets.add(key)
        times = tuple(sorted(samples))
        if times not in self.inputs:
            seconds = (numpy.array(times) - self.begins) / self.rate
            self.inputs[times] = self._accessor(numpy.maximum(seconds, 0.0), True)
        values = numpy.array([samples[time] for time in times], float)
        # A list of weights has one number per key and target.
        values = values.reshape(-1, 1) if target["path"] in {"weights", "pointer"} else values
        self.animation["samplers"].append({"input": self.inputs[times], "output": self._accessor(values),
                                           "interpolation": "LINEAR"})
        self.animation["channels"].append({"sampler": len(self.animation["samplers"]) - 1, "target": target})

    def _animate_pointer(self, pointer, samples):
        self._animate({"path": "pointer", "extensions": {_POINTER: {"pointer": pointer}}}, samples)

    def move(self, index, moving, labels):
        """Add the motion of a node."""
        node = self.document["nodes"][index]
        if len(moving.matrices) > 1:
            self._transforms(index, node, moving.matrices)
        if "camera" in node and moving.optics:
            self._optics(index, node["camera"], moving.optics)
        if "mesh" in node and moving.shape is not None:
            times = self._deform(node["mesh"], moving, labels)
            rows = dict(zip(sorted(set(times) - {0.0}), numpy.eye(len(times) - 1))) | {0.0: numpy.zeros(len(times) - 1)}
            self._animate({"node": index, "path": "weights"}, rows)

    def _transforms(self, index, node, matrices):
        places, turns, scales = {}, {}, {}
        written = Quaternion(_from_gltf(node.get("rotation", (0, 0, 0, 1))))
        # Blender's exporter turns lights and cameras, which look along other axes in glTF.
        offset = _turned(matrices[0.0].decompose()[1]).inverted() @ written
        for time in sorted(matrices):
            place, turn, scale = matrices[time].decompose()
            turn = _turned(turn) @ (offset if "mesh" not in node else Quaternion())
            places[time], turns[time] = _y_up(place), (turn.x, turn.y, turn.z, turn.w)
            scales[time] = (scale.x, scale.z, scale.y)
        self._animate({"node": index, "path": "translation"}, places)
        self._animate({"node": index, "path": "rotation"}, turns)
        if "mesh" in node:
            self._animate({"node": index, "path": "scale"}, scales)

    def _optics(self, node, camera, optics):
        """Animate the projection of a camera: its angle or size, and the keys of `extras.caustique`."""
        ratios = {time: one["view"] / optics[0.0]["view"] for time, one in optics.items()}
        lens = self.document["cameras"][camera]
        if lens["type"] == "perspective":
            half = math.tan(lens["perspective"]["yfov"] / 2)
            self._animate_pointer(f"/cameras/{camera}/perspective/yfov",
                                  {time: 2 * math.atan(half * ratio) for time, ratio in ratios.items()})
        else:
            for name in ("xmag", "ymag"):
                size = lens["orthographic"][name]
                self._animate_pointer(f"/cameras/{camera}/orthographic/{name}",
                                      {time: size * ratio for time, ratio in ratios.items()})
        for name in optics[0.0]:
            if name != "view" and all(name in one for one in optics.values()):
                self._animate_pointer(f"/nodes/{node}/extras/caustique/{name}",
                                      {time: one[name] for time, one in optics.items()})

    def _deform(self, mesh, moving, labels):
        """Add the morph targets of a shape to a mesh, unless it has them. Returns the times of the shape."""
        shape, entry = moving.shape, self.document["meshes"][mesh]
        times = sorted(shape.points)
        if mesh in self.deformed:
            return times
        self.deformed[mesh] = shape
        points = {time: shape.points[time].transformed(moving.below) for time in times}
        for k, part in enumerate(entry["primitives"]):
            unused, chosen = labels[mesh, k]
            corners = shape.labels[chosen]
            vertices, still, part["targets"] = shape.vertices[corners], points[0.0], []
            for time in times:
                if time != 0.0:
                    moved = _y_up_rows(points[time].places[vertices] - still.places[vertices])
                    turned = _y_up_rows(points[time].normals[corners] - still.normals[corners])
                    part["targets"].append({"POSITION": self._accessor(moved, True, unused),
                                            "NORMAL": self._accessor(turned)})
                    unused = None
        entry["weights"] = [0] * (len(times) - 1)
        return times

    def finish(self):
        """Add the animation to the document, and the extension that it uses."""
        if not self.animation["channels"]:
            return
        self.document.setdefault("animations", []).append(self.animation)
        if any("extensions" in channel["target"] for channel in self.animation["channels"]):
            self.document.setdefault("extensionsUsed", []).append(_POINTER)


def _y_up(vector):
    return vector.x, vector.z, -vector.y


def _y_up_rows(rows):
    return numpy.stack([rows[:, 0], rows[:, 2], -rows[:, 1]], axis=1)


def _turned(turn):
    """A rotation of Blender's axes in those of glTF."""
    return Quaternion((turn.w, turn.x, turn.z, -turn.y))


def _from_gltf(xyzw):
    x, y, z, w = xyzw
    return w, x, y, z
