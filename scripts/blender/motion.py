"""Motion around the frame: samples of the evaluated scene while the shutter is open, and one frame before and after for
motion vectors.

Cycles samples an object at 2^steps + 1 times, from the opening of the shutter to its closing, and interpolates between
them. One of these times is always the frame itself, whatever the shutter's position.
"""

import math
from dataclasses import dataclass, field

import bpy  # first: it makes the others importable

import numpy
from mathutils import Matrix

import camera_export
import export_guard as guard

# The attribute of a mesh's corners that Blender's exporter writes. It numbers the vertices that the exporter must keep
# apart, because their positions or normals differ at some time.
CORNER = "_CAUSTIQUE_CORNER"
# The attribute of a mesh's points with their velocity (m/s), as simulations and caches write it.
VELOCITY = "velocity"
_MAX_LABELS = 2 ** 24  # whole numbers in single precision
_NORMAL_STEPS = 1e4  # per unit: normals closer than one step are equal
_STILL = 3e-7  # relative difference of numbers in single precision that counts as no motion
STANDS_STILL, _SHAPE_STANDS = ("it stands still while the shutter is open",
                               "its shape stands still while the shutter is open")


def shutter(scene, layer):
    """When the shutter opens and closes, in frames relative to the frame, or None without motion blur."""
    render = scene.render
    length = render.motion_blur_shutter
    if not render.use_motion_blur or not getattr(layer, "use_motion_blur", True) or length <= 0:
        return None
    intervals = {"START": (0.0, length), "CENTER": (-length / 2, length / 2), "END": (-length, 0.0)}
    return intervals[render.motion_blur_position]


def warn_of_losses(scene, warn):
    """Warn about a rolling shutter or a shutter curve: caustique opens and closes the shutter at once for all
    pixels."""
    where = f'scene "{scene.name}"'
    if getattr(getattr(scene, "cycles", None), "rolling_shutter_type", "NONE") != "NONE":
        warn(where, "its rolling shutter is not carried: all rows see the same time; "
                    "choose Motion Blur > Rolling Shutter > None to see the same in Cycles")
    heights = [point.location[1] for point in scene.render.motion_blur_shutter_curve.curves[0].points]
    if max(heights) - min(heights) > 1e-3:
        warn(where, "its shutter curve is not carried: the shutter opens and closes at once; "
                    "flatten Motion Blur > Shutter Curve to see the same in Cycles")


def identity(instance):
    """What identifies an instance of the dependency graph at all times."""
    # Curves, text and metaballs occur twice, as themselves and as their meshes.
    key = instance.object.original.name_full, instance.object.type
    return (*key, instance.parent.original.name_full, *instance.persistent_id) if instance.is_instance else key


def identity_of(thing):
    """What identifies an object that is no instance."""
    return thing.name_full, thing.type


@dataclass
class Track:
    """Samples of an object: `matrices` and, of a camera, `optics`, by time (frames relative to the frame). `shape`: the
    samples of its mesh, or None if that cannot deform."""
    times: list
    matrices: dict = field(default_factory=dict)
    optics: dict = field(default_factory=dict)
    shape: object = None


@dataclass
class Points:
    """Vertices of a mesh at one time: `places` of vertices and `normals` of corners, (count, 3) each."""
    places: numpy.ndarray
    normals: numpy.ndarray

    def transformed(self, matrix):
        """The points below a 4 x 4 matrix."""
        axes = numpy.array(matrix)[:3, :3].astype(float)
        # Cofactors transform normals by singular matrices, too.
        cofactors = numpy.cross(axes.T[[1, 2, 0]], axes.T[[2, 0, 1]]) * (-1 if numpy.linalg.det(axes) < 0 else 1)
        normals = self.normals @ cofactors
        lengths = numpy.linalg.norm(normals, axis=1, keepdims=True)
        places = self.places @ axes.T + numpy.array(matrix)[:3, 3]
        return Points(places, normals / numpy.maximum(lengths, 1e-30))


