"""Tables of finished pictures at equal time, for a set of scenes."""

from .gallery_tables import NAMES
from .markdown import digits, table

GOALS = {
    "auto / best fixed method, within 1.1": "`auto` over the best other method, within 1.1",
    "auto / best peer with OIDN": "`auto` over the best other renderer with Open Image Denoise",
    "auto / OIDN alone": "`auto` over Open Image Denoise alone on the same input",
    "all methods / OIDN alone": "all methods over Open Image Denoise alone on the same input",
}
# The `auto` of the program that --before names.
BEFORE = "auto before"
AUTO = {"auto", BEFORE}
INSIDE = {"flip_inside": "FLIP in glass and mirrors", "grain_inside": "grain in glass and mirrors"}
FIGURES = {"relmse_trimmed": "relMSE, trimmed", "relmse": "relMSE, all pixels", "flip": "FLIP", **INSIDE}


def finished(figures):
    """Trimmed relMSE of finished pictures by scene and method, of the peers' with OIDN, and the ratios of auto to the best
    other of our methods (or to the best peer, if there is no other) and to the auto of another program."""
    values = figures.one("finished")
    trimmed = values["figures"].index("relmse_trimmed")
    cells = values["cells"]
    ours = list(dict.fromkeys(method for cell in cells for method in cell["ours"]))
    peers = list(dict.fromkeys(peer for cell in cells for peer in cell["peers"]))
    rows = []
    for cell in cells:
        mine = {name: cell["ours"][name]["delivered"][trimmed] for name in ours if name in cell["ours"]}
        theirs = {name: of["oidn"][trimmed] for name, of in cell["peers"].items() if "oidn" in of}
        others = [error for name, error in mine.items() if name not in AUTO] or list(theirs.values())
        ratio = mine["auto"] / min(others) if "auto" in mine and others else None
        change = [mine["auto"] / mine[BEFORE] if mine.keys() >= AUTO else None] if BEFORE in ours else []
        shown = [*map(mine.get, ours), *map(theirs.get, peers), ratio, *change]
        rows.append([cell["scene"].split("/")[-1], *map(digits, shown)])
    head = [
        f"scene, {cells[0]['budget']:g} s",
        *(f"`{name}`" for name in ours),
        *(NAMES[peer] for peer in peers),
        "auto / best",
        *(["auto / before"] if BEFORE in ours else []),
    ]
    return table(head, rows)


def choices(figures):
    """What auto has chosen for each scene, and why, as `caustique plan` prints it."""
    cells = figures.one("finished")["cells"]
    return table(["scene", "choice"], [[cell["scene"], cell["chosen"]["auto"].removeprefix("auto: ")] for cell in cells])


def goals(figures):
    """Ratios of errors over all scenes of a set: geometric mean, worst, and the number of scenes within the limit (1 by
    default)."""
    rows = []
    values = figures.one("finished")
    several = len({method for cell in values["cells"] for method in cell["ours"]}) > 1
    for counts in values["counts"].values():
        for name, title in GOALS.items():
            if name.startswith("all methods") and not several:
                continue
            for figure, measure in FIGURES.items():
                of = counts.get(f"{name}: {figure}")
                if of:
                    numbers = [f"{of['geometric_mean']:.2f}", f"{of['worst']:.2f}", f"{of['within']} of {of['of']}"]
                    rows.append([title, measure, *numbers])
    return table(["ratio", "of", "geometric mean", "worst", "within"], rows)


KINDS = {"finished": finished, "choices": choices, "goals": goals}
