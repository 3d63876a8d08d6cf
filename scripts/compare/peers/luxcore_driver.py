"""Renders with LuxCore (see driver.py). Modes: `path`, `path_cache` (path tracing with PhotonGI's caustic cache),
`bidir`, and `bidirvm` (bidirectional with vertex merging).

The driver works around these properties of LuxCore, each measured against a closed form or against Mitsuba:

- Film rows count from the bottom, so the picture is one row too low: the screen window is shifted by a pixel.
- `power = efficency = 0` makes an emission a radiance, but a point lamp's colour is still divided by 4 pi.
- Bidirectional paths are 2 to 7 % too bright if roulette begins early on camera paths: it begins at depth 10.
- Environment texels are sampled as constants but interpolated: a map of four times the resolution avoids fireflies.
- Most of the emission of a lamp of 1,280 triangles is lost: lamps with size are meshes of 80 triangles, and with the
  caustic cache LuxCore's own, which are a fifth too bright with bidirectional paths.
- BIDIRVMCPU is slow with the sampler SOBOL. With RANDOM it renders every sixteenth pixel first, unless
  the bucket size is 1.
- The caustic cache has 400,000 photons; radii start at 0.5 % of the casters' size and shrink every 24 samples.
"""

import os
import tempfile
import time
from dataclasses import replace

import numpy as np

# LuxCore has its own allocator: import all other native modules first.
import driver
import pictures
import plain_scene

import pyluxcore as lux

ENGINES = {"path": "PATHCPU", "path_cache": "PATHCPU", "bidir": "BIDIRCPU", "bidirvm": "BIDIRVMCPU"}
#: Rotation from +Y up to +Z up.
TURN = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
#: LuxCore: u = atan2(y, x) / 2 pi. The scene: u = atan2(x, -z) / 2 pi. This matrix exchanges x and y.
ENVIRONMENT = "0 1 0 0 1 0 0 0 0 0 1 0 0 0 0 1"
#: Factor of the environment's resolution.
UPSAMPLING = 4


def text(values):
    """Numbers as text for LuxCore's properties."""
    return " ".join(f"{float(value):.9g}" for value in np.ravel(values))


def turned(points):
    return points @ TURN[:3, :3].T


def camera(of, width, height):
    """LuxCore's properties of the camera."""
    matrix = TURN @ of.to_world
    eye, ahead = matrix[:3, 3], -matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    # LuxCore's field of view is that of the shorter side.
    half = np.tan(of.yfov / 2) * (min(width / height, 1))
    x, y = max(width / height, 1), max(height / width, 1)
    row = 2 * y / height
    return {
        "type": "perspective",
        "lookat.orig": text(eye),
        "lookat.target": text(eye + ahead),
        "up": text(matrix[:3, 1]),
        "fieldofview": text(np.degrees(2 * np.arctan(half))),
        "screenwindow": text([-x, x, -y - row, y - row]),
        "lensradius": text(of.aperture_radius),
        "focaldistance": text(of.focus_distance),
        "autofocus.enable": 0,
        "cliphither": 0.001,
        "clipyon": 1e6,
    }


def coated(of, name, folder):
    """LuxCore's properties of a material with a clear coat, whose base is a material of its own."""
    own, alpha = f"scene.materials.{name}.", text(of.coat_roughness**2)
    base = material(replace(of, coat=0.0), f"{name}_base", folder)
    shine = 0.04 * of.coat
    found = {
        own + "type": "glossycoating",
        own + "base": f"{name}_base",
        own + "ks": text([shine] * 3),
        own + "multibounce": 0,
        own + "uroughness": alpha,
        own + "vroughness": alpha,
    }
    # The coat lies on light that the base emits, too.
    emission = {key: value for key, value in base.items() if ".emission" in key}
    return base | found | {key.replace(f"{name}_base", name): value for key, value in emission.items()}