class Shape:
    """Samples of a mesh of the flat scene: `points` by time. `name`: the object that warnings name. `labels`: a corner for
    each label of `CORNER`, None of a still mesh. `vertices`: the vertex of each corner."""

    def __init__(self, mesh, name):
        self.mesh, self.name, self.times, self.points = mesh, name, set(), {}
        self.labels, self.vertices = None, _numbers(mesh.loops, "vertex_index")
        self._topology, self._differs, self._seen = _topology(mesh), False, set()

    def see(self, time, thing):
        """Sample the mesh of the evaluated object `thing`."""
        self._seen.add(time)
        if self._differs:
            return
        own = thing.type != "MESH"
        mesh = thing.to_mesh() if own else thing.data
        if mesh is None or not all(map(numpy.array_equal, _topology(mesh), self._topology)):
            self._differs = True
        elif not _equal(_vectors(mesh.vertices, "co"), _vectors(self.mesh.vertices, "co")):
            self.points[time] = points_of(mesh)
        if own:
            thing.to_mesh_clear()

    def settle(self, rate, warn):
        """Complete the samples after the last time, at `rate` frames per second."""
        moved = self._by_velocity(rate)
        if moved:  # also if the faces stay, because simulations stand still between whole frames
            self.points = moved
        elif self._differs:
            self.points = {}
            warn(f'object "{self.name}"', "its faces change while the shutter is open, and it has no attribute velocity: "
                 f"{_SHAPE_STANDS}; switch on Speed Vectors in the domain's panel Mesh, or store the attribute by geometry "
                 "nodes (Store Named Attribute, vectors of points, m/s)")
        elif self.points:
            here = points_of(self.mesh)
            self.points = {time: self.points.get(time, here) for time in self._seen | {0.0}}
        if self.points:
            self.label(warn)

    def label(self, warn):
        """Number the corners that are one vertex at all times."""
        self.labels = label_corners(self.mesh, self.points)
        if self.labels is None:
            warn(f'object "{self.name}"', f"it has more than {_MAX_LABELS} vertices: {_SHAPE_STANDS}; split it "
                 "into smaller objects")

    def at(self, time):
        """The points at a time, interpolated between samples."""
        before, after = max(t for t in self.points if t <= time), min(t for t in self.points if t >= time)
        a, b = self.points[before], self.points[after]
        share = (time - before) / (after - before) if after > before else 0.0
        return Points(a.places + (b.places - a.places) * share, a.normals + (b.normals - a.normals) * share)

    def _by_velocity(self, rate):
        """Points that move along the mesh's velocity attribute (m/s), as Cycles moves meshes whose faces change."""
        layer = self.mesh.attributes.get(VELOCITY)
        if layer is None or layer.domain != "POINT" or layer.data_type != "FLOAT_VECTOR":
            return {}
        here, velocity, found = points_of(self.mesh), _vectors(layer.data, "vector"), {}
        for time in {min(self.times), 0.0, max(self.times)}:
            copy = self.mesh.copy()
            try:
                places = here.places + velocity * (time / rate)
                copy.vertices.foreach_set("co", places.astype(numpy.float32).ravel())
                copy.update()
                found[time] = points_of(copy)
            finally:
                bpy.data.meshes.remove(copy)
        return found


def points_of(mesh):
    """The points of a mesh."""
    return Points(_vectors(mesh.vertices, "co"), _vectors(mesh.corner_normals, "vector"))


def _vectors(items, name):
    found = numpy.empty(len(items) * 3, numpy.float32)
    items.foreach_get(name, found)
    return found.reshape(-1, 3)


def _topology(mesh):
    """The first corner of each face of a mesh, the vertex of each corner, and the number of vertices."""
    return _numbers(mesh.polygons, "loop_start"), _numbers(mesh.loops, "vertex_index"), len(mesh.vertices)


def _numbers(items, name):
    found = numpy.empty(len(items), numpy.int32)
    items.foreach_get(name, found)
    return found


