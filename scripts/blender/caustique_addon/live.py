"""The pictures of one viewport: what is sent to the program, and when. It does not use Blender, so it is tested without.

The program is sent one view at a time: while the mouse moves, the next one waits for the first picture of the last one,
so that every view is seen. The scene is exported again when the program cannot apply an edit.
"""

import json
import math
import struct
import threading

import numpy

#: From Blender's axes (z up) to those of glTF (y up).
TO_GLTF = numpy.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
_FIRST_SECONDS = 0.15  # that the first picture of a view may take
_COARSE = 4  # ratio of the sides of a picture to those of its first picture, until the time of one is known
_COARSE_LIMITS = 2, 16
_RIGID = 1e-4  # largest deviation of a rotation from an orthonormal matrix


class Live:
    """The state of a viewport. `send(command, **fields)` sends to the program and returns the number of the command."""

    def __init__(self, send):
        self._send, self._lock = send, threading.RLock()
        self.picture = None  # the last `server.Picture`
        self.message, self.fault = "", None
        self.needs_export = True
        self._wanted = self._begun = None  # the view to show; the one that was sent last
        self._sent = self._pending = None  # the number of the view that was sent last; the same until its first picture
        self._ready, self._edits = False, set()  # whether a scene is loaded; numbers of edits and loads under way
        self._changed = False  # whether a picture or a message is new
        self._loading = None
        self._coarse = _COARSE
        self._fault_lasts = False  # whether the fault concerns the scene, so that pictures of the older one do not hide it

    def load(self, path, arguments):
        """Load an exported scene."""
        with self._lock:
            self._ready, self._pending, self._edits = False, None, set()
            self.fault, self._fault_lasts = None, False
            self._loading = self._send("load", scene=path, arguments=arguments)

    def edit(self, places, files=()):
        """Replace the objects that exported files hold, and place objects: {name: column-major matrix in glTF's axes}. The
        program obeys in order, so an edit may follow a load at once."""
        with self._lock:
            if not (places or files) or self._loading is None:
                return
            listed = [{"name": name, "matrix": matrix} for name, matrix in places.items()]
            self._edits.add(self._send("edit", place=listed, files=list(files)))
            if self._ready:
                self._begin()

    def want(self, view):
        """Show a view, the fields of the command `view` without `coarse`; nothing happens if it is the one that is shown."""
        with self._lock:
            if view == self._wanted:
                return
            self._wanted = view
            if self._ready and self._pending is None:
                self._begin()

    def _begin(self):
        if self._wanted is not None:
            self._pending = self._sent = self._send("view", **self._wanted, coarse=self._coarse)
            self._begun = self._wanted

    def answered(self, answer):
        """Take an answer of the program, from the thread that reads."""
        with self._lock:
            event, number = answer["event"], answer.get("id")
            if event == "loaded" and number == self._loading:
                self._ready = True
                self._begin()
            elif event == "error":
                self._failed(number, answer)
            elif event == "ended":
                self._ready, self.fault = False, (answer["message"], "switch the viewport's shading off and on again")
            elif event in ("stopped", "done") and number == self._pending:
                self._go_on()
            if event == "done" and number is not None and self.picture is not None:
                self.message = f"caustique: {answer.get('iterations', 0)} iterations"
            self._changed = True

    def _failed(self, number, answer):
        if number in self._edits:
            self._edits.discard(number)
            self.needs_export = True  # the whole scene, because it cannot be edited so
        else:
            self.fault = answer["message"], answer.get("hint") or ""
            self._fault_lasts = number is None or number == self._loading
            if number == self._pending:
                self._go_on()

    def shown(self, picture):
        """Take a picture, from the thread that reads."""
        with self._lock:
            self.picture, self._changed = picture, True
            if not self._fault_lasts:
                self.fault = None
            about = picture.about
            if about["coarse"]:
                self._coarse = coarser(self._coarse, about["seconds"])
            of = f" of {about['iterations']}" if about["iterations"] and not about["coarse"] else ""
            self.message = "caustique" if about["coarse"] else f"caustique: iteration {about['iteration']}{of}"
            if about["id"] == self._pending:
                self._go_on()

    def _go_on(self):
        """The view under way has been seen: the next one may begin."""
        self._pending = None
        if self._ready and self._wanted != self._begun:
            self._begin()

    def is_current(self):
        """Whether the last picture shows the scene and the view that were sent last."""
        with self._lock:
            return (self._ready and self.picture is not None and self.picture.about["id"] == self._sent
                    and self._begun == self._wanted and not self.needs_export and self.fault is None)

    def take_change(self):
        """Whether a picture or a message is new since the last call."""
        with self._lock:
            changed, self._changed = self._changed, False
            return changed


