"""A blurred shot beside Cycles: the error of delivered pictures of a moving caustic at equal core-seconds.

A glass ball flies through the light of a small lamp (lab/blur_shot.py), with a shutter of half a frame. Cycles renders
with motion blur and Open Image Denoise, by path tracing and with its shadow caustics; caustique renders the exported
file with its defaults. Both use one thread. The reference has two halves by `vcm`; `mean` is the mean of a picture over
the reference's. out/blur/peers.png shows the pictures.
"""

from ..cache import Failed, installed, run_timed
from ..combiner_page import page
from ..commands import command, read
from ..options import options
from ..picture_errors import Layers, Reference
from ..record import ROOT, record

ARGUMENTS = {"width": 240, "seconds": 20.0, "reference_seconds": 200.0}
OUT = ROOT / "out" / "blur"
KEYS = ("relmse", "relmse_trimmed", "flip", "mean_ratio")
MODES = {"Cycles": "path", "Cycles, shadow caustics": "path_caustics"}


def blender(*words):
    """Runs lab/blur_shot.py in Blender; returns what it prints."""
    return run_timed([installed(".venv-bpy"), "-m", "lab.blur_shot", *words], 3600)[0]


def cycles(mode):
    """The picture by Cycles after about `--seconds` core-seconds, and these."""
    file, samples = OUT / f"{mode}.exr", 16
    for _ in range(3):
        printed = blender("cycles", file, options.width, samples, "denoised", mode)
        spent = float(printed.rpartition("core-seconds")[2])
        if spent > 0.8 * options.seconds:
            break
        samples = max(samples + 1, round(samples * options.seconds / spent))
    return Layers(file).get(""), spent


def ours(scene, file, seconds, **more):
    """A render of about some core-seconds: a short one measures those of an iteration."""
    line = command("render", scene, "-o", file, frames=1, width=options.width, threads=1, progress="none", **more)
    _, _, spent = run_timed([*line, "--time", f"{0.1 * seconds:.2f}"])
    count = read("info", file)["history"][-1]["iterations"]
    for _ in range(3):
        count = max(count + 1, round(count * seconds / spent))
        _, _, spent = run_timed([*line, "--iterations", str(count)])
        if 0.8 * seconds < spent < 1.2 * seconds:
            break
    return Layers(file).get(""), spent


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    scene = OUT / "shot.glb"
    blender("export", scene)
    exact = {"method": "vcm", "levels": 1, "no_finish": True, "layers": "beauty"}
    halves = [ours(scene, OUT / f"half{k}.exr", options.reference_seconds / 2, seed=70 + k, **exact)[0] for k in (1, 2)]
    reference = Reference(*halves)
    made = {"caustique": ours(scene, OUT / "caustique.exr", options.seconds, seed=1)}
    for name, mode in MODES.items():
        try:
            made[name] = cycles(mode)
        except Failed as failed:
            print(f"{name}: {failed}")
    rows = {}
    print(f"{'':<26}{'core-s':>8}{'relMSE':>10}{'trimmed':>10}{'FLIP':>8}{'mean':>8}")
    for name, (picture, spent) in made.items():
        errors = reference.measure(picture)
        rows[name] = {"core_seconds": spent, **{key: errors[key] for key in KEYS}}
        print(f"{name:<26}{spent:>8.1f}" + "".join(f"{errors[key]:>10.4g}" for key in KEYS), flush=True)
    page(OUT / "peers.png", {name: picture for name, (picture, _) in made.items()}, {}, reference.mean)
    print(f"reference's own relMSE {reference.error:.2g}; {OUT / 'peers.png'}")
    record("blur_peers", {"width": options.width, "seconds": options.seconds, "noise": reference.error, "rows": rows})
