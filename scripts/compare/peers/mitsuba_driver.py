"""Mitsuba 3 as a peer (see driver.py): path tracing, its scene as mitsuba_world.py says it.

Its rough surfaces get what they lack of ours (mitsuba_lobes.py), so that materials mean the same. The vectorised variant where
there is an LLVM that it takes, thrice as fast as the scalar one.
"""

import mitsuba as mi
import numpy as np

import driver
import pictures

import gltf
import variant

#: Samples that a pass takes at most: what a wave of them needs of memory stays below a gibibyte.
WAVE = 1 << 22
#: A pass grows until it takes this share of the budget.
SHARE = 1 / 16


def main():
    options = driver.options(["path"])
    name = variant.choose(options.threads)
    # Its classes are made of the variant's.
    import mitsuba_world

    try:
        scene = gltf.read(options.scene)
        if options.camera:
            scene.cameras = [camera for camera in scene.cameras if camera.name == options.camera]
        built = mitsuba_world.build(scene, options.width, options.height, correct=True)
    except gltf.Unsupported as unsupported:
        driver.print_answer(cannot=[str(unsupported)])
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

    samples = driver.run_passes(watch, render)
    driver.report(watch, samples, f"{mi.__version__} ({name})", [])
    pictures.write(options.output, total / samples)


main()
