"""Tables of the bandwidth rules: convergence rates, the chi-squared test, CPPM beside its paper."""

from pathlib import PurePath

from ..fit import fit
from .markdown import digits, table

# The title, rule and parameters of a quantity, the key of the values to fit, and the theoretical exponent.
EXPONENTS = [
    ("CPPM's bias at k = 0.8, beta = 1.2", "cppm, forced", {"beta": 1.2, "k": 0.8}, "bias_given", -0.55),
    ("CPPM's bias at beta = 1/k^2", "cppm, forced", {"beta": 1.5625, "k": 0.8}, "bias_given", -0.33),
    ("CPPM's variance at k = 0.8, beta = 1.2", "cppm, forced", {"beta": 1.2, "k": 0.8}, "variance", -0.45),
    ("CPPM's variance at beta = 1/k^2", "cppm, forced", {"beta": 1.5625, "k": 0.8}, "variance", -0.67),
    ("CPPM's squared error at beta = 1/k^2", "cppm, forced", {"beta": 1.5625, "k": 0.8}, "mse", -0.67),
    ("bias of `vcm` where merging alone finds light", "vcm, merging alone", {"alpha": 0.75}, "bias", -0.25),
]


def slopes(figures):
    """The measured exponents of N, with standard errors, and the theoretical ones."""
    rows = []
    for quantity, rule, parameters, key, theory in EXPONENTS:
        series = figures.one("slopes", rule=rule, parameters=parameters)["series"]
        exponent, error = fit(series, key)
        # An expectation for given bandwidths is computed, so it has no standard error.
        noise = "" if key == "bias_given" else f" +- {error:.3f}"
        rows.append([quantity, f"{exponent:.3f}{noise}", f"{theory:.2f}"])
    return table(["quantity", "measured", "theory"], rows)


def size(figures):
    """The percentage of trials that reject uniform photons, by number of photons."""
    found = figures.one("cppm-rule")["size"]
    cells = [f"{100 * share:.1f}" for _, share, _ in found]
    return table(["photons", *(f"{count:,}" for count, *_ in found)], [["rejected, %", *cells]])


def looks(figures):
    """The percentage of uniform pixels whose bandwidth has shrunk at least once, by number of iterations."""
    found = figures.one("cppm-rule")["looks"]["rejected"]
    cells = [f"{100 * share:.0f}" for _, share in found]
    return table(["iterations", *(f"{count:,}" for count, _ in found)], [["shrunk at least once, %", *cells]])


def cost(figures):
    """The relative cost of the rule in an iteration, with 95 % intervals."""
    added = {}
    for one in figures.one("cppm-rule")["cost"]:
        low, high = one["rule_percent_95"]
        text = f"{one['rule_percent']:+.1f} % ({low:.1f} to {high:.1f})"
        added.setdefault(PurePath(one["scene"]).stem, {})[one["levels"]] = text
    return table(["scene", "one level", "five levels"], [[scene, of[1], of[5]] for scene, of in sorted(added.items())])


def race(figures):
    """SPPM's errors, and the iterations (core-seconds) in which APPM and CPPM reach them, in per cent of SPPM's."""

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
    """The squared error on a screen by CPPM's parameters, relative to the paper's parameters, with standard errors."""
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
