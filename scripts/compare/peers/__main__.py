"""Renders one glTF file with caustique and with Mitsuba 3, and prints how far the pictures differ.

    scripts/compare/mitsuba.py SCENE.glb [--seeds 8] [--spp 256] [--method path] [--png DIFFERENCE.png] [--json]
    scripts/compare/mitsuba.py export SCENE.glb -o SCENE.xml [--strict]
    scripts/compare/mitsuba.py import SCENE.xml -o SCENE.glb [-D NAME=VALUE ...]

`export` writes a Mitsuba scene (to_xml.py), `import` reads one (from_xml.py).

Prints the ratio of the means (caustique over Mitsuba) with its standard error, relMSE, and statistics over tiles of
16x16 pixels. Standard errors come from the spread over independent seeds of both renderers. Features that Mitsuba lacks
are errors. `--correct` adds the parts of caustique's rough lobes that Mitsuba lacks (mitsuba_lobes.py). CAUSTIQUE_BIN
is the program to compare.

The PNG shows caustique and Mitsuba above, and the relative difference by pixel and by tile below: red where caustique
is brighter, blue where it is darker, full colour at 10 %. Runs in .venv-compare (../mitsuba.py).
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import gltf
import mitsuba as mi
import numpy as np
import tiles
import variant
from pictures import read

ROOT = Path(__file__).resolve().parents[3]

#: Largest number of samples in one wavefront of Mitsuba, which then needs less than 1 GiB.
MAX_WAVE_SAMPLES = 1 << 22


def render_mitsuba(world, size, spp, seeds):
    """Render with Mitsuba, once per seed: (seeds, height, width, 3)."""
    each = max(1, min(spp, MAX_WAVE_SAMPLES // (size[0] * size[1])))
    pictures = []
    for seed in seeds:
        total, done = 0.0, 0
        while done < spp:
            n = min(each, spp - done)
            picture = np.array(mi.render(world, spp=n, seed=seed * 65536 + done), dtype=np.float64)
            total, done = total + n * picture[..., :3], done + n
        pictures.append(total / done)
    return np.array(pictures)


def render_caustique(arguments, seeds):
    """Render with caustique, once per seed: (seeds, height, width, 3)."""
    program = os.environ.get("CAUSTIQUE_BIN", str(ROOT / "target" / "release" / "caustique"))
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            file = os.path.join(folder, "picture.exr")
            command = [
                program,
                "render",
                arguments.scene,
                "-o",
                file,
                "--method",
                arguments.method,
                "--seed",
                str(seed),
                "--iterations",
                str(arguments.iterations),
                "--width",
                str(arguments.width),
                "--height",
                str(arguments.height),
                "--threads",
                str(arguments.threads),
                "--layers",
                "beauty",
                "--no-combine",
                "--progress",
                "none",
                "--glass",
                arguments.glass,
                *arguments.option,
            ]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode != 0:
                sys.exit(f"{' '.join(command)}\n{done.stderr}")
            pictures.append(read(file).astype(np.float64))
        if done.stderr:
            print(done.stderr, end="", file=sys.stderr)
    return np.array(pictures)


class Warnings:
    """Prints a warning on stderr for each approximated or omitted feature, once."""

    def __init__(self, scene):
        self.scene, self.said = scene, set()

    def __call__(self, what):
        if what not in self.said:
            self.said.add(what)
            print(f"warning: {self.scene}: {what}", file=sys.stderr)


def exchange(command, words):
    """Run the commands `export` and `import`."""
    parser = argparse.ArgumentParser(prog=f"mitsuba.py {command}")
    parser.add_argument("scene", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    if command == "export":
        parser.add_argument(
            "--strict", action="store_true", help="fail if a feature is approximated or left out"
        )
    else:
        parser.add_argument(
            "-D", "--define", action="append", default=[], metavar="NAME=VALUE", help="a parameter of the scene"
        )
    arguments = parser.parse_args(words)
    defined = dict(word.partition("=")[::2] for word in getattr(arguments, "define", []))
    mi.set_variant("scalar_rgb")
    import from_xml
    import to_xml

    try:
        if command == "export":
            lose = gltf.refuse if arguments.strict else Warnings(arguments.scene)
            to_xml.write(arguments.scene, arguments.output, lose)
        else:
            from_xml.convert(arguments.scene, arguments.output, defined)
    except (gltf.Unsupported, OSError) as error:
        sys.exit(f"{arguments.scene}: {error}")


def main():
    """Run the command line."""
    if sys.argv[1:2] in (["export"], ["import"]):
        exchange(sys.argv[1], sys.argv[2:])
        return
    parser = argparse.ArgumentParser(
        prog="mitsuba.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene")
    parser.add_argument("--width", type=int, default=256)
    parser.add_argument("--height", type=int, help="default: from the camera's aspect ratio")
    parser.add_argument("--seeds", type=int, default=8, help="independent renders on each side")
    parser.add_argument("--spp", type=int, default=128, help="Mitsuba's samples per pixel and seed")
    parser.add_argument("--iterations", type=int, help="caustique's, per seed; default: --spp")
    parser.add_argument("--method", default="path", help="caustique's method")
    parser.add_argument("--glass", default="auto", choices=("auto", "solid", "thin"))
    parser.add_argument("--option", action="append", default=[], help="an additional argument for caustique")
    parser.add_argument(
        "--correct", action="store_true", help="give Mitsuba correlated masking and multiple scattering"
    )
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--png", type=Path, help="difference picture")
    parser.add_argument("--save", type=Path, help="save all pictures as .npz")
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of the table")
    parser.add_argument("--check", action="store_true", help="exit with code 1 if the renderers disagree")
    arguments = parser.parse_args()
    arguments.iterations = arguments.iterations or arguments.spp

    name = variant.choose(arguments.threads)
    # Import after the variant is set, because its classes derive from the variant's.
    import mitsuba_world

    try:
        scene = gltf.read(arguments.scene)
        if arguments.height is None and scene.cameras:
            arguments.height = max(1, round(arguments.width / scene.cameras[0].aspect))
        peer = mitsuba_world.build(scene, arguments.width, arguments.height, arguments.correct, arguments.glass)
    except gltf.Unsupported as unsupported:
        sys.exit(f"{arguments.scene}: not comparable: {unsupported}")
    size, seeds = (arguments.width, arguments.height), range(1, arguments.seeds + 1)
    start = time.monotonic()
    theirs = render_mitsuba(peer, size, arguments.spp, seeds)
    middle = time.monotonic()
    ours = render_caustique(arguments, seeds)
    end = time.monotonic()

    values = tiles.compare(ours, theirs)
    values.update(
        scene=Path(arguments.scene).stem,
        method=arguments.method,
        corrected=arguments.correct,
        seeds=arguments.seeds,
        spp=arguments.spp,
        iterations=arguments.iterations,
        width=size[0],
        height=size[1],
        mitsuba=mi.__version__,
        variant=name,
        seconds_mitsuba=round(middle - start, 1),
        seconds_caustique=round(end - middle, 1),
    )
    if arguments.png:
        tiles.picture(ours, theirs, arguments.png)
    if arguments.save:
        np.savez_compressed(arguments.save, ours=ours, theirs=theirs)
    if arguments.json:
        print(json.dumps(values))
    else:
        print(tiles.table(values))
    if arguments.check and not values["agrees"]:
        sys.exit(1)


if __name__ == "__main__":
    main()
