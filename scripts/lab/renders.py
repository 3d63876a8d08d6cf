"""Our own renders at a budget, and the pictures that each of them holds."""

import functools
import os
import subprocess

from .cache import BIN, CACHE, Failed, digest, installed, load, making, program, save, scene_key, timed
from .options import options
from .reading import read
from .picture_errors import Layers, write
from .record import ROOT

# The interpreter that has OIDN (scripts/compare/setup.sh peers).
PYTHON = installed(".venv-peers")
PLACE = CACHE / "renders" / program()
# On the clock of core-seconds: a render that has spent so much more or less than the budget is made again, a few times.
NEAR, TIMES = 0.05, 4


@functools.cache
def knows(option):
    """Whether the program has an option of `render`."""
    done = subprocess.run([BIN, "render", "--help"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return f"{option} " in done.stdout


def render(scene, method, denoise, budget, seed):
    """Renders, unless that is done; returns the folder. What is refused raises Failed, and is not asked for again."""
    name = f"{method}-{denoise or 'default'}-{budget:g}s-{options.clock}-{options.threads}-seed{seed}-{options.width}"
    if options.render_options:
        name += "".join(c if c.isalnum() else "_" for c in " ".join(options.render_options))
    folder = PLACE / scene_key(scene) / name
    known = load(folder / "run.json")
    if known is None:
        with making(folder) as draft:
            known = _render(scene, method, denoise, budget, seed, draft / "picture.exr")
            save(draft / "run.json", known)
    if "refused" in known:
        raise Failed(known["refused"])
    return folder


def _render(scene, method, denoise, budget, seed, file):
    if denoise and not knows("--denoise"):
        return {"refused": "not available: this program has no --denoise"}
    command = [
        BIN,
        "render",
        scene,
        "-o",
        file,
        "--method",
        method,
        "--seed",
        seed,
        "--width",
        options.width,
        "--threads",
        options.threads,
    ]
    command += ["--progress", "none", *(["--denoise", denoise] if denoise else []), *options.render_options]
    seconds, stop = budget, ["--time", f"{budget:.3f}"]
    for _ in range(TIMES if options.clock == "cpu" else 1):
        try:
            _, wall, spent = timed([*command, *stop], 600 + 20 * budget)
        except Failed as failed:
            if "photons in media" not in str(failed):
                raise
            return {"refused": f"not available: {failed}"}
        said = read("info", str(file))
        last = said["history"][-1]
        longer = budget * options.threads / max(last["cpu_seconds"], 1e-3)
        if abs(1 / longer - 1) < NEAR:
            break
        # auto chooses by the seconds it is given; the others take as many core-seconds for an iteration as before.
        if method == "auto":
            seconds *= min(max(longer, 0.5), 4)
            stop = ["--time", f"{seconds:.3f}"]
        else:
            wanted = max(round(last["iterations"] * longer), 1)
            if wanted == last["iterations"]:
                break
            stop = ["--iterations", wanted]
    known = {key: last[key] for key in ("seconds", "cpu_seconds", "iterations")}
    return {
        **known,
        "process_seconds": round(wall, 2),
        "process_core_seconds": round(spent, 2),
        "chosen": said.get("plan", {}).get("because"),
    }


def denoised(folder, source, target):
    """OIDN alone on a file in a folder, once; whether there is a picture then."""
    if not (folder / target).exists() and PYTHON:
        tool = ROOT / "scripts" / "compare" / "peers" / "oidn.py"
        part = folder / f"{os.getpid()}-{target}"
        timed([PYTHON, tool, folder / source, part, options.threads])
        part.rename(folder / target)
    return (folder / target).exists()


def pictures(folder):
    """The pictures of a render: delivered, noisy, level1 to level5, and oidn, which is OIDN alone on noisy."""
    layers = Layers(folder / "picture.exr")
    found = {"delivered": layers.get(""), "noisy": layers.get("Noisy")}
    found.update({f"level{i}": layers.get(f"Level{i}") for i in range(1, 6)})
    found = {name: picture for name, picture in found.items() if picture is not None}
    guides = {"albedo": layers.get("albedo"), "normal": layers.get("normal", "XYZ")}
    if PYTHON and "noisy" in found and all(guide is not None for guide in guides.values()):
        if not (folder / "oidn.exr").exists():
            write(folder / "noisy.exr", picture=found["noisy"], **guides)
        if denoised(folder, "noisy.exr", "oidn.exr"):
            found["oidn"] = Layers(folder / "oidn.exr").get("")
            (folder / "noisy.exr").unlink(missing_ok=True)
    return found


def figures(folder, reference, halves, shown):
    """The figures of a folder's pictures, measured once against a reference. `shown`: what gives the pictures."""
    file = folder / f"figures-{digest(halves / 'half1.exr', halves / 'half2.exr')}.json"
    known = load(file) or {}
    if "oidn" not in known and PYTHON or not known:
        for name, picture in shown(folder).items():
            if name not in known:
                known[name] = reference.measure(picture)
        save(file, known)
    return known
