"""Animated shots for measurements of flicker: scenes of the project with an animation of FRAMES frames at 24 frames per
second, written into the cache, and single frames of them for renderers without animation.

pool       six travelling waves (two morph targets each), a still camera
turntable  cosmetics with glass on a table that turns
interior   the camera walks through the room and turns
gems       the key light moves around the gems
"""

import copy
import functools

import gltf
import numpy as np

from .cache import CACHE
from .record import ROOT

FRAMES, FRAME_RATE = 24, 24
# Waves of the pool: wavelengths in metres, headings in radians, and the largest slope of each.
WAVELENGTHS, HEADINGS, SLOPE = (0.31, 0.42, 0.55, 0.73, 0.96, 1.3), (0.2, 1.3, 0.7, -0.3, 1.0, 0.5), 0.06
WATER_LEVEL, GRAVITY = -0.13, 9.81
# Degrees in FRAMES frames.
TABLE_TURN, LIGHT_TURN, CAMERA_TURN = 36.0, 40.0, -6.0
CAMERA_WALK = (0.55, 0.0, -0.25)


def turn_about_y(degrees):
    """The quaternions (x, y, z, w) of turns about the vertical axis; one row for each angle."""
    half = np.radians(np.atleast_1d(degrees)) / 2
    zero = np.zeros_like(half)
    return np.stack([zero, np.sin(half), zero, np.cos(half)], -1)


def multiply(first, second):
    """Products of quaternions: the rotation `second`, then the rotation `first`."""
    (ax, ay, az, aw), (bx, by, bz, bw) = (np.moveaxis(np.asarray(one, float), -1, 0) for one in (first, second))
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        -1,
    )


class Shot:
    """A scene to which tracks are added."""

    def __init__(self, path):
        self.document, binary = gltf.chunks(path.read_bytes())
        self.binary = bytearray(binary)
        self.document["animations"] = [{"channels": [], "samplers": []}]
        extras = self.document["scenes"][0].setdefault("extras", {}).setdefault("caustique", {})
        extras["frame_rate"] = FRAME_RATE
        # One key before the first frame and one after the last, so that these frames have neighbours.
        self.times = np.arange(FRAMES + 2) / FRAME_RATE
        self.progress = np.arange(FRAMES + 2) / FRAMES
        self.time_accessor = self.accessor(self.times, "SCALAR")

    def accessor(self, values, kind):
        """Adds an accessor of floats."""
        values = np.ascontiguousarray(values, "<f4")
        self.binary += b"\0" * (-len(self.binary) % 4)
        views, accessors = self.document["bufferViews"], self.document["accessors"]
        views.append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": values.nbytes})
        self.binary += values.tobytes()
        part = {"bufferView": len(views) - 1, "componentType": 5126, "type": kind}
        rows = values.reshape(len(values), -1) if kind != "SCALAR" else values.reshape(-1, 1)
        bounds = {"min": rows.min(0).tolist(), "max": rows.max(0).tolist()}
        accessors.append({**part, "count": len(rows), **bounds})
        return len(accessors) - 1

    def replace(self, index, values):
        """Overwrites the floats of an accessor."""
        part = self.document["accessors"][index]
        view = self.document["bufferViews"][part["bufferView"]]
        start = view.get("byteOffset", 0) + part.get("byteOffset", 0)
        data = np.ascontiguousarray(values, "<f4")
        self.binary[start : start + data.nbytes] = data.tobytes()
        if "min" in part:
            part.update(min=data.min(0).tolist(), max=data.max(0).tolist())

    def values(self, index):
        """The values of an accessor."""
        return gltf.accessor(gltf.Scene(self.document, None, [bytes(self.binary)]), index).astype(float)

    def node(self, name):
        """The index of a node by name."""
        return next(index for index, node in enumerate(self.document["nodes"]) if node.get("name") == name)

    def group(self, name, children):
        """Adds a node above nodes of the scene's root; returns its index."""
        roots = self.document["scenes"][0]["nodes"]
        self.document["scenes"][0]["nodes"] = [index for index in roots if index not in children]
        self.document["nodes"].append({"name": name, "children": list(children)})
        self.document["scenes"][0]["nodes"].append(len(self.document["nodes"]) - 1)
        return len(self.document["nodes"]) - 1

    def track(self, node, path, values):
        """Animates a property of a node; `values` has a row for each key."""
        animation = self.document["animations"][0]
        kind = {"translation": "VEC3", "rotation": "VEC4", "weights": "SCALAR"}[path]
        output = self.accessor(np.ravel(values) if kind == "SCALAR" else values, kind)
        animation["samplers"].append({"input": self.time_accessor, "output": output, "interpolation": "LINEAR"})
        target = {"sampler": len(animation["samplers"]) - 1, "target": {"node": node, "path": path}}
        animation["channels"].append(target)

    def write(self, path):
        """Writes the shot to `path`. A file that has these bytes already is left alone, so that its cached references
        stay valid."""
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_suffix(".part")
        gltf.pack(draft, self.document, self.binary)
        if path.exists() and path.read_bytes() == draft.read_bytes():
            draft.unlink()
        else:
            draft.rename(path)
        return path


