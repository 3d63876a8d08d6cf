"""IES profiles in the nodes of lamps, with the interpolation of Cycles."""

import os

import bpy
import numpy

import glb
from shading import constant, nodes_of, output_of, source

# The strength (W/sr per watt of a lamp over all directions) that Cycles' IES node has for a candela: 4 pi / 177.83, with
# the luminous efficacy of daylight (D65).
_CANDELA = 0.0706650768394
# Cycles' horizontal angles start at -Y and run clockwise, as seen from behind the lamp.
_TURN = {"rotation_deg": -90.0, "clockwise": True}
# Largest steps (degrees) between samples of Cycles' cubics, by vertical and horizontal angle, which caustique joins by
# lines.
_STEPS = 1.25, 5.0


def found(light):
    """The IES profile that shapes the light of a point or spot lamp: its text (bytes), and the factor on the lamp's
    strength for each candela. None if the nodes do anything else with a profile, or the profile is missing."""
    output = output_of(nodes_of(light))
    shader, path = source(output.inputs["Surface"]) if output is not None else (None, ())
    if light.type not in {"POINT", "SPOT"} or shader is None or shader.type != "EMISSION":
        return None
    node, factor = _profile(shader.inputs["Strength"], path, 1.0)
    text = _text(node) if node is not None else None
    return (_smoothed(text), factor * _CANDELA) if text else None


def _profile(socket, path, factor):
    """The IES node that gives the value of a socket, and the constant factor on it; (None, factor) without one."""
    node, path = source(socket, path)
    if node is None:
        return None, factor
    if node.type == "TEX_IES":
        strength = constant(node.inputs["Strength"], path)
        plain = source(node.inputs["Vector"], path)[0] is None and strength is not None and strength >= 0
        return (node, factor * strength) if plain else (None, factor)
    if node.type == "MATH" and node.operation == "MULTIPLY" and not node.use_clamp:
        for own, other in ((0, 1), (1, 0)):
            number = constant(node.inputs[other], path)
            if number is not None and number >= 0 and source(node.inputs[own], path)[0] is not None:
                return _profile(node.inputs[own], path, factor * number)
    return None, factor


def _text(node):
    """The content of an IES node's profile (bytes), or None if it is missing."""
    if node.mode == "INTERNAL":
        return node.ies.as_string().encode() if node.ies is not None else None
    path = bpy.path.abspath(node.filepath, library=node.id_data.library)
    if not node.filepath or not os.path.isfile(path):
        return None
    with open(path, "rb") as file:
        return file.read()


def _smoothed(text):
    """An IES file (bytes) of type C sampled as Cycles interpolates it: by uniform Catmull-Rom cubics, also where its angles
    are uneven. Other files are returned unchanged."""
    try:
        vertical, horizontal, values = _read(text)
    except (ValueError, IndexError):
        return text
    above = values[:, 1:2] if vertical[0] < 1e-5 else _beyond(values[:, :1])
    up, values = _sampled(vertical, values, above, _beyond(values[:, -1:]), _STEPS[0])
    # Rounding keeps Cycles from recognizing a whole turn, so it does not continue the angles around.
    around, values = _sampled(horizontal, values.T, _beyond(values.T[:, :1]), _beyond(values.T[:, -2:-1]), _STEPS[1])
    values = numpy.maximum(values.T, 0.0)
    if numpy.allclose(values, values[:1], rtol=1e-6):
        around, values = around[:1], values[:1]
    lines = ["IESNA:LM-63-2002", "TILT=NONE", f"1 0 1 {len(up)} {len(around)} 1 2 0 0 0", "1 1 0"]
    lines += [" ".join(f"{x:.7g}" for x in row) for row in (up, around, *values)]
    return "\n".join(lines).encode() + b"\n"


def _beyond(values):
    """The values with which Cycles continues those at an end of the angles: before Blender 5.0 zero."""
    return values if bpy.app.version >= (5, 0) else 0.0 * values


