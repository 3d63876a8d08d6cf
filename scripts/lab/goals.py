"""Goals of finished pictures: ratios of our errors to others'. A ratio below 1 means that ours is smaller."""

import math

FIGURES = ("relmse", "relmse_trimmed", "flip", "grain", "grain_trimmed", "flip_inside", "grain_inside")


def ratio(ours, other, figure, floor):
    """Our error over the other one. Errors below `floor` count as `floor`, because noise hides them."""
    return max(ours[figure], floor) / max(other[figure], floor)


def summary(ratios, limit=1.0):
    """The geometric mean of ratios, the worst, and the number that are at most `limit`."""
    if not ratios:
        return None
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
    return {
        "geometric_mean": round(mean, 4),
        "worst": round(max(ratios), 4),
        "within": sum(r <= limit for r in ratios),
        "of": len(ratios),
    }


def best(candidates, figure):
    """The candidate whose error `figure` is smallest."""
    return min(candidates, key=lambda one: one[figure])


def inputs(pictures):
    """The figures of the pictures before the finish: the estimate and its levels."""
    return [figures for name, figures in pictures.items() if name == "noisy" or name.startswith("level")]


def goals(cells, main):
    """The ratios of one set of scenes and one budget. `main` is the method whose finished picture is compared.

    `cells` has one entry per scene, {"floor": .., "ours": {name: pictures}, "peers": {name: pictures}}.
    """
    found = {}
    for figure in FIGURES:
        floor = (lambda cell: cell["floor"]) if not figure.startswith("flip") else (lambda cell: 1e-6)
        # Scenes without glass and mirrors have no errors inside.
        whole = [cell for cell in cells if main in cell["ours"] and figure in cell["ours"][main]["delivered"]]
        beside = []
        for cell in whole:
            rivals = [pictures["oidn"] for pictures in cell["peers"].values() if "oidn" in pictures]
            if rivals:
                beside.append(ratio(cell["ours"][main]["delivered"], best(rivals, figure), figure, floor(cell)))
        found[f"{main} / best peer with OIDN: {figure}"] = summary(beside)
        for name, chosen in ((main, [main]), ("all methods", None)):
            pairs = [
                (cell, cell["ours"][m])
                for cell in cells
                for m in (chosen or cell["ours"])
                if figure in cell["ours"].get(m, {}).get("delivered", {})
            ]
            alone = [ratio(p["delivered"], p["oidn"], figure, floor(cell)) for cell, p in pairs if "oidn" in p]
            found[f"{name} / OIDN alone: {figure}"] = summary(alone)
            own = [
                ratio(p["delivered"], best(inputs(p), figure), figure, floor(cell)) for cell, p in pairs if inputs(p)
            ]
            found[f"{name} / best of its own inputs, within 1.02: {figure}"] = summary(own, 1.02)
        fixed = []
        for cell in whole:
            others = [
                pictures["delivered"]
                for name, pictures in cell["ours"].items()
                if name.split()[0] != "auto" and name.split()[1:] == main.split()[1:]
            ]
            if others:
                fixed.append(ratio(cell["ours"][main]["delivered"], best(others, figure), figure, floor(cell)))
        found[f"{main} / best fixed method, within 1.1: {figure}"] = summary(fixed, 1.1)
        for other in sorted({name for cell in whole for name in cell["ours"] if name.startswith(f"{main} ")}):
            pairs = [(cell, cell["ours"][other]["delivered"]) for cell in whole if other in cell["ours"]]
            ratios = [ratio(its, cell["ours"][main]["delivered"], figure, floor(cell)) for cell, its in pairs]
            found[f"{other} / {main}: {figure}"] = summary(ratios)
    return {name: value for name, value in found.items() if value}