def pool():
    """The pool with waves that obey the dispersion of deep water. A wave sin(k x - w t) is the sum of two standing
    waves, so two morph targets with the weights cos(w t) and -sin(w t) give it exactly, with exact normals."""
    shot = Shot(ROOT / "scenes" / "pool.glb")
    water = shot.node("water")
    mesh = shot.document["meshes"][shot.document["nodes"][water]["mesh"]]
    attributes = mesh["primitives"][0]["attributes"]
    positions, normals = shot.values(attributes["POSITION"]), shot.values(attributes["NORMAL"])
    moves = positions[:, 1] > 3 * WATER_LEVEL
    top = moves & (normals[:, 1] > 0.5)
    positions[moves, 1] = WATER_LEVEL
    normals[top] = (0, 1, 0)
    shot.replace(attributes["POSITION"], positions)
    shot.replace(attributes["NORMAL"], normals)
    targets, weights = [], []
    for index, (length, heading) in enumerate(zip(WAVELENGTHS, HEADINGS, strict=True)):
        wave = 2 * np.pi / length * np.array([np.cos(heading), -np.sin(heading)])
        phase = positions[:, [0, 2]] @ wave + index
        height, frequency = SLOPE * length / (2 * np.pi), np.sqrt(GRAVITY * 2 * np.pi / length)
        for rise, slope, weight in ((np.sin, np.cos, np.cos), (np.cos, lambda x: -np.sin(x), lambda x: -np.sin(x))):
            move, tilt = np.zeros_like(positions), np.zeros_like(normals)
            move[moves, 1] = height * rise(phase[moves])
            tilt[np.ix_(top, [0, 2])] = -height * slope(phase[top])[:, None] * wave
            targets.append({"POSITION": shot.accessor(move, "VEC3"), "NORMAL": shot.accessor(tilt, "VEC3")})
            weights.append(weight(frequency * shot.times))
    mesh["primitives"][0]["targets"] = targets
    mesh["weights"] = [float(weight[0]) for weight in weights]
    shot.track(water, "weights", np.stack(weights, -1))
    return shot


def turntable():
    """Everything on the sweep of the cosmetics turns; the sweep, the lights and the camera stay."""
    shot = Shot(ROOT / "scenes" / "second" / "cosmetics.glb")
    still = {"sweep", "key", "key case", "strip", "strip case", "top", "top case"}
    nodes = shot.document["nodes"]
    turned = [index for index, node in enumerate(nodes) if "camera" not in node and node["name"] not in still]
    shot.track(shot.group("turntable", turned), "rotation", turn_about_y(TABLE_TURN * shot.progress))
    return shot


def interior():
    """A camera that walks and turns."""
    shot = Shot(ROOT / "scenes" / "interior.glb")
    camera = next(index for index, node in enumerate(shot.document["nodes"]) if "camera" in node)
    node = shot.document["nodes"][camera]
    shot.track(camera, "translation", node["translation"] + np.outer(shot.progress, CAMERA_WALK))
    shot.track(camera, "rotation", multiply(turn_about_y(CAMERA_TURN * shot.progress), [node["rotation"]]))
    return shot


