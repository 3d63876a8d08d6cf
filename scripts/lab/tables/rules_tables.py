"""Tables of the progressive rules: rates, the chi-squared test, CPPM beside its paper."""

from pathlib import PurePath

from ..fit import fit
from .markdown import digits, table

# What falls, by rule and parameters: the figure that is fitted, and the exponent of theory.
EXPONENTS = [
    ("CPPM's bias at k = 0.8, beta = 1.2", "cppm, forced", {"beta": 1.2, "k": 0.8}, "bias_given", -0.55),
    ("CPPM's bias at beta = 1/k^2", "cppm, forced", {"beta": 1.5625, "k": 0.8}, "bias_given", -0.33),
    ("CPPM's variance at k = 0.8, beta = 1.2", "cppm, forced", {"beta": 1.2, "k": 0.8}, "variance", -0.45),
    ("CPPM's variance at beta = 1/k^2", "cppm, forced", {"beta": 1.5625, "k": 0.8}, "variance", -0.67),
    ("CPPM's squared error at beta = 1/k^2", "cppm, forced", {"beta": 1.5625, "k": 0.8}, "mse", -0.67),
    ("bias of `vcm` where merging alone finds light", "vcm, merging alone", {"alpha": 0.75}, "bias", -0.25),
]


def slopes(figures):
    """Exponents of N that were measured, with standard errors, beside those of theory."""
    rows = []
    for what, rule, parameters, key, theory in EXPONENTS:
        series = figures.one("slopes", rule=rule, parameters=parameters)["series"]
        exponent, error = fit(series, key)
        # Given its bandwidths an expectation is known: no error of measurement.
        noise = "" if key == "bias_given" else f" +- {error:.3f}"
        rows.append([what, f"{exponent:.3f}{noise}", f"{theory:.2f}"])
    return table(["what falls", "measured", "theory"], rows)


def size(figures):
    """Percentage of trials in which uniform photons are rejected, by their number."""
    found = figures.one("cppm-rule")["size"]
    cells = [f"{100 * share:.1f}" for _, share, _ in found]
    return table(["photons", *(f"{count:,}" for count, *_ in found)], [["rejected, %", *cells]])


def looks(figures):
    """Percentage of uniform pixels that have shrunk at least once, by iterations."""
    found = figures.one("cppm-rule")["looks"]["rejected"]
    cells = [f"{100 * share:.0f}" for _, share in found]
    return table(["iterations", *(f"{count:,}" for count, _ in found)], [["shrunk at least once, %", *cells]])


def cost(figures):
    """What the rule adds to an iteration, with intervals of 95 %."""
    added = {}
    for one in figures.one("cppm-rule")["cost"]:
        low, high = one["rule_percent_95"]
        text = f"{one['rule_percent']:+.1f} % ({low:.1f} to {high:.1f})"
        added.setdefault(PurePath(one["scene"]).stem, {})[one["levels"]] = text
    return table(["scene", "one level", "five levels"], [[scene, of[1], of[5]] for scene, of in sorted(added.items())])


def race(figures):
    """SPPM's errors, and iterations (core-seconds) that APPM and CPPM need to get there, in percent of SPPM's."""

    def needed(run, of, method):
        if not of[method]["reached"]:
            return "not reached"
        iterations, seconds = of[method]["reached"]
        return f"{100 * iterations / run['iterations']:.0f} ({100 * seconds / of['seconds']:.0f})"

    head, rows = ["scene"], []
    for name in ("photons' light", "screen"):
        head += [f"{name}: SPPM's squared error", "APPM", "CPPM"]
    for run in figures.all("time-to-target"):
        row = [run["scene"]]
        for of in (run["photons"], run["display"]):
            row += [digits(of["target"]), needed(run, of, "appm"), needed(run, of, "cppm")]
        rows.append(row)
    return table(head, rows)


def parameters(figures):
    """Squared error on a screen by CPPM's parameters over that of the paper's, with standard errors."""
    runs = figures.all("cppm-parameters")
    shown = {run["scene"]: {} for run in runs}
    for run in runs:
        for one in run["rows"][1:]:
            setting = {
                "rate": f"k {one['k']:g}, beta {one['beta']:g}",
                "partition": f"n_a {one['annuli']}, n_s {one['sectors']}",
                "significance": f"significance {one['significance']:g}",
            }[one["table"]]
            shown[run["scene"]][setting] = one["display"]
        shown[run["scene"]]["SPPM"] = run["sppm_display"]
    settings = dict.fromkeys(setting for of in shown.values() for setting in of)
    rows = [[setting, *("{:.3f} +- {:.3f}".format(*of[setting]) for of in shown.values())] for setting in settings]
    return table(["setting", *shown], rows)


KINDS = {
    "slopes": slopes,
    "cppm-size": size,
    "cppm-looks": looks,
    "cppm-cost": cost,
    "time-to-target": race,
    "cppm-parameters": parameters,
}