def material(of, name, folder):
    """LuxCore's properties of a material, its texture and its volume."""
    if of.coat:
        return coated(of, name, folder)
    found = {}
    own, base, alpha = f"scene.materials.{name}.", text(of.base), text(of.roughness**2)
    if of.texture:
        file, base = os.path.join(folder, f"{name}.image"), f"texture_{name}"
        with open(file, "wb") as sink:
            sink.write(of.texture)
        texture = f"scene.textures.{base}."
        found.update(
            {
                texture + "type": "imagemap",
                texture + "file": file,
                texture + "gamma": 2.2,
                texture + "mapping.type": "uvmapping2d",
                texture + "mapping.uvscale": "1 -1",
            }
        )
    if of.kind == "matte":
        found.update({own + "type": "matte", own + "kd": base})
    elif of.kind == "coated":
        # Not the material "disney", which is a fifth darker.
        shine = of.specular * ((of.ior - 1) / (of.ior + 1)) ** 2
        found.update(
            {
                own + "type": "glossy2",
                own + "kd": base,
                own + "ks": text([shine] * 3),
                own + "multibounce": 0,
                own + "uroughness": alpha,
                own + "vroughness": alpha,
            }
        )
    elif of.kind == "glass":
        smooth = of.roughness == 0
        found.update(
            {
                own + "type": "glass" if smooth else "roughglass",
                own + "kr": "1 1 1",
                own + "kt": base,
                own + "interiorior": of.ior,
                own + "exteriorior": 1,
            }
        )
        if not smooth:
            found.update({own + "uroughness": alpha, own + "vroughness": alpha})
        if of.absorption.any():
            volume = f"scene.volumes.volume_{name}."
            found.update(
                {
                    volume + "type": "clear",
                    volume + "absorption": text(of.absorption),
                    volume + "ior": of.ior,
                    own + "volume.interior": f"volume_{name}",
                }
            )
    elif of.roughness == 0:
        found.update({own + "type": "mirror", own + "kr": base})
    else:
        fresnel = f"scene.textures.fresnel_{name}."
        found.update(
            {
                fresnel + "type": "fresnelcolor",
                fresnel + "kr": base,
                own + "type": "metal2",
                own + "fresnel": f"fresnel_{name}",
                own + "uroughness": alpha,
                own + "vroughness": alpha,
            }
        )
    if of.emission.any():
        most = of.emission.max()
        found.update(
            {
                own + "emission": text(of.emission / most),
                own + "emission.gain": text([most] * 3),
                own + "emission.power": 0,
                own + "emission.efficency": 0,
                own + "emission.theta": 90,
                own + "emission.gain.normalizebycolor": 0,
            }
        )
    return found


def approximations(scene):
    """Texts about features that LuxCore approximates."""
    kinds = {of.kind: of for _, of in scene.meshes}
    found = list(scene.approximations)
    if "metal" in kinds:
        found.append("the Fresnel term of metals is not Schlick's")
    return found


def build(scene, width, height, folder):
    """Build the LuxCore scene."""
    found = {f"scene.camera.{key}": value for key, value in camera(scene.camera, width, height).items()}
    if scene.environment is not None:
        rows, columns = (np.arange(n * UPSAMPLING) + 0.5 for n in scene.environment.shape[:2])
        file = os.path.join(folder, "environment.exr")
        pictures.write(file, pictures.sample(scene.environment, columns / len(columns), rows / len(rows)))
        own = "scene.lights.environment."
        found.update(
            {
                own + "type": "infinite",
                own + "file": file,
                own + "gamma": 1,
                own + "storage": "float",
                own + "gain": "1 1 1",
                own + "transformation": ENVIRONMENT,
            }
        )
    for number, light in enumerate(scene.lights):
        own, matrix = f"scene.lights.light{number}.", TURN @ light.to_world
        if light.kind == "point":
            found.update(
                {
                    own + "type": "sphere" if light.radius else "point",
                    own + "position": text(matrix[:3, 3]),
                    own + "radius": text(light.radius),
                    own + "color": "1 1 1",
                    own + "gain": text(4 * np.pi * light.intensity),
                    own + "power": 0,
                    own + "efficency": 0,
                }
            )
        else:
            found.update(
                {
                    own + "type": "sharpdistant",
                    own + "direction": text(-matrix[:3, 2]),
                    own + "color": text(light.intensity),
                    own + "gain": "1 1 1",
                }
            )
    made, names = lux.Scene(), {}
    for number, (mesh, of) in enumerate(scene.meshes):
        if id(of) not in names:
            names[id(of)] = f"material{len(names)}"
            found.update(material(of, names[id(of)], folder))
        rows = [
            None if values is None else [tuple(map(float, row)) for row in values]
            for values in (turned(mesh.positions), None if mesh.normals is None else turned(mesh.normals), mesh.uvs)
        ]
        triangles = [tuple(map(int, row)) for row in mesh.triangles]
        made.DefineMesh(f"mesh{number}", rows[0], triangles, rows[1], rows[2], None, None)
        found.update(
            {
                f"scene.objects.object{number}.shape": f"mesh{number}",
                f"scene.objects.object{number}.material": names[id(of)],
            }
        )
    made.Parse(properties(found))
    return made


