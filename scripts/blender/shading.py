"""Blender materials in terms of what glTF can say.

Blender's exporter understands the Principled and Emission shaders alone. `principled` puts a Principled shader in the
place of the common others while the export runs. `finish` then completes the written material: solid glass
(KHR_materials_volume), absorption and scattering of the volume shader, dispersion.
"""

import math

import bpy

_GLOSSY = {"BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC"}
_GLASS = {"BSDF_GLASS", "BSDF_REFRACTION"}
_IMAGE_ONLY = ("Base Color", "Roughness", "Metallic", "Transmission Weight", "Alpha", "Emission Color")


def nodes_of(block):
    """The node tree that shades a material, light or world, or None. Since Blender 5 `use_nodes` says nothing."""
    return block.node_tree if bpy.app.version >= (5, 0, 0) or block.use_nodes else None


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
    """The node that feeds a socket, reroutes skipped, or None."""
    while socket is not None and socket.is_linked:
        node = socket.links[0].from_node
        if node.type != "REROUTE":
            return node
        socket = node.inputs[0]
    return None


def constant(socket, fallback=None):
    """The value of a socket that nothing varies: a float or a list of three. `fallback` where something does."""
    node = source(socket)
    if node is None:
        value = socket.default_value
    elif node.type in {"VALUE", "RGB"}:
        value = node.outputs[0].default_value
    else:
        return fallback
    return float(value) if isinstance(value, (int, float)) else [float(x) for x in value][:3]


def leaves(node):
    """The shaders under the mixes and sums of a shader tree."""
    if node is None:
        return []
    if node.type in {"MIX_SHADER", "ADD_SHADER"}:
        sockets = [s for s in node.inputs if s.type == "SHADER"]
        return [leaf for s in sockets for leaf in leaves(source(s))]
    return [node]


def _copy(tree, socket_from, socket_to):
    if socket_from.is_linked:
        tree.links.new(socket_from.links[0].from_socket, socket_to)
    elif socket_to.type == "VALUE":
        socket_to.default_value = constant(socket_from)
    else:
        socket_to.default_value = [*constant(socket_from), 1.0]


def principled(material, undo, warn):
    """Until `undo` (a contextlib.ExitStack) closes, let `material` end in a Principled or Emission shader."""
    tree, output = nodes_of(material), output_of(nodes_of(material))
    where = f'material "{material.name}"'
    if output is None:
        return
    parts = leaves(source(output.inputs["Surface"]))
    kinds = {p.type for p in parts}
    if len(parts) == 1 and kinds <= {"BSDF_PRINCIPLED", "EMISSION"}:
        _warn_of_textures(parts[0], where, warn)
        return
    if not parts and not output.inputs["Volume"].is_linked:
        return

    def pick(*names):
        return next((p for p in parts if p.type in names), None)

    glass = pick(*_GLASS)
    base = pick("BSDF_PRINCIPLED") or glass or pick("BSDF_DIFFUSE", *_GLOSSY) or (parts[0] if parts else None)
    emission = pick("EMISSION")
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    undo.callback(lambda: tree.nodes.remove(node))
    into = node.inputs
    rest = kinds - {"EMISSION"}
    if base is None or kinds == {"BSDF_TRANSPARENT"}:
        if output.inputs["Volume"].is_linked:  # a boundary of the medium that bends nothing
            into["Base Color"].default_value = (1, 1, 1, 1)
            into["Transmission Weight"].default_value = 1
            into["Roughness"].default_value = 0
            into["IOR"].default_value = 1
        else:
            into["Alpha"].default_value = 0
    elif glass is not None and rest <= _GLASS | _GLOSSY | {"BSDF_TRANSPARENT"}:
        into["Transmission Weight"].default_value = 1
        _copy(tree, glass.inputs["Color"], into["Base Color"])
        _copy(tree, glass.inputs["Roughness"], into["Roughness"])
        _copy(tree, glass.inputs["IOR"], into["IOR"])
        if rest == {"BSDF_REFRACTION"}:
            warn(where, "a Refraction shader alone gains the reflection of the same surface")
    elif base.type == "BSDF_PRINCIPLED":
        for socket in base.inputs:
            if socket.name in into and socket.type in {"VALUE", "RGBA"}:
                _copy(tree, socket, into[socket.name])
        _warn_of_textures(base, where, warn)
        if rest != {"BSDF_PRINCIPLED"}:
            warn(where, f"of its mixed shaders {sorted(rest)} only the Principled one is carried")
    else:
        colour = base.inputs.get("Color") or base.inputs.get("Base Color")
        if colour is not None:
            _copy(tree, colour, into["Base Color"])
        if base.type in _GLOSSY:
            into["Metallic"].default_value = 1
            _copy(tree, base.inputs["Roughness"], into["Roughness"])
        else:
            into["Roughness"].default_value = 1
            into["Specular IOR Level"].default_value = 0
        if rest - {"BSDF_DIFFUSE"} - _GLOSSY or len(rest) > 1:
            warn(where, f"shaders {sorted(rest)} are approximated by {base.type}")
    if emission is not None and base is not emission:
        _copy(tree, emission.inputs["Color"], into["Emission Color"])
        _copy(tree, emission.inputs["Strength"], into["Emission Strength"])
    surface = output.inputs["Surface"]
    before = surface.links[0].from_socket if surface.is_linked else None
    if before is not None:
        undo.callback(lambda: tree.links.new(before, surface))
    tree.links.new(node.outputs[0], surface)


