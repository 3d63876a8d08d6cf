"""Node trees of materials, lights and the world, and interiors: solid glass (KHR_materials_volume), absorption and
scattering of volume shaders, dispersion."""

import math

# Custom property of a material whose medium varies in space: the index of its volume.
VOLUME = "caustique_volume"

def nodes_of(block):
    """The node tree of a material, light or world, or None. In Blender 5 the switch is always on, but for lights of 5.0."""
    return block.node_tree if getattr(block, "use_nodes", True) else None


def output_of(tree, target="CYCLES"):
    """The active material, world or light output node of a node tree, or None."""
    if tree is None:
        return None
    if hasattr(tree, "get_output_node"):
        node = tree.get_output_node(target)
        if node is not None:
            return node
    outputs = [n for n in tree.nodes if n.type in {"OUTPUT_MATERIAL", "OUTPUT_WORLD", "OUTPUT_LIGHT"}]
    return next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)


def source(socket):
    """The node linked to a socket, past reroutes, or None."""
    while socket is not None and socket.is_linked:
        node = socket.links[0].from_node
        if node.type != "REROUTE":
            return node
        socket = node.inputs[0]
    return None


def constant(socket, fallback=None):
    """The value of an unlinked socket: a float or a list of three. `fallback` if it is linked."""
    node = source(socket)
    if node is None:
        value = socket.default_value
    elif node.type in {"VALUE", "RGB"}:
        value = node.outputs[0].default_value
    else:
        return fallback
    return float(value) if isinstance(value, (int, float)) else [float(x) for x in value][:3]


def leaves(node):
    """The shaders below the mixes and sums of a shader tree."""
    if node is None:
        return []
    if node.type in {"MIX_SHADER", "ADD_SHADER"}:
        sockets = [s for s in node.inputs if s.type == "SHADER"]
        return [leaf for s in sockets for leaf in leaves(source(s))]
    return [node]


def medium(volume, where, warn):
    """Coefficients (sigma_a, sigma_s, g) in 1/m of a volume shader, as Cycles defines them, or None if empty."""
    sigma_a, sigma_s, moment = [0.0] * 3, [0.0] * 3, 0.0

    def add(node, weight):
        nonlocal moment
        if node is None:
            return
        values = {s.identifier: constant(s) for s in node.inputs if s.type in {"VALUE", "RGBA", "VECTOR"}}
        density = values.get("Density", 1.0)
        if node.type == "ADD_SHADER":
            for socket in node.inputs:
                add(source(socket), weight)
            return
        if node.type == "MIX_SHADER" and values.get("Fac") is not None:
            add(source(node.inputs[1]), weight * (1 - values["Fac"]))
            add(source(node.inputs[2]), weight * values["Fac"])
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
        g = values.get("Anisotropy", 0.0)
        for i in range(3):
            sigma_a[i] += weight * max(absorb[i], 0)
            sigma_s[i] += weight * max(scatter[i], 0)
        moment += g * weight * sum(scatter) / 3

    add(volume, 1.0)
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
    inside = medium(source(output.inputs["Volume"]), where, warn) if output is not None and not varies else None
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
