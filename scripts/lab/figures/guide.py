"""Guided light paths against unguided ones at equal time: relMSE of sppm whose photons bring caustics alone, of sppm and cppm whose photons bring all light, and of vcm, with and without, of all pixels and without the worst 0.5 %.
On scenes whose caustics only guided light paths find, that of the layer Caustic too, by renders of their own: what guiding is for, without the noise of all other light.

Arguments and references are those of auto.py; --methods chooses among the pairs. Each scene is stored on its own, with the pairs as its set.
"""

import subprocess

from . import auto
from ..options import options as given
from ..reading import read
from ..record import record

# Photons of caustics alone do not do for media that scatter.
SCATTERING = ["fog", "godrays"]
# Other cameras to look through, where what only guided light paths find fills the picture.
CLOSE = {"stadium": ["Close up"]}
PLAIN = {
    "sppm": auto.fixed("sppm") + " --indirect paths",
    "all": auto.fixed("sppm"),
    "cppm": auto.fixed("cppm"),
    "vcm": auto.fixed("vcm"),
}
HOW = {"": "", " guided": " --guide on"}
ARGUMENTS = auto.ARGUMENTS | {"methods": list(PLAIN)}


def runs_of(plain):
    """Runs by name, with their options: each of some methods without a guide and with one."""
    return {name + how: PLAIN[name] + option for name in plain for how, option in HOW.items()}


def caustics(scene):
    """relMSE of the layer Caustic by run after --seconds, and half that of two references against each other; "all paths": as many light paths with a guide as without."""

    def render(name, options, seconds, seed):
        path = auto.OUT / f"{scene}-{given.width}-{name.replace(' ', '-')}-{seconds:g}s-{seed}.exr"
        if not path.exists():
            command = [auto.BIN, "render", auto.ROOT / "scenes" / f"{scene}.glb", "-o", path, "--progress", "none"]
            command += [*options.split(), "--width", str(given.width), "--time", str(seconds), "--seed", str(seed)]
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
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


def cells(figures, columns, how):
    """A cell for every column, a dash where there is no figure."""
    width = how[: how.index(".")]
    return "".join(f"{figures[name]:{how}}" if name in figures else f"{'-':{width}}" for name in columns)


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
        said = {
            "set": ",".join(pairs),
            "seconds": given.seconds,
            "width": given.width,
            "reference_seconds": given.reference_seconds,
        }
        record("guide", {**said, **row})
