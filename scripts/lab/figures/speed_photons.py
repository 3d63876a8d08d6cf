"""What more photons in an iteration of `sppm` gain at equal core-seconds: the merit of the usual number over that of
more, so that more than 1 is a gain.

--photons has the usual number first; by default 100,000 and 400,000 in a picture that is 1280 pixels wide, and the same
number per pixel in a smaller one.

With as many light paths for a pixel, bandwidths are as many pixels and the shares of time are the same. Stores the
figure `speed-photons`.
"""

from functools import partial

from .. import speed_runs
from ..cache import BIN, program
from ..options import options
from ..record import record

USUAL, FULL = [100_000, 400_000], 1280
ARGUMENTS = speed_runs.ARGUMENTS | {"photons": None}


def photons():
    """Light paths of an iteration, the usual number first."""
    return options.photons or [round(count * (options.width / FULL) ** 2) for count in USUAL]


def main():
    counts = photons()
    ours, rows = speed_runs.Program(BIN), []
    print(f"{'gain by photons':<20}" + "".join(f"{count:>10}" for count in counts[1:]))
    for scene, name, reference in speed_runs.with_references():
        kinds = {str(count): partial(ours.render, scene, ["--method", "sppm", "--photons", count]) for count in counts}
        found = speed_runs.taking_turns(kinds, reference)
        usual = found[str(counts[0])]["merit"]
        gains = {str(count): speed_runs.short(usual / found[str(count)]["merit"]) for count in counts[1:]}
        rows.append({"scene": name, "gains": gains, **speed_runs.stored(found)})
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