def gems():
    """The key light turns about the vertical axis through the gems, and so keeps shining at them."""
    shot = Shot(ROOT / "scenes" / "gems.glb")
    arm = shot.group("key arm", [shot.node("key")])
    shot.track(arm, "rotation", turn_about_y(LIGHT_TURN * shot.progress))
    return shot


SHOTS = {"pool": pool, "turntable": turntable, "interior": interior, "gems": gems}


def write(name):
    """Writes a shot into the cache; returns its file."""
    return SHOTS[name]().write(CACHE / "shots" / f"{name}.glb")


def slerp(first, second, share):
    """Spherical linear interpolation of two unit quaternions."""
    cosine = float(first @ second)
    second, cosine = (-second, -cosine) if cosine < 0 else (second, cosine)
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-6:
        return first + share * (second - first)
    return (np.sin((1 - share) * angle) * first + np.sin(share * angle) * second) / np.sin(angle)


class Animation:
    """The animated transforms of a .glb file with linear tracks."""

    def __init__(self, path):
        self.document, self.binary = gltf.chunks(path.read_bytes())
        scene = gltf.Scene(self.document, path.parent, [self.binary])
        self.tracks = []
        for animation in self.document.get("animations", []):
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                if sampler.get("interpolation", "LINEAR") != "LINEAR":
                    raise gltf.Unsupported("tracks that are not linear")
                times = gltf.accessor(scene, sampler["input"]).ravel().astype(float)
                values = gltf.accessor(scene, sampler["output"]).astype(float).reshape(len(times), -1)
                self.tracks.append((channel["target"]["node"], channel["target"]["path"], times, values))
        self.nodes = functools.cache(self.nodes)
        self.worlds = functools.cache(self.worlds)

    def nodes(self, frame):
        """Copies of the nodes, as they are at a frame."""
        nodes, time = copy.deepcopy(self.document["nodes"]), frame / FRAME_RATE
        for node, path, times, values in self.tracks:
            after = int(np.clip(np.searchsorted(times, time), 1, len(times) - 1))
            share = float(np.clip((time - times[after - 1]) / (times[after] - times[after - 1]), 0, 1))
            first, second = values[after - 1], values[after]
            value = slerp(first, second, share) if path == "rotation" else first + share * (second - first)
            nodes[node][path] = value.tolist()
        return nodes

    def worlds(self, frame):
        """The transforms of all nodes to world space at a frame, by index."""
        nodes, found = self.nodes(frame), {}

        def visit(index, parent):
            found[index] = parent @ gltf.matrix(nodes[index])
            for child in nodes[index].get("children", []):
                visit(child, found[index])

        for root in self.document["scenes"][self.document.get("scene", 0)]["nodes"]:
            visit(root, np.eye(4))
        return found

    def camera(self, frame):
        """The first camera's transform to world space at a frame, and its vertical field of view in radians."""
        index = next(index for index, node in enumerate(self.document["nodes"]) if "camera" in node)
        camera = self.document["cameras"][self.document["nodes"][index]["camera"]]
        return self.worlds(frame)[index], camera["perspective"]["yfov"]


def write_still(path, frame, target):
    """Writes one frame of a shot as a scene without animation, with the morph targets applied."""
    shot, moving = Shot(path), Animation(path)
    shot.document["nodes"] = nodes = moving.nodes(frame)
    for node in nodes:
        weights = node.pop("weights", None)
        if weights is None:
            continue
        mesh = shot.document["meshes"][node["mesh"]]
        mesh.pop("weights", None)
        for primitive in mesh["primitives"]:
            targets = primitive.pop("targets")
            for name in targets[0]:
                moved = [weight * shot.values(one[name]) for weight, one in zip(weights, targets, strict=True)]
                values = shot.values(primitive["attributes"][name]) + sum(moved)
                if name == "NORMAL":
                    values /= np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-30)
                shot.replace(primitive["attributes"][name], values)
    del shot.document["animations"]
    return shot.write(target)
