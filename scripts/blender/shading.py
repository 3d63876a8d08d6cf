"""Node trees of materials, lights and the world, and interiors: solid glass (KHR_materials_volume), absorption and
scattering of volume shaders, dispersion.

A *path* lists the group nodes around a socket or a node, outermost first.
"""

import math

# Custom property of a material whose medium varies in space: the index of its volume.
VOLUME = "caustique_volume"
# Custom property of a material whose faces emit from their front alone, which Cycles cannot express.
ONE_SIDED = "caustique_one_sided"


def nodes_of(block):
    """The node tree of a material, light or world, or None. In Blender 5 the switch is always on, but for lights of 5.0."""
    return block.node_tree if getattr(block, "use_nodes", True) else None


def output_of(tree):
    """The material, world or light output node of a node tree that Cycles uses, or None."""
    return tree.get_output_node("CYCLES") if tree is not None else None


def find_socket(sockets, identifier):
    """The socket with this identifier, or None. Names may repeat, identifiers do not."""
    return next((s for s in sockets if s.identifier == identifier), None)


def source_socket(socket, path=()):
    """The socket that an input's value comes from, and its path, past reroutes, muted nodes and group borders.

    The socket is an output, or the input that holds the value, or None if a group lacks the output.
    """
    while socket.is_linked and not socket.links[0].is_muted:
        output, node = socket.links[0].from_socket, socket.links[0].from_node
        inner = None
        if node.type == "REROUTE":
            inner = node.inputs[0]
        elif node.mute:
            inner = next((i.from_socket for i in node.internal_links if i.to_socket == output), None)
            if inner is None:
                return socket, path  # as in Cycles, which drops the link
        elif node.type == "GROUP" and node.node_tree is not None:
            end = group_output(node.node_tree)
            inner = find_socket(end.inputs, output.identifier) if end is not None else None
            if inner is None:
                return None, path
            path += (node,)
        elif node.type == "GROUP_INPUT" and path:
            inner, path = find_socket(path[-1].inputs, output.identifier), path[:-1]
        if inner is None:
            return output, path
        socket = inner
    return socket, path


def group_output(tree):
    """The active output node of a group, or None."""
    ends = [n for n in tree.nodes if n.type == "GROUP_OUTPUT"]
    return next((n for n in ends if n.is_active_output), ends[0] if ends else None)


def upstream(socket, path=(), seen=None):
    """All nodes that an input socket's value depends on, each with the output that is used."""
    seen = {} if seen is None else seen
    output, path = source_socket(socket, path)
    if output is None or not output.is_output:
        return seen
    key = (output.node.as_pointer(), output.identifier, tuple(n.as_pointer() for n in path))
    if key not in seen:
        seen[key] = (output.node, output)
        for inner in output.node.inputs:
            upstream(inner, path, seen)
    return seen


def source(socket, path=()):
    """The node that an input's value comes from, or None, and its path."""
    output, path = source_socket(socket, path)
    return (output.node if output is not None and output.is_output else None), path


def luminance(colour):
    """The luminance of a linear colour, which Cycles links to numbers."""
    return 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]


def constant(socket, path=(), fallback=None):
    """The value of an input if it is constant, else `fallback`: a float, or three for a colour or vector."""
    output, path = source_socket(socket, path)
    if output is not None and output.is_output and output.node.type not in {"VALUE", "RGB"}:
        return fallback
    value = output.default_value if output is not None else 0.0
    if socket.type in {"RGBA", "VECTOR"}:
        return tuple(map(float, value))[:3] if hasattr(value, "__len__") else (float(value),) * 3
    if not hasattr(value, "__len__"):
        return float(value)
    return sum(value) / 3 if output.type == "VECTOR" else luminance(value)  # as Cycles converts them


def positive(light, say):
    """The components of emitted light. `say` receives a warning if some are negative, which become 0."""
    if min(light) < 0:
        say("its light is negative, which Cycles subtracts: here it is 0; use a darker material, or less light")
    return [max(component, 0.0) for component in light]


def leaves(socket, path=()):
    """The shaders below the mixes and sums at a shader input, each with its path."""
    node, path = source(socket, path)
    if node is None:
        return []
    if node.type in {"MIX_SHADER", "ADD_SHADER"}:
        return [leaf for s in node.inputs if s.type == "SHADER" for leaf in leaves(s, path)]
    return [(node, path)]


def warn_of_phase(shader, where, warn):
    """Warn of a volume shader that scatters by another phase function than Henyey and Greenstein's."""
    if getattr(shader, "phase", "HENYEY_GREENSTEIN") != "HENYEY_GREENSTEIN":
        warn(where, "its phase function is taken for Henyey-Greenstein; "
                    "choose Phase > Henyey-Greenstein to see the same in both")