def coarser(coarse, seconds):
    """The ratio of sides by which the next first picture takes `_FIRST_SECONDS`, if the last one, with the ratio `coarse`,
    took `seconds`: its time grows with its pixels."""
    least, most = _COARSE_LIMITS
    return min(max(math.ceil(coarse * math.sqrt(seconds / _FIRST_SECONDS)), least), 2 * coarse, most)


def camera(view_matrix, window_matrix, back=0.0):
    """The program's camera for Blender's view and window matrices, which are nested lists of rows. `back`: how far an
    orthographic camera is moved back, because Blender also shows what is behind it."""
    projection, to_world = numpy.array(window_matrix, float), numpy.linalg.inv(numpy.array(view_matrix, float))
    to_world[:3, :3] /= numpy.linalg.norm(to_world[:3, :3], axis=0)
    if projection[3][3] == 0:  # perspective
        found = {"yfov": 2 * math.atan(1 / projection[1][1]), "shift": [projection[0][2] / 2, projection[1][2] / 2]}
    else:
        to_world[:3, 3] += back * to_world[:3, 2]
        found = {"ymag": 1 / projection[1][1], "shift": [-projection[0][3] / 2, -projection[1][3] / 2]}
    return {"matrix": columns(TO_GLTF @ to_world), **found}


def columns(matrix):
    """The numbers of a matrix, column by column."""
    return [float(number) for number in numpy.asarray(matrix, float).T.ravel()]


def moved(before, after, exported, is_light):
    """The exported matrix of an object that has moved from the matrix `before` to `after` in Blender; None if the object
    has to be exported again, because a lamp is scaled or something is flat."""
    before, after = numpy.array(before, float), numpy.array(after, float)
    try:
        change = after @ numpy.linalg.inv(before)
    except numpy.linalg.LinAlgError:
        return None
    turn = change[:3, :3]
    if is_light and abs(turn @ turn.T - numpy.identity(3)).max() > _RIGID:
        return None
    if not numpy.isfinite(change).all() or abs(numpy.linalg.det(turn)) < 1e-12:
        return None
    return TO_GLTF @ change @ numpy.linalg.inv(TO_GLTF) @ exported


def document(data):
    """The JSON of the bytes of a .glb file."""
    length = struct.unpack("<5I", data[:20])[3]
    return json.loads(data[20:20 + length])


def exported_places(document):
    """The world matrices of the nodes of a glTF document that have names of their own: {name: matrix}."""
    nodes = document.get("nodes", [])
    above = {child: index for index, node in enumerate(nodes) for child in node.get("children", ())}

    def world(index):
        whole = _local(nodes[index])
        while index in above:
            index = above[index]
            whole = _local(nodes[index]) @ whole
        return whole

    names = [node.get("name") for node in nodes]
    return {name: world(index) for index, name in enumerate(names) if name and names.count(name) == 1}


def _local(node):
    if "matrix" in node:
        return numpy.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = numpy.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    local = numpy.identity(4)
    local[:3, :3] = turn * numpy.array(node.get("scale", (1, 1, 1)), float)
    local[:3, 3] = node.get("translation", (0, 0, 0))
    return local
