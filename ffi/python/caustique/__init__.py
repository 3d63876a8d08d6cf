"""caustique renders caustics, and caustics seen through glass, water and mirrors, with known error.

    import caustique

    scene = caustique.Scene("pool.glb")
    image = scene.render(iterations=64, width=640)
    image.save("pool.exr")
    noisy = image["Noisy"]                # (H, W, 3) float32
    red = image.layers["Noisy"]["R"]      # (H, W) float32, not copied

Lengths are metres, the world is right-handed with y up, colours are scene-linear Rec. 709. Radiance is in W/(sr m2),
radiant intensity in W/sr, irradiance in W/m2. Anything in a scene that is ignored or approximated gives a SceneWarning;
anything invalid raises an Error, which says what to do.
"""

import importlib.util
import os
import sys
from collections.abc import Sequence

from . import _native
from ._native import (
    Error,
    FinishedFrames,
    Image,
    Progress,
    SceneWarning,
    __version__,
    compare,
    finish,
    finish_frames,
    merge,
    read,
)
from .glb import pack
from .meshes import Camera, Light, Material, Medium, Mesh, PointLight, SpotLight, SunLight, Texture

__all__ = [
    "Camera",
    "Error",
    "FinishedFrames",
    "Image",
    "Light",
    "Material",
    "Medium",
    "Mesh",
    "PointLight",
    "Progress",
    "Scene",
    "SceneWarning",
    "SpotLight",
    "SunLight",
    "Texture",
    "__version__",
    "compare",
    "finish",
    "finish_frames",
    "libraries",
    "merge",
    "pack",
    "read",
]

# This Python reads files of Blender if it has the module. In Blender itself, `bpy` belongs to the running program.
_bpy = importlib.util.find_spec("bpy") if "bpy" not in sys.modules else sys.modules["bpy"].__spec__
if _bpy is not None and str(_bpy.origin).endswith(".so"):
    os.environ.setdefault("CAUSTIQUE_BLENDER", sys.executable)

# The former name of `finish`.
combine = finish


class Scene(_native.Scene):
    """A scene that has been read and built. It can be rendered repeatedly, also from several threads at the same time.

    `source` is the path of a .glb, .gltf or .blend file or of a stage of USD, or the bytes of a .glb. Options:

    environment            environment light instead of the scene's own: a path of an .exr or .hdr, a radiance
                           (r, g, b), or an array (H, W, 3) of radiance in latitude and longitude, the top row first
    environment_rotation   rotation about the vertical, degrees, counter-clockwise seen from above
    environment_strength   factor on the radiance of the environment
    light_preset           'studio', 'studio-floor', 'sky' or 'none': light of a scene without any [default:
                           'studio'], or instead of its environment
    background             'show' or 'hide' the environment behind the scene
    light_units            'auto', 'radiometric' or 'photometric': the unit of the file's lamps
    glass                  'auto', 'solid' or 'thin': the kind of glass if the file does not say
    effects                effects to switch off or on, such as '-dispersion,+volume'
    frame                  frame of the file's animation
    scene_name, animation, variant
                           names of the scene, the only animation and the material variant to render
    pose                   'animated', or 'rest': without any animation
    allow_outside          allow the scene to name files outside its own folder
    strict                 raise an error for anything that is ignored or approximated
    threads                threads that build the scene; 0 takes all cores
    """

    @classmethod
    def from_meshes(
        cls,
        meshes: Sequence[Mesh],
        *,
        lights: Sequence[Light] = (),
        cameras: Sequence[Camera] = (),
        environment=None,
        medium: Medium | None = None,
        **options,
    ) -> "Scene":
        """Builds a scene from numpy meshes, with the options of Scene. `medium` fills the space.

        The arrays are copied. `pack` makes a file of the same meshes, lights and cameras.
        """
        if environment is None:
            # An explicit black environment avoids the warning of a missing one.
            environment = (0.0, 0.0, 0.0)
        return cls(pack(meshes, lights=lights, cameras=cameras, medium=medium), environment=environment, **options)


def libraries(
    *,
    embree: str | os.PathLike | None = None,
    oidn: str | os.PathLike | None = None,
    onnxruntime: str | os.PathLike | None = None,
) -> dict[str, dict]:
    """Finds the libraries that are loaded on demand: their files and versions, and how to install missing ones.

    Arguments name files to load instead. A library is loaded once, at its first use, so name its file before. The
    arguments set the variables CAUSTIQUE_EMBREE, CAUSTIQUE_OIDN and CAUSTIQUE_ONNXRUNTIME of this process. Without
    them, the libraries are searched in this package, by the system's loader, then in the folder .deps: in the folder that
    CAUSTIQUE_HOME names, else in the folders above this package. The current folder is not searched.

    Returns a dict for each of 'embree', 'oidn' and 'onnxruntime': 'found', and 'version', 'path' and 'from' (the
    variable, 'package', 'scripts/setup.sh' or 'system') or 'cause' and 'hint'.
    """
    named = {"embree": embree, "oidn": oidn, "onnxruntime": onnxruntime}
    for name, path in named.items():
        if path is not None:
            os.environ[f"CAUSTIQUE_{name.upper()}"] = os.fspath(path)
    found = _native.find_libraries()
    for name, path in named.items():
        taken = found[name].get("path")
        if path is not None and taken is not None and not os.path.samefile(path, taken):
            raise Error(f"{name}: {taken} is loaded already\nhint: call caustique.libraries before anything else")
    return found
