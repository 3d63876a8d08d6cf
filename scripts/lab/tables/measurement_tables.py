"""The tables of docs/lab/measurements.md, except that of the learned combiner."""

from .gallery_tables import NAMES
from .markdown import digits, table

# The `auto` of the program that --before names.
BEFORE = "auto before"
AUTO = {"auto", BEFORE}
# Effects in the order of the columns.
EFFECTS = "emission direct indirect glossy caustic sds volume".split()
EFFECTS += "dispersion depth_of_field environment alpha textures".split()
FLICKER_HEAD = ["shot", "pictures", "flicker", "error of a frame", "flicker, all pixels", "error, all pixels"]
FLICKER_KEYS = ("flicker_trimmed", "error_trimmed", "flicker", "error")


def path_peers(figures):
    """The squared error times core-seconds of our path tracing over another renderer's, by scene and renderer; in brackets
    if the mean of one of the pictures is not the reference's."""
    rows = figures.one("speed-peers")["rows"]
    peers = list(dict.fromkeys(row["peer"] for row in rows))
    found = {}
    for row in rows:
        found.setdefault(row["scene"], {})[row["peer"]] = ("({:.2f})" if row["strange"] else "{:.2f}").format(
            row["ratio"]
        )
    head = ["scene", *(NAMES[peer] for peer in peers)]
    return table(head, [[scene, *(of.get(peer, "-") for peer in peers)] for scene, of in found.items()])


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


def effects(figures):
    """Core-seconds of an iteration with all effects and without each effect, and the error without it in per cent."""
    runs = figures.all("effects")
    names = [name for name in EFFECTS if any(name in run["effects"] for run in runs)]
    rows = []
    for run in runs:
        found = [run["effects"].get(name) for name in names]
        cells = [f"{of['seconds_without']:.3f}, {100 * of['error']:.2g}" if of else "" for of in found]
        rows.append([run["scene"], f"{run['seconds']:.3f}", *cells])
    return table(["scene", "all", *(f"`{name}`" for name in names)], rows)


def mitsuba(figures):
    """Ratios of our means to Mitsuba's, and the numbers of tiles that count and that are off."""
    rows = [
        [
            of["scene"],
            "corrected" if of["corrected"] else "unchanged",
            f"{of['mean_ratio']:.4f}",
            f"{of['tiles_sure']} of {of['tiles']}",
            str(of["tiles_off"]),
        ]
        for of in figures.all("mitsuba")
    ]
    return table(["scene", "Mitsuba's models", "mean ratio", "tiles that count", "off"], rows)


def flicker(figures):
    """Flicker and error by shot and row; without the worst pixels, and of all."""
    rows = figures.one("flicker")["rows"]
    return table(FLICKER_HEAD, [[row["shot"], row["row"], *(digits(row[key]) for key in FLICKER_KEYS)] for row in rows])


# Stored key of a pair of summaries, and its title.
_ROWS = (
    ("export, Blender started", "export"),
    ("load", "load"),
    ("from loading to the first picture, coarse", "first"),
    ("from loading to the first full picture", "first_full"),
    ("camera move to the coarse picture", "move"),
    ("camera move to the full picture", "move_full"),
    ("moved object to the coarse picture", "place"),
)


def _cell(one, key):
    """Seconds and core-seconds of a stored value."""
    if isinstance(one[key], dict):
        of = one[key]
        return f"{of['median']:.2f} (worst {of['worst']:.2f}; {of['core_seconds']:.2f} core-s)"
    cores = one.get(f"{key}_core_seconds")
    return f"{one[key]:.2f}" + ("" if cores is None else f" ({cores:.2f} core-s)")


def viewport(figures):
    """Seconds from changes to pictures, by scene."""
    scenes = sorted(figures.all("viewport"), key=lambda one: one["triangles"])
    rows = [[title, *(_cell(one, key) for one in scenes)] for title, key in _ROWS]
    rows.append(["coarse pictures a second while the camera moves", *(f"{1 / one['drag']:.1f}" for one in scenes)])
    rows.append(["ratio of sides of the last coarse picture", *(f"1 / {one['coarse']}" for one in scenes)])
    rows.append(["peak memory, GiB", *(f"{one['peak_bytes'] / 2**30:.2f}" for one in scenes)])
    rows.append(["load average", *(f"{one['load_average']:.1f}" for one in scenes)])
    return table(["seconds", *(one["scene"] for one in scenes)], rows)


def knobs(figures):
    """The errors and core-seconds of renders, by option."""
    rows = []
    for group, _, words, spent, _, error, _, gain, _ in figures.one("knobs")["rows"]:
        rows.append([group, f"`{words}`", f"{spent:.1f}", f"{100 * error:.1f} %", f"{gain:.2f}"])
    return table(["group", "options", "core-s", "error", "gain"], rows)


KINDS = {
    "path-peers": path_peers,
    "finished": finished,
    "effects": effects,
    "mitsuba": mitsuba,
    "flicker": flicker,
    "viewport": viewport,
    "knobs": knobs,
}