def label_corners(mesh, points):
    """Give corners of a mesh one label if they share their vertex and, at all times, their normals.

    The labels become the attribute `CORNER`. Returns the first corner of each label; None if there are too many.
    """
    steps = [numpy.rint(p.normals * _NORMAL_STEPS).astype(numpy.int32) for p in points.values()]
    rows = numpy.ascontiguousarray(numpy.concatenate([_numbers(mesh.loops, "vertex_index")[:, None], *steps], axis=1))
    _, first, labels = numpy.unique(rows.view(f"V{rows.dtype.itemsize * rows.shape[1]}").ravel(), return_index=True,
                                    return_inverse=True)
    if len(first) > _MAX_LABELS:
        return None
    layer = mesh.attributes.get(CORNER) or mesh.attributes.new(CORNER, "FLOAT", "CORNER")
    layer.data.foreach_set("value", labels.astype(numpy.float32).ravel())
    return first


def _equal(a, b):
    """Whether two arrays differ by rounding errors alone."""
    a, b = numpy.asarray(a, float), numpy.asarray(b, float)
    return bool((abs(a - b) <= _STILL * max(abs(b).max(initial=0.0), 1e-30)).all())


@dataclass
class Motion:
    """How an object of the flat scene moves: `matrices` and `optics` by time, and `shape`, below the matrix `below`."""
    matrices: dict
    optics: dict
    shape: Shape = None
    below: Matrix = field(default_factory=Matrix)


