"""Twins of scenes: copies without the features that the drivers of other renderers cannot translate.

Glass does not absorb and has one index; coats, sheen and lens apertures are removed. Materials that are neither metal
nor glass are matte, because LuxCore's glossy coat is darker. Media, spots and nested glass stay, because a scene without
them would be another one; such scenes have no twin.
"""

import json
import shutil

import gltf
import plain_scene

from .cache import CACHE


def without(document):
    """Removes untranslatable features from a document; returns whether it had any."""
    before = json.dumps(document, sort_keys=True)
    for material in document.get("materials", []):
        extensions = material.get("extensions", {})
        for name in set(extensions) - plain_scene.SUPPORTED:
            del extensions[name]
        for key in ("attenuationDistance", "attenuationColor"):
            extensions.get("KHR_materials_volume", {}).pop(key, None)
        metallic = material.get("pbrMetallicRoughness", {}).get("metallicFactor", 1)
        if not metallic and "KHR_materials_transmission" not in extensions:
            extensions.pop("KHR_materials_ior", None)
            if extensions.get("KHR_materials_specular", {}).get("specularFactor", 1):
                material.setdefault("extensions", extensions)["KHR_materials_specular"] = {"specularFactor": 0}
    for part in [*document.get("cameras", []), *document["nodes"]]:
        gltf.extras(part).pop("aperture_radius", None)
        gltf.extras(part).pop("focus_distance", None)
    used = {name for material in document.get("materials", []) for name in material.get("extensions", {})}
    for key in ("extensionsUsed", "extensionsRequired"):
        named = document.pop(key, [])
        kept = [name for name in named if not name.startswith("KHR_materials_") or name in used]
        if key == "extensionsUsed":
            kept += sorted(used - set(kept))
        if kept:
            document[key] = kept
    return json.dumps(document, sort_keys=True) != before


def twin(scene):
    """Writes the twin of a scene; returns its file, or None if it equals the scene or the drivers cannot translate it."""
    document, binary = gltf.chunks(scene.read_bytes())
    if not without(document):
        return None
    folder = CACHE / "twins"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / scene.name
    gltf.pack(path, document, binary)
    environment = gltf.extras(document["scenes"][document.get("scene", 0)]).get("environment") or {}
    if "file" in environment:
        shutil.copy(scene.parent / environment["file"], folder)
    return None if plain_scene.Scene(path).blockers else path
