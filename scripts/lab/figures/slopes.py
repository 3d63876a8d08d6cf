"""Bias and variance against iterations on a light field in closed form: the memoryless rule beside its finite sums, and
CPPM whose test always rejects. Draws docs/lab/slopes.svg. It takes about five minutes.

Exponents are fitted from 128 iterations on by weighted least squares in the logarithms.
"""

import json

from ..bench import lines
from ..fit import fit
from ..options import options
from ..record import ROOT, record

ARGUMENTS = {"iterations": 4096, "seeds": 8}


def show(values):
    """Prints a rule's series and its exponents."""
    print(values["rule"], values["parameters"], f"{values['seeds']} seeds")
    for s in values["series"]:
        text = [f"{s['iterations']:>8}  bias {s['bias'][0]:.4f} +- {s['bias'][1]:.4f}"]
        text += [f", given bandwidths {s['bias_given'][0]:.4f} +- {s['bias_given'][1]:.4f}"]
        text += [f"  variance {s['variance'][0]:.3e} +- {s['variance'][1]:.1e}  mse {s['mse'][0]:.3e}"]
        if "bias_sum" in s:
            text += [f"  sums: {s['bias_sum']:.4f}, {s['variance_sum'][0]:.3e}"]
        print("".join(text))
    for key in ("bias", "bias_given", "variance", "mse"):
        slope, error = fit(values["series"], key)
        print(f"  {key} N^{slope:.3f} +- {error:.3f}")


def main():
    picture = ROOT / "docs" / "lab" / "slopes.svg"
    for line in lines("slopes", options.iterations, options.seeds, picture):
        values = json.loads(line)
        record("slopes", values)
        show(values)
