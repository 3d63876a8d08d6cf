"""Mitsuba 3 as a peer (see driver.py): path tracing, its scene as world.py says it.

The vectorised variant where there is an LLVM that it takes, thrice as fast as the scalar one.
"""

import mitsuba as mi
import numpy as np

import driver
import pictures

import gltf  # isort: skip
import variant  # isort: skip

#: Samples that a pass takes at most: what a wave of them needs of memory stays below a gibibyte.
WAVE = 1 << 22
#: A pass grows until it takes this share of the budget.
SHARE = 1 / 16
ROUGH = "rough surfaces lose the light that their facets scatter more than once"


def main():
    options = driver.options(["path"])
    name = variant.choose(options.threads)
    import world
    try:
        scene = gltf.read(options.scene)
        if options.camera:
            scene.cameras = [camera for camera in scene.cameras if camera.name == options.camera]
        built = world.build(scene, options.width, options.height)
    except gltf.Unsupported as unsupported:
        driver.say(cannot=[str(unsupported)])
        return
    watch = driver.Stopwatch(options)
    total, each = np.zeros((options.height, options.width, 3)), 1
    most = max(1, WAVE // (options.width * options.height))

    def render(number):
        nonlocal each, total
        before, samples = watch.spent(), each
        picture = np.array(mi.render(built, spp=samples, seed=options.seed * 65536 + number))
        total += samples * picture[..., :3]
        # The first one compiles.
        if number and watch.spent() - before < SHARE / 2 * options.budget:
            each = min(2 * each, most)
        return samples

    samples = driver.passes(watch, render)
    rough = any(0.03 < material.get("pbrMetallicRoughness", {}).get("roughnessFactor", 1.0) for material in shiny(scene))
    driver.done(watch, samples, f"{mi.__version__} ({name})", [ROUGH] if rough else [])
    pictures.write(options.output, total / samples)


def shiny(scene):
    """The materials with an interface."""
    for material in scene.document.get("materials", []):
        metallic = material.get("pbrMetallicRoughness", {}).get("metallicFactor", 1.0)
        glass = (gltf.extension(material, "KHR_materials_transmission") or {}).get("transmissionFactor", 0.0)
        specular = (gltf.extension(material, "KHR_materials_specular") or {}).get("specularFactor", 1.0)
        if metallic or glass or specular:
            yield material


main()
