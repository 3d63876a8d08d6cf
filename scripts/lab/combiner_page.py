"""A page of pictures of the combiner: what each network made of a render, and the shares of its weights."""

import numpy as np
from PIL import Image, ImageDraw

# Pixels of the line with the names above each row of pictures, and greatest number of pictures in a row.
TITLE, COLUMNS = 14, 6


def display(picture, exposure):
    """A picture as bytes: scene-linear values times an exposure, by the transfer function of sRGB."""
    values = np.clip(np.nan_to_num(picture) * exposure, 0, 1)
    values = np.where(values <= 0.0031308, 12.92 * values, 1.055 * np.maximum(values, 1e-6) ** (1 / 2.4) - 0.055)
    return Image.fromarray((255 * values + 0.5).astype(np.uint8))


def page(path, pictures, shares, reference):
    """Writes a sheet: the pictures by name and the reference, then the shares [h, w] by name in grey."""
    # The 95th percentile of the reference is as bright as white.
    exposure = 1 / max(np.percentile(reference, 95), 1e-9)
    tiles = [(name, display(picture, exposure)) for name, picture in {**pictures, "reference": reference}.items()]
    tiles += [(name, display(np.repeat(share[..., None], 3, -1), 1)) for name, share in shares.items()]
    width, height = tiles[0][1].size
    columns, lines = min(COLUMNS, len(tiles)), -(-len(tiles) // COLUMNS)
    sheet = Image.new("RGB", (columns * width, lines * (height + TITLE)), "white")
    draw = ImageDraw.Draw(sheet)
    for k, (name, tile) in enumerate(tiles):
        x, y = k % COLUMNS * width, k // COLUMNS * (height + TITLE)
        draw.text((x + 2, y + 1), name, fill="black")
        sheet.paste(tile, (x, y + TITLE))
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(path, quality=80, optimize=True)
