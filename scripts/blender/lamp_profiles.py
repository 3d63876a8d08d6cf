"""IES profiles in the nodes of lamps."""

import os

import bpy

import glb
from shading import constant, nodes_of, output_of, source

# The strength (W/sr per watt of a lamp over all directions) that Cycles' IES node has for a candela: 4 pi / 177.83, with
# the luminous efficacy of daylight (D65).
_CANDELA = 0.0706650768394
# Cycles' horizontal angles start at -Y and run clockwise, as seen from behind the lamp.
_TURN = {"rotation_deg": -90.0, "clockwise": True}


def found(light):
    """The IES profile that shapes the light of a point or spot lamp: its text (bytes), and the factor on the lamp's
    strength for each candela. None if the nodes do anything else with a profile, or the profile is missing."""
    output = output_of(nodes_of(light))
    shader = source(output.inputs["Surface"]) if output is not None else None
    if light.type not in {"POINT", "SPOT"} or shader is None or shader.type != "EMISSION":
        return None
    node, factor = _profile(shader.inputs["Strength"], 1.0)
    text = _text(node) if node is not None else None
    return (text, factor * _CANDELA) if text else None


def _profile(socket, factor):
    """The IES node that gives the value of a socket, and the constant factor on it; (None, factor) without one."""
    node = source(socket)
    if node is None or node.mute:
        return None, factor
    if node.type == "TEX_IES":
        strength = constant(node.inputs["Strength"])
        plain = not node.inputs["Vector"].is_linked and strength is not None and strength >= 0
        return (node, factor * strength) if plain else (None, factor)
    if node.type == "MATH" and node.operation == "MULTIPLY" and not node.use_clamp:
        for own, other in ((0, 1), (1, 0)):
            number = constant(node.inputs[other])
            if number is not None and number >= 0 and source(node.inputs[own]) is not None:
                return _profile(node.inputs[own], factor * number)
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
