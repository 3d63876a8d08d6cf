"""The gain from more photons in an iteration of `sppm` at equal core-seconds: the cost of the default number over the cost
of a larger number. Above 1 is a gain.

--photons starts with the default number. Without it, the numbers are 100,000 and 400,000 for pictures 1280 pixels wide,
and in proportion to the pixels for smaller ones, which keeps the bandwidths in pixels and the shares of time. Stores the
figure `speed-photons`.
"""

from functools import partial

from .. import speed_runs
from ..cache import BIN, program
from ..options import options
from ..record import record

# Light paths of an iteration in a picture of this width.
PHOTONS, FULL_WIDTH = [100_000, 400_000], 1280
ARGUMENTS = speed_runs.ARGUMENTS | {"photons": None}


def photons():
    """The numbers of light paths of an iteration, the default first."""
    return options.photons or [round(count * (options.width / FULL_WIDTH) ** 2) for count in PHOTONS]


def main():
    counts = photons()
    ours, rows = speed_runs.Program(BIN), []
    print(f"{'gain by photons':<20}" + "".join(f"{count:>10}" for count in counts[1:]))
    for scene, name, reference in speed_runs.with_references():
        kinds = {str(count): partial(ours.render, scene, ["--method", "sppm", "--photons", count]) for count in counts}
        found = speed_runs.measure_alternately(kinds, reference)
        default = found[str(counts[0])]["merit"]
        gains = {str(count): speed_runs.short(default / found[str(count)]["merit"]) for count in counts[1:]}
        rows.append({"scene": name, "gains": gains, **speed_runs.rounded(found)})
        print(f"{name:<20}" + "".join(f"{gain:>10.2f}" for gain in gains.values()), flush=True)
    found = {}
    for title, second in (("first", False), ("second", True)):
        for count in map(str, counts[1:]):
            gains = {row["scene"]: row["gains"][count] for row in rows if row["scene"].startswith("second/") == second}
            if gains:
                mean, least = speed_runs.geometric(list(gains.values())), min(gains, key=gains.get)
                of = {"geometric_mean": speed_runs.short(mean), "least": gains[least], "where": least, "of": len(gains)}
                found.setdefault(count, {})[title] = of
                print(f"{count} photons, {title} set: geometric mean {mean:.3f}, least {gains[least]:.2f} ({least})")
    record("speed-photons", {**speed_runs.settings(), "program": program(), "summary": found, "rows": rows})
