"""Path tracing beside Mitsuba and Cycles: our squared error times core-seconds over theirs, on one thread.

The cost of a renderer is the squared error (trimmed relMSE) of its estimates, without a finish, times its core-seconds.
It is constant if the squared error falls as one over time. The renderers render alternately, ours with the number of
iterations that takes --seconds. Reading and converting the scene are not counted for any renderer. A short render runs
first, so that Mitsuba finds its compiled kernels on the disk. A scene counts if both means agree with the reference's
within noise. Stores the figure `speed-peers`. `scripts/compare/setup.sh peers` installs the other renderers.
"""

import sys
from functools import partial

from .. import peer_runs, references
from ..accuracy import geometric, short
from ..cache import BIN, CACHE, Failed, create, digest, load, program, run_timed, save, scene_key
from ..commands import command, read
from ..options import options
from ..picture_errors import Layers, Reference
from ..record import record

# Small pictures, one thread.
ARGUMENTS = references.ARGUMENTS | {
    "set": "all",
    "width": 96,
    "threads": 1,
    "reference_seconds": 30.0,
    "seconds": 6.0,
    "seeds": 2,
    "peers": ["mitsuba_path", "cycles_path"],
}
PLACE = CACHE / "speed"
WARM_UP = 0.5  # seconds of a peer's first render
# The share of --seconds that a trial takes, which measures the time of an iteration.
TRIAL_SHARE = 0.25
MIN_TRIAL_ITERATIONS = 4
# Smaller squared errors count as this.
MIN_SQUARED_ERROR = 1e-9


def history(scene, stop, seed, file):
    """Renders by path tracing until a stop such as ("--time", 4); returns the history."""
    settings = {"seed": seed, "width": options.width, "threads": options.threads, "progress": "none"}
    words = ["render", scene, "-o", file, "--method", "path", "--no-finish", *stop]
    run_timed(command(*words, **settings), 600 + 50 * options.seconds)
    return read("info", file)["history"]


def folder_of(scene):
    """The folder of our renders of a scene."""
    return PLACE / digest(BIN) / scene_key(scene) / f"path-{options.seconds:g}s-{options.width}"


def iterations(scene):
    """The number of iterations that takes --seconds, from a trial that measures the start and an iteration. If the
    start takes longer than the trial, a second trial has MIN_TRIAL_ITERATIONS."""
    folder = folder_of(scene) / "trial"
    if not (folder / "run.json").exists():
        with create(folder) as draft:
            file = draft / "picture.exr"
            found = history(scene, ["--time", TRIAL_SHARE * options.seconds], 0, file)
            if found[-1]["iterations"] < MIN_TRIAL_ITERATIONS:
                found = history(scene, ["--iterations", MIN_TRIAL_ITERATIONS], 0, file)
            save(draft / "run.json", found)
    found = load(folder / "run.json")
    first, last = found[0], found[-1]
    each = (last["cpu_seconds"] - first["cpu_seconds"]) / (last["iterations"] - first["iterations"])
    fixed = max(first["cpu_seconds"] - first["iterations"] * each, 0)
    return max(1, round((options.seconds - fixed) / each))


def picture(folder):
    """The picture of a render's folder, and its core-seconds."""
    return Layers(folder / "picture.exr").get(""), load(folder / "run.json")["cpu_seconds"]


def render(scene, seed):
    """Renders with a seed, unless the cache has the render; returns the picture and its core-seconds."""
    folder = folder_of(scene) / f"seed{seed}"
    if not (folder / "run.json").exists():
        with create(folder) as draft:
            stop = ["--iterations", iterations(scene)]
            save(draft / "run.json", history(scene, stop, seed, draft / "picture.exr")[-1])
    return picture(folder)


def merit(pairs, reference):
    """The cost of renders, given as pairs of picture and core-seconds, and their mean over the reference's."""
    found = [reference.measure(made) for made, _ in pairs]

    def mean(key):
        return sum(figures[key] for figures in found) / len(found)

    error, spent = max(mean("relmse_trimmed"), MIN_SQUARED_ERROR), sum(seconds for _, seconds in pairs) / len(pairs)
    return {
        "merit": error * spent,
        "error": error,
        "core_seconds": spent,
        "mean_ratio": mean("mean_ratio"),
        "mean_ratio_error": mean("mean_ratio_error") / len(found) ** 0.5,
    }


def measure_alternately(renders, reference):
    """Costs by name. `renders` has a function of the seed for each name; the functions are called alternately."""
    found = {name: [] for name in renders}
    for seed in range(1, options.seeds + 1):
        for name, make in renders.items():
            found[name].append(make(seed))
    return {name: merit(pairs, reference) for name, pairs in found.items()}


def with_references():
    """The selected scenes that have a reference, each with its name and reference; prints why others have none."""
    for scene in references.scenes():
        try:
            yield scene, references.name(scene), Reference.read(references.reference(scene)[0])
        except Failed as failed:
            print(f"{references.name(scene)}: no reference: {failed}", flush=True)


def summary(ratios):
    """The geometric mean of ratios by name, the largest ratio with its name, and the number of ratios."""
    if not ratios:
        return None
    worst = max(ratios, key=ratios.get)
    mean = geometric(list(ratios.values()))
    return {"geometric_mean": short(mean), "worst": short(ratios[worst]), "where": worst, "of": len(ratios)}


def compare(scene, name, peer, reference):
    """The row of a scene and a peer, with the ratio of the costs, and why the row does not count, if one of the means is
    not the reference's. Raises Failed if the peer cannot render the scene."""
    peers = peer_runs.Peers(scene, reference.mean.shape[0])
    warm = peers.render(peer, WARM_UP, 0)
    theirs = lambda seed: picture(peers.render(peer, options.seconds, seed))
    found = measure_alternately({"ours": partial(render, scene), "theirs": theirs}, reference)
    reasons = {of: peer_runs.mean_mismatch(figures) for of, figures in found.items()}
    return {
        "scene": name,
        "peer": peer,
        **{of: {key: short(value) for key, value in figures.items()} for of, figures in found.items()},
        "ratio": short(found["ours"]["merit"] / found["theirs"]["merit"]),
        "strange": next(({"of": of, "why": why} for of, why in reasons.items() if why), None),
        "version": load(warm / "run.json").get("version"),
    }


def main():
    names, reason = peer_runs.select()
    if reason:
        sys.exit(f"speed_peers: error: {reason}")
    rows = []
    for scene, name, reference in with_references():
        for peer in names:
            try:
                row = compare(scene, name, peer, reference)
            except Failed as failed:
                print(f"{name:<20}{peer:<14}{failed}", flush=True)
                continue
            rows.append(row)
            note = f"{row['strange']['of']} {row['strange']['why']}" if row["strange"] else ""
            print(f"{name:<20}{peer:<14}{row['ratio']:>8.2f}  {note}", flush=True)
    found = {}
    for peer in names:
        ratios = {row["scene"]: row["ratio"] for row in rows if row["peer"] == peer and not row["strange"]}
        found[peer] = summary(ratios)
        print(peer, found[peer])
    settings = {key: getattr(options, key) for key in ("width", "threads", "seconds", "seeds")}
    record("speed-peers", {**settings, "program": program(), "summary": found, "rows": rows})