def properties(values):
    """Convert a dictionary to LuxCore's properties."""
    made = lux.Properties()
    quoted = {key: f'"{value}"' if key.endswith(".file") else value for key, value in values.items()}
    made.SetFromString("".join(f"{key} = {value}\n" for key, value in quoted.items()))
    return made


def settings(scene, options):
    """LuxCore's properties of the render."""
    depth, mode = options.depth, options.mode
    found = {
        "renderengine.type": ENGINES[mode],
        "renderengine.seed": options.seed + 1,
        "native.threads.count": options.threads,
        "sampler.type": "RANDOM" if mode == "bidirvm" else "SOBOL",
        "sampler.random.bucketsize": 1,
        "film.width": options.width,
        "film.height": options.height,
        "film.filter.type": "NONE",
        "film.imagepipelines.0.0.type": "NOP",
        "film.outputs.0.type": "RGB",
        "film.outputs.0.filename": "unused.exr",
        "path.pathdepth.total": depth,
        "path.pathdepth.diffuse": depth,
        "path.pathdepth.glossy": depth,
        "path.pathdepth.specular": depth,
        "path.maxdepth": depth,
        "light.maxdepth": depth,
        "path.clamping.variance.maxvalue": 0,
        "path.russianroulette.depth": 10 if mode.startswith("bidir") else 5,
    }
    if mode == "path_cache":
        casters = [mesh.positions for mesh, of in scene.meshes if of.kind in ("glass", "metal")]
        points = np.concatenate(casters or [mesh.positions for mesh, _ in scene.meshes])
        size = float(np.linalg.norm(points.max(0) - points.min(0)))
        cache = "path.photongi."
        found.update(
            {
                cache + "caustic.enabled": 1,
                cache + "indirect.enabled": 0,
                cache + "photon.maxcount": 400000,
                cache + "photon.maxdepth": depth,
                cache + "caustic.maxsize": 100000,
                cache + "caustic.lookup.radius": 0.005 * size,
                cache + "caustic.lookup.normalangle": 10,
                cache + "caustic.updatespp": 24,
                cache + "caustic.updatespp.radiusreduction": 0.96,
                cache + "caustic.updatespp.minradius": 0.0005 * size,
            }
        )
    return found


def main():
    options = driver.options(list(ENGINES))
    # Camera paths cannot hit LuxCore's own lamps, so that path tracing would lose their caustics.
    lamps = "lamps" if options.mode == "path_cache" else "meshes"
    scene = plain_scene.Scene(options.scene, options.camera, lamps=lamps, suns="pixels")
    if scene.blockers:
        driver.print_answer(cannot=scene.blockers)
        return
    lux.Init(lambda message: None)
    with tempfile.TemporaryDirectory(prefix="caustique-luxcore-") as folder:
        built = build(scene, options.width, options.height, folder)
        watch = driver.Stopwatch(options)
        session = lux.RenderSession(lux.RenderConfig(properties(settings(scene, options)), built))
        session.Start()
        # Building the caustic cache counts as rendering and may use the whole budget: take at least one pass after it.
        samples = 0.0
        while watch.left() > 0 or samples < 1:
            time.sleep(0.01)
            session.UpdateStats()
            samples = session.GetStats().Get("stats.renderengine.pass").GetFloat()
        session.Stop()
        driver.report(watch, samples, lux.Version(), approximations(scene))
        picture = np.zeros(options.width * options.height * 3, np.float32)
        session.GetFilm().GetOutputFloat(lux.FilmOutputType.RGB, picture, 0)
        pictures.write(options.output, picture.reshape(options.height, options.width, 3)[::-1])
    # LuxCore sometimes crashes while the interpreter shuts down.
    os._exit(0)


main()
