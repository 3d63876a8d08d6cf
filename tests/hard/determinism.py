"""12. Determinism: equal bytes for any number of threads, for shards merged in any order, and after a kill."""

from . import magnitude
from .answers import Resumed, Shards, Threads
from .case import ALL_METHODS, Case

TITLE = "Determinism"
DIVIDED = ("path", "bdpt", "sppm", "vcm", "mlt")
SCENE = {"scene": magnitude.room}

CASES = [
    Case(
        "threads",
        "1, 2, 3 and 7 threads",
        SCENE,
        Threads("Random numbers depend only on the indices of pixels and photons, and sums have a fixed order."),
        ALL_METHODS,
        size=24,
        iterations=2,
        photons=5000,
    ),
    Case(
        "shards",
        "Three shards, merged in all six orders, and one whole render",
        SCENE,
        Shards("Random numbers depend on the iteration's number, and sums do not depend on the order of their parts."),
        DIVIDED,
        size=16,
        iterations=6,
        photons=3000,
    ),
    Case(
        "shards-files",
        "The files of shards that are merged in all six orders",
        SCENE,
        Shards("With --reproducible, a merge writes no times and no file names.", files=True),
        ("path", "vcm"),
        size=16,
        iterations=6,
    ),
    Case(
        "resumed",
        "A render that is killed and resumed",
        SCENE,
        Resumed("A checkpoint contains the whole state of the render."),
        ("path", "sppm", "vcm", "cppm"),
        size=48,
        iterations={None: 60, "path": 200},
        photons=20000,
    ),
]