def _read(text):
    """Vertical and horizontal angles (degrees) and the intensities (cd, a row per horizontal angle) of an IES file of type
    C, as Cycles reads them. Raises a ValueError or IndexError for other files."""
    lines = text.decode("latin-1").splitlines()
    tilt = next(i for i, line in enumerate([*lines, "TILT"]) if line.strip().upper().startswith("TILT"))
    if "".join(lines[tilt].upper().split()) != "TILT=NONE":
        raise ValueError(lines[tilt])
    words = [float(word) for word in " ".join(lines[tilt + 1:]).replace(",", " ").split()]
    rows, columns, kind = (int(words[i]) for i in (3, 4, 5))
    vertical, rest = numpy.array(words[13:13 + rows]), words[13 + rows:]
    horizontal, rest = numpy.array(rest[:columns]), rest[columns:]
    if kind != 1 or rows < 2 or len(rest) < rows * columns:
        raise ValueError(kind)
    values = numpy.array(rest[:rows * columns]).reshape(columns, rows) * (words[2] * words[10] * words[11])
    if horizontal[0] == 90:
        horizontal = horizontal - 90
    if columns == 1:
        horizontal, values = numpy.array([0.0, 360.0]), numpy.repeat(values, 2, axis=0)
    for end in (90, 180):
        if horizontal[-1] == end:
            horizontal = numpy.append(horizontal, 2 * end - horizontal[-2::-1])
            values = numpy.append(values, values[-2::-1], axis=0)
    steps, gap = numpy.diff(horizontal), 360 - horizontal[-1]
    if gap != 0 and gap in (steps[0], steps[-1]):
        horizontal, values = numpy.append(horizontal, 360.0), numpy.append(values, values[:1], axis=0)
    if horizontal[0] != 0 or horizontal[-1] != 360 or (steps <= 0).any() or (numpy.diff(vertical) <= 0).any():
        raise ValueError("angles")
    return vertical, horizontal, values


def _sampled(angles, values, before, after, step):
    """Angles at most `step` apart and the values there, (rows, angles), by Catmull-Rom cubics through `values`, which the
    columns `before` and `after` continue."""
    longer = numpy.concatenate([before, values, after], axis=1)
    a, b, c, d = (longer[:, i:i + len(angles) - 1] for i in range(4))
    found, rows = [], []
    for k, (low, high) in enumerate(zip(angles, angles[1:])):
        count = max(int(numpy.ceil((high - low) / step)), 1)
        x = numpy.arange(count) / count
        p, q, r, s = (part[:, k:k + 1] for part in (a, b, c, d))
        rows.append(0.5 * (((s + 3 * (q - r) - p) * x + (2 * p - 5 * q + 4 * r - s)) * x + (r - p)) * x + q)
        found.append(low + (high - low) * x)
    return numpy.append(numpy.concatenate(found), angles[-1]), numpy.concatenate([*rows, values[:, -1:]], axis=1)


def add(thing, flat):
    """Carry the IES profile of a lamp. Returns the factor on the lamp's strength for each candela, or None if it has no
    profile. `flat.profiles` keeps the texts."""
    profile = found(thing.data)
    if profile is None:
        return None
    text, factor = profile
    if text not in flat.profiles:
        flat.profiles.append(text)
    flat.add_extras(thing, ies={"profile": flat.profiles.index(text), **_TURN})
    return factor


def embed(document, buffer, texts):
    """Store the profiles `texts` in buffer views of a document, which the lights then name. Returns the buffer."""
    if not texts:
        return buffer
    buffer = bytearray(buffer)
    views = [glb.add_view(document, buffer, text) for text in texts]
    for node in document.get("nodes", []):
        ies = node.get("extras", {}).get("caustique", {}).get("ies")
        if ies is not None:
            ies["bufferView"] = views[int(ies.pop("profile"))]
    return bytes(buffer)