def medium(volume, where, warn):
    """Coefficients (sigma_a, sigma_s, g) in 1/m of the shader at a Volume input, as in Cycles, or None if empty."""
    sigma_a, sigma_s, moment = [0.0] * 3, [0.0] * 3, 0.0

    def add(socket, path, weight):
        nonlocal moment
        node, path = source(socket, path)
        if node is None:
            return
        # Inputs that the phase function does not use are not enabled.
        values = {s.identifier: constant(s, path) for s in node.inputs
                  if s.enabled and s.type in {"VALUE", "RGBA", "VECTOR"}}
        density = values.get("Density", 1.0)
        if node.type == "ADD_SHADER":
            for socket in node.inputs:
                add(socket, path, weight)
            return
        if node.type == "MIX_SHADER" and values.get("Fac") is not None:
            add(node.inputs[1], path, weight * (1 - values["Fac"]))
            add(node.inputs[2], path, weight * values["Fac"])
            return
        if any(v is None for v in values.values()):
            warn(where, f"the {node.bl_label} node varies in space: it is not carried; "
                        "use constant values, or an OpenVDB file in a Volume object")
            return
        absorb = scatter = [0.0] * 3
        if node.type == "VOLUME_ABSORPTION":
            absorb = [(1 - c) * density for c in values["Color"]]
        elif node.type == "VOLUME_SCATTER":
            scatter = [c * density for c in values["Color"]]
        elif node.type == "PRINCIPLED_VOLUME":
            tint = values["Absorption Color"]
            scatter = [c * density for c in values["Color"]]
            absorb = [max(1 - c, 0) * max(1 - math.sqrt(t), 0) * density for c, t in zip(values["Color"], tint)]
            if values.get("Emission Strength") or values.get("Blackbody Intensity"):
                warn(where, "the glow of the volume is not carried; "
                            "use an OpenVDB file in a Volume object, or put a glowing mesh inside")
        elif node.type == "VOLUME_COEFFICIENTS":
            absorb, scatter = values["Absorption Coefficients"], values["Scatter Coefficients"]
        else:
            warn(where, f"the {node.bl_label} node is not a volume that can be carried; "
                        "use Volume Absorption, Volume Scatter or Principled Volume")
        warn_of_phase(node, where, warn)
        g = values.get("Anisotropy", 0.0)
        for i in range(3):
            sigma_a[i] += weight * max(absorb[i], 0)
            sigma_s[i] += weight * max(scatter[i], 0)
        moment += g * weight * sum(scatter) / 3

    add(volume, (), 1.0)
    if not any(sigma_a + sigma_s):
        return None
    total = sum(sigma_s) / 3
    return {"sigma_a": sigma_a, "sigma_s": sigma_s, "g": moment / total if total else 0.0}


def finish(entry, material, closed, thickness, warn):
    """Complete the glTF material `entry` that the exporter wrote for `material`.

    `closed`: whether every mesh with this material is closed. `thickness`: a length inside it (m).
    """
    where = f'material "{material.name}"'
    output = output_of(nodes_of(material))
    extensions = entry.setdefault("extensions", {})
    varies = VOLUME in material
    inside = medium(output.inputs["Volume"], where, warn) if output is not None and not varies else None
    clear = extensions.get("KHR_materials_transmission")
    if extensions.get("KHR_materials_volume") == {"thicknessFactor": 0}:  # a film, closed mesh or not
        if inside is not None:
            warn(where, "its volume shader lies behind a film: it is not carried; "
                        "use a Glass or Principled BSDF as the surface")
        return
    if clear is not None and not closed and "KHR_materials_volume" not in extensions:
        warn(where, "transmissive, but on a mesh that is not closed: it stays a thin sheet that bends no light; close its "
             "holes (Mesh > Clean Up > Fill Holes), or give it thickness (Solidify)")
    if clear is not None and (closed or "KHR_materials_volume" in extensions):
        volume = extensions.setdefault("KHR_materials_volume", {})
        volume.setdefault("thicknessFactor", thickness)
        # The exporter writes -ln(color) * density, Cycles absorbs (1 - color) * density: use that of Cycles.
        volume.pop("attenuationColor", None)
        volume.pop("attenuationDistance", None)
        if inside is not None and not any(inside["sigma_s"]):
            strongest = max(inside["sigma_a"])
            volume["attenuationDistance"] = 1 / strongest
            volume["attenuationColor"] = [math.exp(-s / strongest) for s in inside["sigma_a"]]
        number = material.get("abbe")
        spread = 20 / float(number) if number else float(material.get("dispersion", 0))
        if spread > 0:
            extensions["KHR_materials_dispersion"] = {"dispersion": spread}
    if isinstance(material.get("priority"), (int, float)):
        entry.setdefault("extras", {}).setdefault("caustique", {})["priority"] = int(material["priority"])
    if inside is not None and any(inside["sigma_s"]) and closed:
        entry.setdefault("extras", {}).setdefault("caustique", {})["medium"] = inside
    elif inside is not None and (clear is None or not closed):
        warn(where, "its volume shader needs a closed, transmissive mesh: it is not carried; close its holes (Mesh > Clean Up "
                    "> Fill Holes), and let its surface transmit light")
    if not extensions:
        del entry["extensions"]
