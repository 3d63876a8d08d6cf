"""Tables that compare methods, guided and unguided light paths, effects, Mitsuba, and a smaller program."""

from .markdown import digits, table

# Effects in the order of the columns.
EFFECTS = "emission direct indirect glossy caustic sds volume".split()
EFFECTS += "dispersion depth_of_field environment alpha textures".split()


def media(figures):
    """Table of the errors of renders, by method."""
    runs = figures.one("media")["methods"]
    rows = [
        [f"`{name}`", f"{of['mean_ratio']:.3f}", digits(of["relmse"]), digits(of["relmse_trimmed"])]
        for name, of in runs.items()
    ]
    return table(["method", "mean ratio", "relMSE", "trimmed"], rows)


def equal_time(figures):
    """Errors by method and scene, and core-seconds of a million paths from either end."""
    runs = figures.all("equal-time")
    head, names = ["method"], [one["method"] for one in runs[0]["methods"]]
    for run in runs:
        head += [f"{run['scene']}: relMSE", "trimmed", "core-s per million light paths", "camera paths"]
    rows = []
    for name in names:
        row = [name]
        for run in runs:
            of = next(one for one in run["methods"] if one["method"] == name)
            costs = [of[f"core_s_per_million_{end}_paths"] for end in ("light", "eye")]
            row += [digits(of["relmse"]), digits(of["trimmed"]), *("-" if c is None else f"{c:.1f}" for c in costs)]
        rows.append(row)
    return table(head, rows)


def guide(figures):
    """Trimmed relMSE without and with a guide, for the pairs of runs that the set names."""
    pairs = figures.of.split(",")
    head, rows = ["scene"], []
    for pair in pairs:
        head += [f"{pair}, unguided", "guided", "gain"]
    for of in figures.all("guide"):
        row = [of["scene"]]
        for pair in pairs:
            plain, guided = (of["relmse_trimmed"][name] for name in (pair, f"{pair} guided"))
            row += [digits(plain), digits(guided), digits(plain / guided)]
        rows.append(row)
    return table(head, rows)


def guided_layer(figures):
    """relMSE of the layer Caustic, seed by seed, if photons bring only caustics."""
    head = ["scene", "unguided", "guided, one light path per pixel", "guided, with the unguided number of light paths"]
    rows = []
    for of in figures.all("guide", having="caustics"):
        errors = of["caustics"]["errors"]
        runs = ("sppm", "sppm guided", "sppm guided, all paths")
        rows.append([of["scene"], *(", ".join(map(digits, errors[run])) for run in runs)])
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


def smaller_program(figures):
    """Time of the whole program over the time of a program without some effects, by scene and method; in brackets for
    either half of the runs."""
    ratios = {}
    for of in figures.one("bare")["rows"]:
        text = "{:.3f} ({:.3f}, {:.3f})".format(of["ratio"], *of["halves"])
        ratios.setdefault(of["scene"], {})[of["method"]] = text
    methods = list(next(iter(ratios.values())))
    head = ["scene", *(f"`{method}`" for method in methods)]
    return table(head, [[scene, *(of[method] for method in methods)] for scene, of in ratios.items()])


KINDS = {
    "media": media,
    "equal-time": equal_time,
    "guide": guide,
    "guided-layer": guided_layer,
    "effects": effects,
    "mitsuba": mitsuba,
    "bare": smaller_program,
}
