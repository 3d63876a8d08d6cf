"""Guided light paths against unguided ones at equal time, by relMSE of all pixels and without the worst 0.5 %: sppm whose
photons bring only caustics, sppm and cppm whose photons bring all light, and vcm.

On scenes whose caustics only guided light paths find, separate renders also measure the layer Caustic, without the noise
of other light. Arguments and references are those of auto.py; --methods selects among the pairs. Each scene is stored as
a figure, with the pairs as its set.
"""

import subprocess

from . import auto
from ..commands import command, read
from ..options import options as given
from ..record import record

# Scenes with scattering media, which photons of caustics alone do not support.
SCATTERING = ["fog", "godrays"]
# More cameras, whose pictures show mostly light that only guided light paths find.
CLOSE = {"stadium": ["Close up"]}
PLAIN = {
    "sppm": auto.fixed("sppm") + " --indirect paths",
    "all": auto.fixed("sppm"),
    "cppm": auto.fixed("cppm"),
    "vcm": auto.fixed("vcm"),
}
GUIDES = {"": "", " guided": " --guide on"}
ARGUMENTS = auto.ARGUMENTS | {"methods": list(PLAIN)}


def runs_of(plain):
    """The options of runs by name: each of the given methods without and with a guide."""
    return {name + suffix: PLAIN[name] + option for name in plain for suffix, option in GUIDES.items()}


def caustics(scene):
    """relMSE of the layer Caustic by run after --seconds, and the reference's own, from two references. The run "all paths"
    has an unguided run's number of light paths, but guided."""

    def render(name, options, seconds, seed):
        path = auto.OUT / f"{scene}-{given.width}-{name.replace(' ', '-')}-{seconds:g}s-{seed}.exr"
        if not path.exists():
            words = ["render", auto.ROOT / "scenes" / f"{scene}.glb", "-o", path, *options.split()]
            line = command(*words, width=given.width, time=seconds, seed=seed, progress="none")
            subprocess.run(line, check=True, stderr=subprocess.DEVNULL)
        return path

    def error(of, to):
        return read("compare", of, to, "--layer", "Caustic")["relmse"]

    reference, other = (
        render("caustics", auto.fixed("vcm") + " --guide on", given.reference_seconds, seed) for seed in (77, 78)
    )
    own = error(other, reference) / 2
    runs = runs_of(given.methods)
    if "sppm" in runs:
        runs["sppm guided, all paths"] = runs["sppm guided"] + " --photons 100000"
    found = {name: [] for name in runs}
    for seed in (1, 2, 3):
        for name, options in runs.items():
            found[name].append(error(render(f"caustics {name}", options, given.seconds, seed), reference) - own)
    return {"errors": found, "reference": own}


def cells(figures, columns, form):
    """A cell for every column, with a number in the format `form`, or a dash where there is no figure."""
    width = form[: form.index(".")]
    return "".join(f"{figures[name]:{form}}" if name in figures else f"{'-':{width}}" for name in columns)


def main():
    pairs, columns = given.methods, runs_of(given.methods)
    print(
        f"{'scene':<18}{'':<16}"
        + "".join(f"{name:>13}" for name in columns)
        + "".join(f"{name + ' gains':>12}" for name in pairs)
        + "  mean ratios, guided"
    )
    views = [(scene, camera) for scene in given.scenes for camera in (None, *CLOSE.get(scene, []))]
    for scene, camera in views:
        plain = [name for name in pairs if not (name == "sppm" and scene in SCATTERING)]
        if not plain:
            continue
        wanted = {name: options for name, options in columns.items() if name.removesuffix(" guided") in plain}
        data, _ = auto.measure(scene, wanted, camera)
        runs = {name: [p for p in data["points"] if p["run"] == name] for name in wanted}
        seconds = min(points[-1]["cpu_seconds"] for points in runs.values())
        means = {name: points[-1]["mean_ratio"] for name, points in runs.items()}
        name = f"{scene}, {camera.lower()}" if camera else scene
        row = {"scene": name, "core_seconds": seconds, "mean_ratio": means}
        for figure in ("relmse", "relmse_trimmed"):
            own = data["reference"]["error"].get(figure) or 0.0
            for point in data["points"]:
                point[figure] -= own
            errors = {name: auto.at(points, figure, seconds) for name, points in runs.items()}
            row[figure] = errors
            gains = {run: errors[run] / errors[f"{run} guided"] for run in plain}
            line = f"{name:<18}{figure:<16}" + cells(errors, columns, ">13.2g") + cells(gains, pairs, ">12.2f")
            print(line + "  " + " ".join(f"{means[run + ' guided']:.4f}" for run in plain), flush=True)
        if scene in auto.GUIDED and not camera:
            row["caustics"] = caustics(scene)
            errors = row["caustics"]["errors"]
            mean = {name: sum(each) / len(each) for name, each in errors.items()}
            gains = {name: mean[name] / mean[f"{name} guided"] for name in pairs}
            line = f"{name:<18}{'layer Caustic':<16}" + cells(mean, columns, ">13.2g") + cells(gains, pairs, ">12.2f")
            rest = "".join(f"  {name} {error:.2g}" for name, error in mean.items() if name not in columns)
            print(line + f"  reference {row['caustics']['reference']:.2g}{rest}", flush=True)
        settings = {key: getattr(given, key) for key in ("seconds", "width", "reference_seconds")}
        record("guide", {"set": ",".join(pairs), **settings, **row})
