"""Renders with Mitsuba 3's path tracer (see driver.py), with the scene from mitsuba_world.py.

Rough surfaces are corrected to caustique's model (mitsuba_lobes.py), so that materials are equal. The vectorised
variant, used if a suitable LLVM exists, is three times as fast as the scalar one.
"""

import mitsuba as mi
import numpy as np

import driver
import pictures

import gltf
import variant

#: Largest number of samples in a pass, which then needs less than 1 GiB.
MAX_PASS_SAMPLES = 1 << 22
#: Passes grow until they take this share of the budget.
PASS_SHARE = 1 / 16


def main():
    options = driver.options(["path"])
    name = variant.choose(options.threads)
    # Import after the variant is set, because its classes derive from the variant's.
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
    most = max(1, MAX_PASS_SAMPLES // (options.width * options.height))

    def render(number):
        nonlocal each, total
        before, samples = watch.spent(), each
        picture = np.array(mi.render(built, spp=samples, seed=options.seed * 65536 + number))
        total += samples * picture[..., :3]
        # Ignore the first pass, which compiles kernels.
        if number and watch.spent() - before < PASS_SHARE / 2 * options.budget:
            each = min(2 * each, most)
        return samples

    samples = driver.run_passes(watch, render)
    driver.report(watch, samples, f"{mi.__version__} ({name})", [])
    pictures.write(options.output, total / samples)


main()