def _warn_of_textures(node, where, warn):
    for name in _IMAGE_ONLY:
        fed = source(node.inputs[name]) if name in node.inputs else None
        if fed is not None and fed.type in _PROCEDURAL:
            warn(where, f"{name} comes from a {fed.bl_label} node: bake it to an image to carry it")
    bump = source(node.inputs["Normal"]) if "Normal" in node.inputs else None
    if bump is not None and bump.type != "NORMAL_MAP":
        warn(where, f"the {bump.bl_label} node is not carried: bake it to a normal map")
    for name in ("Subsurface Weight", "Thin Film Thickness"):
        if name in node.inputs and constant(node.inputs[name], 1.0):
            warn(where, f"{name} is not carried")


_PROCEDURAL = {
    "TEX_NOISE", "TEX_VORONOI", "TEX_WAVE", "TEX_MAGIC", "TEX_BRICK", "TEX_CHECKER", "TEX_GRADIENT", "TEX_MUSGRAVE",
    "TEX_WHITE_NOISE", "TEX_GABOR", "VALTORGB", "BLACKBODY", "WAVELENGTH", "OBJECT_INFO", "FRESNEL", "LAYER_WEIGHT",
}


def medium(volume, where, warn):
    """Coefficients (sigma_a, sigma_s, g) in 1/m of a volume shader as Cycles defines them, or None for a void."""
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
            warn(where, f"the {node.bl_label} node varies in space: it is not carried")
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
                warn(where, "the glow of the volume is not carried")
        elif node.type == "VOLUME_COEFFICIENTS":
            absorb, scatter = values["Absorption Coefficients"], values["Scatter Coefficients"]
        else:
            warn(where, f"the {node.bl_label} node is not a volume that can be carried")
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

    `closed` says whether every mesh that wears it is watertight, `thickness` is a length inside it in metres.
    """
    where = f'material "{material.name}"'
    output = output_of(nodes_of(material))
    extensions = entry.setdefault("extensions", {})
    inside = medium(source(output.inputs["Volume"]), where, warn) if output is not None else None
    clear = extensions.get("KHR_materials_transmission")
    if clear is not None and not closed and "KHR_materials_volume" not in extensions:
        warn(where, "transmissive, but on a mesh that is not closed: it stays a thin sheet that bends no light")
    if clear is not None and (closed or "KHR_materials_volume" in extensions):
        volume = extensions.setdefault("KHR_materials_volume", {})
        volume.setdefault("thicknessFactor", thickness)
        # The exporter writes -ln(color) * density, Cycles absorbs (1 - color) * density: ours are Cycles' numbers.
        volume.pop("attenuationColor", None)
        volume.pop("attenuationDistance", None)
        if inside is not None and not any(inside["sigma_s"]):
            strongest = max(inside["sigma_a"])
            volume["attenuationDistance"] = 1 / strongest
            volume["attenuationColor"] = [math.exp(-s / strongest) for s in inside["sigma_a"]]
        _square_root_tint(entry, material)
        number = material.get("abbe")
        spread = 20 / float(number) if number else float(material.get("dispersion", 0))
        if spread > 0:
            extensions["KHR_materials_dispersion"] = {"dispersion": spread}
    if inside is not None and any(inside["sigma_s"]) and closed:
        entry.setdefault("extras", {}).setdefault("caustique", {})["medium"] = inside
    elif inside is not None and (clear is None or not closed):
        warn(where, "its volume shader needs a closed, transmissive mesh: it is not carried")
    if not extensions:
        del entry["extensions"]


def _square_root_tint(entry, material):
    """Principled tints light once on its way through the body, glTF at each of the two surfaces."""
    parts = leaves(source(output_of(nodes_of(material)).inputs["Surface"]))
    pbr = entry.get("pbrMetallicRoughness", {})
    if [p.type for p in parts] == ["BSDF_PRINCIPLED"] and "baseColorFactor" in pbr and "baseColorTexture" not in pbr:
        *rgb, alpha = pbr["baseColorFactor"]
        pbr["baseColorFactor"] = [math.sqrt(max(c, 0)) for c in rgb] + [alpha]
