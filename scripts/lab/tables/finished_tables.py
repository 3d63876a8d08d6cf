"""Tables of finished pictures at equal time, for a set of scenes."""

from .gallery_tables import NAMES
from .markdown import digits, table

GOALS = {
    "auto / best fixed method, within 1.1": "`auto` over the best other method, within 1.1",
    "auto / best peer with OIDN": "`auto` over the best other renderer with Open Image Denoise",
    "auto / OIDN alone": "`auto` over Open Image Denoise alone on the same input",
    "all methods / OIDN alone": "all methods over Open Image Denoise alone on the same input",
}
FIGURES = {"relmse_trimmed": "relMSE, trimmed", "relmse": "relMSE, all pixels", "flip": "FLIP"}


def finished(figures):
    """Trimmed relMSE of finished pictures by scene and method, of the peers' with OIDN, and the ratio of auto to the best
    other of our methods (or to the best peer, if there is no other)."""
    values = figures.one("finished")
    trimmed = values["figures"].index("relmse_trimmed")
    cells = values["cells"]
    ours = list(dict.fromkeys(method for cell in cells for method in cell["ours"]))
    peers = list(dict.fromkeys(peer for cell in cells for peer in cell["peers"]))
    rows = []
    for cell in cells:
        mine = {name: cell["ours"][name]["delivered"][trimmed] for name in ours if name in cell["ours"]}
        theirs = {name: of["oidn"][trimmed] for name, of in cell["peers"].items() if "oidn" in of}
        others = [error for name, error in mine.items() if name != "auto"] or list(theirs.values())
        ratio = mine["auto"] / min(others) if "auto" in mine and others else None
        shown = [*map(mine.get, ours), *map(theirs.get, peers), ratio]
        rows.append([cell["scene"].split("/")[-1], *map(digits, shown)])
    head = [
        f"scene, {cells[0]['budget']:g} s",
        *(f"`{name}`" for name in ours),
        *(NAMES[peer] for peer in peers),
        "auto / best",
    ]
    return table(head, rows)


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


KINDS = {"finished": finished, "goals": goals}