class Recorder:
    """Samples the objects of a scene while the shutter is open, and in the frames around if the view layer has the pass
    Vector.

    `of`: the `Motion` of objects of the flat scene, by their names. `rate`: frames per second. `begins`: the first of all
    times, relative to the frame (frames).
    """

    def __init__(self, scene, layer, warn):
        self.scene, self.shutter, self.of = scene, shutter(scene, layer), {}
        self.vectors = (-1.0, 1.0) if getattr(layer, "use_pass_vector", False) else ()
        self.begins = min((0.0, *self.vectors, *(self.shutter or ())))
        self._warn, self._tracks, self._shapes = warn, {}, {}
        self._frame = scene.frame_current, scene.frame_subframe
        self.rate = scene.render.fps / scene.render.fps_base
        if self.shutter is not None:
            warn_of_losses(scene, warn)

    def expect(self, key, thing, parent, matrix, mesh=None):
        """Plan the samples of an evaluated object or instance with this key. `parent`: its instancer, or None. `matrix`:
        in the world at the frame. `mesh`: its mesh in the flat scene if that may deform."""
        steps, deforms = _settings(thing, parent) if self.shutter is not None else (0, True)
        times = set(self.vectors)
        if steps:
            opens, closes = self.shutter
            times |= {opens + (closes - opens) * k / 2 ** steps for k in range(2 ** steps + 1)}
        if not times:
            return
        times = sorted(times)
        track = self._tracks[key] = Track(times, {0.0: matrix})
        if thing.type == "CAMERA":
            track.optics[0.0] = self._optics(thing)
        if mesh is not None and deforms:
            if mesh.name not in self._shapes:
                self._shapes[mesh.name] = key, Shape(mesh, thing.name)
            track.shape = self._shapes[mesh.name][1]
            track.shape.times.update(times)

    def record(self):
        """Visit all planned times, and return to the frame."""
        times = {time for track in self._tracks.values() for time in track.times} - {0.0}
        now, seen_by = sum(self._frame), {}
        for key, shape in self._shapes.values():
            seen_by.setdefault(key, []).append(shape)
        try:
            for time in sorted(times):
                _go_to(self.scene, now + time)
                self._see(time, seen_by)
        finally:
            if times:
                self.scene.frame_set(self._frame[0], subframe=self._frame[1])
        for _, shape in self._shapes.values():
            self._attempt(shape, shape.settle, self.rate, self._warn)

    def _attempt(self, shape, *work):
        guard.attempt(self._warn, f'object "{shape.name}"', None, _SHAPE_STANDS, *work)

    def _see(self, time, seen_by):
        camera = self.scene.camera
        depsgraph = bpy.context.evaluated_depsgraph_get()
        missing = {camera.name_full: camera} if camera is not None else {}
        for instance in depsgraph.object_instances:
            key = identity(instance)
            track = self._tracks.get(key)
            if track is None:
                continue
            if time in track.times:
                track.matrices[time] = instance.matrix_world.copy()
                if instance.object.type == "CAMERA":
                    track.optics[time] = self._optics(instance.object)
                    missing.pop(key[0], None)
            for shape in seen_by.get(key, ()):
                if time in shape.times:
                    self._attempt(shape, shape.see, time, instance.object)
        for hidden in missing.values():
            track = self._tracks.get(identity_of(hidden))
            if track is not None and time in track.times:
                evaluated = hidden.evaluated_get(depsgraph)
                track.matrices[time], track.optics[time] = evaluated.matrix_world.copy(), self._optics(evaluated)

    def _optics(self, camera):
        return camera_export.optics(camera, self.scene.render)

    def follow(self, key, body, here, at_frame, flat):
        """Let `body`, an object of the flat scene `flat`, move as the instance with this key. `here` is the matrix of
        the body, `at_frame` that of the instance at the frame; the mesh has the rest."""
        track = self._tracks.get(key)
        if track is None:
            return
        matrices, optics = dict(track.matrices), track.optics
        if self.vectors and self.shutter is not None and not set(self.shutter) <= set(track.times):
            # Without motion blur the object rests while the shutter is open, also if it moves before and after.
            matrices |= dict.fromkeys(self.shutter, at_frame)
            optics |= dict.fromkeys(self.shutter, optics[0.0]) if optics else {}
        shape = track.shape if track.shape is not None and track.shape.labels is not None else None
        if body.type == "CAMERA":
            matrices = {time: camera_export.without_scale(matrix) for time, matrix in matrices.items()}
        moving = Motion(matrices, optics, shape)
        if body.type == "MESH" and here != at_frame:
            moving.below = here.inverted() @ at_frame
            rest = moving.below.inverted()
            moving.matrices = {time: matrix @ rest for time, matrix in matrices.items()}
        moving.matrices[0.0] = here.copy()
        if body.type == "MESH" and not all(map(has_no_shear, moving.matrices.values())):
            self._deform(body, moving, flat)
        if moving.shape or not is_still(moving.matrices) or any(one != optics[0.0] for one in optics.values()):
            self.of[body.name] = moving

    def _deform(self, body, moving, flat):
        """Move the vertices of a mesh instead of its object, which the motion shears."""
        here, mesh = moving.matrices[0.0].inverted(), flat.remove_later(body.data.copy())
        flat.names[mesh.name], body.data = flat.names[body.data.name], mesh
        shape, still = Shape(mesh, flat.names[body.name]), points_of(mesh)
        for time in sorted(moving.matrices):
            points = moving.shape.at(time).transformed(moving.below) if moving.shape is not None else still
            shape.points[time] = points.transformed(here @ moving.matrices[time])
        shape.label(self._warn)
        moving.matrices, moving.below = {0.0: moving.matrices[0.0]}, Matrix()
        moving.shape = shape if shape.labels is not None else None

    def pass_on(self, body, other):
        """Let the object `other` of the flat scene move as `body`, which it replaces."""
        if body.name in self.of:
            self.of[other.name] = self.of.pop(body.name)


def _settings(thing, parent):
    """The steps of motion blur of an object, 0 for none, and whether its mesh may deform, as Cycles reads them: an
    instancer's settings hold for its instances, too."""
    steps, deforms = 1, True
    for each in filter(None, (thing, parent)):
        settings = getattr(each.original, "cycles", None)  # None if Cycles is switched off
        if not getattr(settings, "use_motion_blur", True):
            return 0, False
        steps = max(steps, getattr(settings, "motion_steps", 1))
        deforms = deforms and getattr(settings, "use_deform_motion", True)
    return steps, deforms


def _go_to(scene, time):
    whole = math.floor(time)
    scene.frame_set(whole, subframe=time - whole)


def is_still(values):
    """Whether all values of {time: matrix or numbers} are equal."""
    return all(_equal(value, values[0.0]) for value in values.values())


def has_no_shear(matrix):
    """Whether a matrix is a composition of location, rotation and scale (no shear)."""
    again = Matrix.LocRotScale(*matrix.decompose())
    size = max(abs(x) for row in matrix.to_3x3() for x in row)
    return all(abs(a - b) <= 1e-5 * size for x, y in zip(again.to_3x3(), matrix.to_3x3()) for a, b in zip(x, y))
