"""Our renders at a budget of time, and their pictures."""

import functools
import os
import subprocess

from .cache import (
    BIN,
    CACHE,
    Failed,
    create,
    digest,
    frame_suffix,
    installed,
    load,
    program,
    run_timed,
    save,
    scene_key,
)
from .commands import command, read
from .options import options
from .picture_errors import Layers, write
from .record import ROOT

# The interpreter that has OIDN (scripts/compare/setup.sh peers).
PYTHON = installed(".venv-peers")
# Iterations of the render that finds the pixels with glass and mirrors.
INSIDE_ITERATIONS = 4
# With --clock cpu, a render is repeated until its core-seconds are within this share of the budget, up to MAX_TRIES times.
BUDGET_TOLERANCE, MAX_TRIES = 0.05, 4


@functools.cache
def has_option(option):
    """Whether the program's command `render` has an option."""
    done = subprocess.run([BIN, "render", "--help"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return f"{option} " in done.stdout


def render(scene, method, denoise, budget, seed, binary=BIN, frame=None, model=None):
    """Renders a scene, or a frame of it, by a program, with the file of a network or without, unless the cache has the
    render; returns the folder. Raises Failed if the program refuses the render, which the cache also stores."""
    name = f"{method}-{denoise or 'default'}-{budget:g}s-{options.clock}-{options.threads}-seed{seed}-{options.width}"
    if options.render_options:
        name += "".join(c if c.isalnum() else "_" for c in " ".join(options.render_options))
    if model:
        name += f"-{digest(model)}"
    folder = CACHE / "renders" / program(binary) / scene_key(scene) / f"{name}{frame_suffix(frame)}"
    known = load(folder / "run.json")
    if known is None:
        with create(folder) as draft:
            known = _render(scene, method, denoise, budget, seed, draft / "picture.exr", binary, frame, model)
            save(draft / "run.json", known)
    if "refused" in known:
        raise Failed(known["refused"])
    return folder


def _render(scene, method, denoise, budget, seed, file, binary, frame, model):
    if denoise and not has_option("--denoise"):
        return {"refused": "not available: this program has no --denoise"}
    settings = {"method": method, "seed": seed, "width": options.width, "threads": options.threads, "frames": frame}
    line = command("render", scene, "-o", file, **settings, progress="none", denoise=denoise or None, program=binary)
    line += options.render_options + (["--model", str(model)] if model else [])
    seconds, stop = budget, ["--time", f"{budget:.3f}"]
    for _ in range(MAX_TRIES if options.clock == "cpu" else 1):
        try:
            _, wall, spent = run_timed([*line, *stop], 600 + 20 * budget)
        except Failed as failed:
            if "photons in media" not in str(failed):
                raise
            return {"refused": f"not available: {failed}"}
        header = read("info", file)
        last = header["history"][-1]
        factor = budget * options.threads / max(last["cpu_seconds"], 1e-3)
        if abs(1 / factor - 1) < BUDGET_TOLERANCE:
            break
        # The choice of auto depends on --time; other methods repeat with a corrected number of iterations.
        if method == "auto":
            seconds *= min(max(factor, 0.5), 4)
            stop = ["--time", f"{seconds:.3f}"]
        else:
            iterations = max(round(last["iterations"] * factor), 1)
            if iterations == last["iterations"]:
                break
            stop = ["--iterations", iterations]
    known = {key: last[key] for key in ("seconds", "cpu_seconds", "iterations")}
    return {
        **known,
        "process_seconds": round(wall, 2),
        "process_core_seconds": round(spent, 2),
        "chosen": header.get("plan", {}).get("because"),
    }


def inside(scene):
    """Which pixels of a scene show smooth glass or a mirror, by a short render that the cache keeps."""
    folder = CACHE / "inside" / scene_key(scene) / str(options.width)
    if not (folder / "inside.exr").exists():
        with create(folder) as draft:
            words = ["render", scene, "-o", draft / "inside.exr"]
            settings = {"method": "path", "no_finish": True, "iterations": INSIDE_ITERATIONS, "width": options.width}
            run_timed(command(*words, **settings, layers="beauty,CryptoMaterial", progress="none"))
    return Layers(folder / "inside.exr").smooth()


def denoise_file(folder, source, target):
    """Denoises a file of a folder by OIDN alone, unless the target exists; returns whether the target exists."""
    if not (folder / target).exists() and PYTHON:
        tool = ROOT / "scripts" / "compare" / "peers" / "oidn.py"
        part = folder / f"{os.getpid()}-{target}"
        run_timed([PYTHON, tool, folder / source, part, options.threads])
        part.rename(folder / target)
    return (folder / target).exists()


def pictures(folder):
    """The pictures of a render by name: delivered (finished), noisy (the estimate), level1 to level5, and oidn (noisy
    denoised by OIDN alone)."""
    layers = Layers(folder / "picture.exr")
    found = {"delivered": layers.get(""), "noisy": layers.get("Noisy")}
    found.update({f"level{i}": layers.get(f"Level{i}") for i in range(1, 6)})
    found = {name: picture for name, picture in found.items() if picture is not None}
    guides = {"albedo": layers.get("albedo"), "normal": layers.get("normal", "XYZ")}
    if PYTHON and "noisy" in found and all(guide is not None for guide in guides.values()):
        if not (folder / "oidn.exr").exists():
            write(folder / "noisy.exr", picture=found["noisy"], **guides)
        if denoise_file(folder, "noisy.exr", "oidn.exr"):
            found["oidn"] = Layers(folder / "oidn.exr").get("")
            (folder / "noisy.exr").unlink(missing_ok=True)
    return found


def figures(folder, reference, halves, pictures_of):
    """The errors of a folder's pictures against a reference, from the cache if possible. `pictures_of(folder)` returns
    the pictures."""
    file = folder / f"errors-{digest(halves / 'half1.exr', halves / 'half2.exr')}.json"
    known = load(file) or {}
    if "oidn" not in known and PYTHON or not known:
        for name, picture in pictures_of(folder).items():
            if name not in known:
                known[name] = reference.measure(picture)
        save(file, known)
    return known
