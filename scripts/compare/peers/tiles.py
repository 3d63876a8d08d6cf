"""Statistics of two sets of renders over tiles of 16x16 pixels, and a picture of the difference."""

import io

import numpy as np
from PIL import Image

TILE = 16
#: A tile counts if the standard error of its ratio is below MAX_ERROR; it agrees if the ratio is 1 within MAX_TILE_OFF.
MAX_ERROR, MAX_TILE_OFF = 0.01, 0.03
#: Smallest share of the tiles that must count, and largest deviation of the ratio of the means from 1.
MIN_COUNTED, MAX_MEAN_OFF = 0.95, 0.01
#: Relative difference with full colour in the picture.
FULL_COLOUR = 0.1


def tiled(pictures):
    """Means over channels and tiles (renders, rows, columns). Pixels beyond the last whole tile are left out."""
    n, height, width, _ = pictures.shape
    rows, columns = height // TILE, width // TILE
    whole = pictures[:, : rows * TILE, : columns * TILE].mean(axis=-1)
    return whole.reshape(n, rows, TILE, columns, TILE).mean(axis=(2, 4))


def ratio(ours, theirs):
    """Ratio of the means over the first axis, and its standard error."""
    n, m = len(ours), len(theirs)
    a, b = ours.mean(axis=0), theirs.mean(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = a / b
        error = r * np.sqrt(ours.var(axis=0, ddof=1) / n / a**2 + theirs.var(axis=0, ddof=1) / m / b**2)
    # Two black tiles are equal.
    black = (a == 0) & (b == 0)
    return np.where(black, 1.0, r), np.where(black, 0.0, error)


def compare(ours, theirs):
    """Statistics of two sets of renders (renders, height, width, 3)."""
    not_finite = int(np.sum(~np.isfinite(ours)) + np.sum(~np.isfinite(theirs)))
    mean, mean_error = ratio(ours.mean(axis=(1, 2, 3)), theirs.mean(axis=(1, 2, 3)))
    r, error = ratio(tiled(ours), tiled(theirs))
    sure = error < MAX_ERROR
    near = np.abs(r - 1) < MAX_TILE_OFF
    a, b = ours.mean(axis=0), theirs.mean(axis=0)
    relative = ((a - b) ** 2 / (b.mean(axis=-1, keepdims=True) ** 2 + 0.01)).mean()
    # The part of relMSE that noise explains.
    variance = ours.var(axis=0, ddof=1) / len(ours) + theirs.var(axis=0, ddof=1) / len(theirs)
    noise = (variance / (b.mean(axis=-1, keepdims=True) ** 2 + 0.01)).mean()
    off = np.argwhere(sure & ~near)
    # Without noise, rounding to single precision is the only difference: at least 1e-5.
    z = (r - 1) / np.maximum(error, 1e-5)
    return {
        "mean_ratio": float(mean),
        "mean_ratio_error": float(mean_error),
        "relmse": float(relative),
        "relmse_noise": float(noise),
        "tiles": int(r.size),
        "tiles_sure": int(sure.sum()),
        "tiles_off": len(off),
        "ratio_least": float(r[sure].min(initial=np.inf)),
        "ratio_most": float(r[sure].max(initial=-np.inf)),
        "error_median": float(np.median(error)),
        "chi2_per_tile": float(np.mean(z**2)),
        "off": [[int(x) * TILE, int(y) * TILE, float(r[y, x]), float(error[y, x])] for y, x in off[:12]],
        "not_finite": not_finite,
        "agrees": bool(
            abs(mean - 1) <= MAX_MEAN_OFF and not len(off) and sure.mean() >= MIN_COUNTED and not not_finite
        ),
    }


def table(v):
    """The statistics as text."""
    lines = [
        f"{v['scene']}: caustique {v['method']}, {v['seeds']} x {v['iterations']} iterations; Mitsuba {v['mitsuba']}, "
        f"{v['seeds']} x {v['spp']} samples{', corrected' if v['corrected'] else ''}; {v['width']} x {v['height']}",
        f"  mean ratio      {v['mean_ratio']:.5f} +- {v['mean_ratio_error']:.5f}",
        f"  relMSE          {v['relmse']:.3e} ({v['relmse_noise']:.3e} of it is noise)",
        f"  tiles           {v['tiles']}, {v['tiles_sure']} with a standard error below {MAX_ERROR:.0%}; "
        f"median {v['error_median']:.2%}",
        f"  tile ratios     {v['ratio_least']:.4f} to {v['ratio_most']:.4f}; "
        f"{v['tiles_off']} differ by {MAX_TILE_OFF:.0%} or more",
        f"  chi2 per tile   {v['chi2_per_tile']:.2f}",
        f"  seconds         caustique {v['seconds_caustique']}, Mitsuba {v['seconds_mitsuba']}",
        f"  agrees          {'yes' if v['agrees'] else 'NO'}",
    ]
    lines += [f"    at x {x}, y {y}: {r:.4f} +- {e:.4f}" for x, y, r, e in v["off"]]
    return "\n".join(lines)


def _display(linear, scale):
    x = np.clip(linear * scale, 0, None)
    x = x / (1 + x / 4)
    return np.clip(np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055), 0, 1)


def _diverging(relative):
    t = np.clip(relative / FULL_COLOUR, -1, 1)[..., None]
    grey, red, blue = np.array([0.95, 0.95, 0.95]), np.array([0.75, 0.05, 0.1]), np.array([0.1, 0.2, 0.75])
    return grey + np.maximum(t, 0) * (red - grey) + np.maximum(-t, 0) * (blue - grey)


def picture(ours, theirs, path):
    """Write a PNG: both pictures above, the relative difference by pixel and by tile below, uncounted tiles hatched."""
    a, b = ours.mean(axis=0), theirs.mean(axis=0)
    scale = 0.5 / max(np.median(b.mean(axis=-1)), 1e-9)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_pixel = np.nan_to_num((a - b).mean(axis=-1) / b.mean(axis=-1))
    r, error = ratio(tiled(ours), tiled(theirs))
    by_tile = np.full(b.shape, 0.5)
    blocks = np.kron(np.nan_to_num(r - 1), np.ones((TILE, TILE)))
    hatched = np.kron(error >= MAX_ERROR, np.ones((TILE, TILE))) > 0
    hatched &= np.add.outer(np.arange(hatched.shape[0]), np.arange(hatched.shape[1])) % 6 == 0
    by_tile[: blocks.shape[0], : blocks.shape[1]] = np.where(hatched[..., None], 0.3, _diverging(blocks))
    above, below = (_display(a, scale), _display(b, scale)), (_diverging(by_pixel), by_tile)
    whole = np.concatenate([np.concatenate(row, axis=1) for row in (above, below)])
    path.write_bytes(png(whole))


def png(colours):
    """An array (height, width, 3) of [0, 1] as a PNG file's bytes."""
    file = io.BytesIO()
    Image.fromarray((np.clip(colours, 0, 1) * 255 + 0.5).astype(np.uint8)).save(file, "PNG")
    return file.getvalue()
