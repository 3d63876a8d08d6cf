#!/usr/bin/env python3
"""What more photons in an iteration of `sppm` gain at equal core-seconds: the merit of the usual number over that of
more, so that more than 1 is a gain.

  PHOTONS   light paths of an iteration, the usual number first [100,000 and 400,000 in a picture that is 1280
            pixels across: in a smaller one as many for a pixel]
  SECONDS_EACH, SET, SCENES, SEEDS, WIDTH, THREADS, REFERENCE_SECONDS   as in speed.py

With as many light paths for a pixel, bandwidths are as many pixels and the shares of time are the same. Stores the
figure `speed-photons`.
"""

import os
from functools import partial

import _speed
from _cache import BIN, WIDTH, program
from record import record

USUAL, FULL = [100_000, 400_000], 1280
SCALED = ",".join(str(round(count * (WIDTH / FULL) ** 2)) for count in USUAL)
PHOTONS = [int(x) for x in os.environ.get("PHOTONS", SCALED).split(",")]


def main():
    ours, rows = _speed.Program(BIN), []
    print(f"{'gain by photons':<20}" + "".join(f"{count:>10}" for count in PHOTONS[1:]))
    for scene, name, reference in _speed.references():
        kinds = {
            str(count): partial(ours.render, scene, ["--method", "sppm", "--photons", count]) for count in PHOTONS
        }
        found = _speed.taking_turns(kinds, reference)
        usual = found[str(PHOTONS[0])]["merit"]
        gains = {str(count): _speed.short(usual / found[str(count)]["merit"]) for count in PHOTONS[1:]}
        rows.append({"scene": name, "gains": gains, **_speed.stored(found)})
        print(f"{name:<20}" + "".join(f"{gain:>10.2f}" for gain in gains.values()), flush=True)
    found = {}
    for title, second in (("first", False), ("second", True)):
        for count in map(str, PHOTONS[1:]):
            gains = {row["scene"]: row["gains"][count] for row in rows if row["scene"].startswith("second/") == second}
            if gains:
                mean, least = _speed.geometric(list(gains.values())), min(gains, key=gains.get)
                of = {"geometric_mean": _speed.short(mean), "least": gains[least], "where": least, "of": len(gains)}
                found.setdefault(count, {})[title] = of
                print(f"{count} photons, {title} set: geometric mean {mean:.3f}, least {gains[least]:.2f} ({least})")
    record("speed-photons", {**_speed.SETTINGS, "program": program(), "summary": found, "rows": rows})


if __name__ == "__main__":
    main()
