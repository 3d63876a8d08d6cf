"""Twins of scenes: without what the peers' drivers cannot say, so that they and we render the same.

Glass does not absorb and has one index; coats, sheen and the lens's opening are gone; highlights are whole or none. What makes a
scene another one stays: a twin that a driver cannot take even so (media, spots, nested glass) is none.
"""

import shutil

from _cache import CACHE
from _translate import PLAIN, Translation, gltf, pack


def plain(document):
    """Takes from a document what can go; returns whether there was any."""
    before = repr(document)
    for material in document.get("materials", []):
        extensions = material.get("extensions", {})
        for name in set(extensions) - PLAIN:
            del extensions[name]
        for key in ("attenuationDistance", "attenuationColor"):
            extensions.get("KHR_materials_volume", {}).pop(key, None)
        specular = extensions.get("KHR_materials_specular", {})
        specular.pop("specularColorFactor", None)
        if specular.get("specularFactor", 1):
            extensions.pop("KHR_materials_specular", None)
        if not extensions.get("KHR_materials_transmission"):
            extensions.pop("KHR_materials_ior", None)
    for part in [*document.get("cameras", []), *document["nodes"]]:
        gltf.extras(part).pop("aperture_radius", None)
        gltf.extras(part).pop("focus_distance", None)
    used = {name for material in document.get("materials", []) for name in material.get("extensions", {})}
    for key in ("extensionsUsed", "extensionsRequired"):
        kept = [name for name in document.get(key, []) if not name.startswith("KHR_materials_") or name in used]
        document[key] = kept
        if not kept:
            del document[key]
    return repr(document) != before


def twin(scene):
    """The twin of a scene as a file of its own; nothing where the drivers take the scene itself, or not even its twin."""
    found = Translation(scene)
    if not found.blockers and not any("material" in text for text in found.approximations):
        return None
    document, binary = gltf.chunks(scene.read_bytes())
    if not plain(document):
        return None
    folder = CACHE / "twins"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / scene.name
    pack(path, document, binary)
    environment = gltf.extras(document["scenes"][document.get("scene", 0)]).get("environment") or {}
    if "file" in environment:
        shutil.copy(scene.parent / environment["file"], folder)
    return None if Translation(path).blockers else path
