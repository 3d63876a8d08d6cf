"""Prints the last slopes that were stored, with exponents fitted from 128 iterations on by weighted least squares in the logarithms."""

import math

from record import entries


def fit(series, key):
    """Exponent and its standard error."""
    points = [(math.log(s["iterations"]), *s[key]) for s in series if s["iterations"] >= 128 and s[key][0] > 0]
    # The same bandwidths with every seed have no error: all points count alike.
    weights = [(value / max(error, 1e-3 * value)) ** 2 for _, value, error in points]
    total = sum(weights)
    mean_x = sum(w * x for w, (x, _, _) in zip(weights, points)) / total
    mean_y = sum(w * math.log(v) for w, (_, v, _) in zip(weights, points)) / total
    spread = sum(w * (x - mean_x) ** 2 for w, (x, _, _) in zip(weights, points))
    slope = sum(w * (x - mean_x) * (math.log(v) - mean_y) for w, (x, v, _) in zip(weights, points)) / spread
    return slope, spread**-0.5


def main():
    for entry in [e["values"] for e in entries() if e["name"] == "slopes"][-5:]:
        print(entry["rule"], entry["parameters"], f"{entry['seeds']} seeds")
        for s in entry["series"]:
            line = f"{s['iterations']:>8}  bias {s['bias'][0]:.4f} +- {s['bias'][1]:.4f}, given bandwidths {s['bias_given'][0]:.4f} +- {s['bias_given'][1]:.4f}"
            line += f"  variance {s['variance'][0]:.3e} +- {s['variance'][1]:.1e}  mse {s['mse'][0]:.3e}"
            if "bias_sum" in s:
                line += f"  sums: {s['bias_sum']:.4f}, {s['variance_sum'][0]:.3e}"
            print(line)
        print("   ".join(f"{key} N^{{:.3f}} +- {{:.3f}}".format(*fit(entry["series"], key)) for key in ("bias", "bias_given", "variance", "mse")))


if __name__ == "__main__":
    main()
