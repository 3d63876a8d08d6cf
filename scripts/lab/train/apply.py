"""Combine the levels of rendered pictures with a checkpoint's network.

  python -m lab.train.apply --checkpoint RUN/last.pt --scene SCENE.glb PICTURE.exr -o OUT.exr [--independent BDPT.exr]

The picture has five levels, two camera paths, and the layers that data.py asks for. The deep combiner also needs a
picture by bdpt with quarters. The layers Share1, Share2, ... of the output are the shares of each pair in the sum of the weights.
"""

import argparse
from pathlib import Path

import numpy as np
import OpenEXR
import torch

from . import combination, data, export_network, views

# Side in pixels of tiles, and the border around them that their pixels depend on.
TILE, BORDER = 256, 64


def arrays_of(path, scene, independent=None):
    """The arrays of a rendered picture, as data.py stores snapshots, and its exposure."""
    picture = data.channels_of(path)
    note = data.scales(picture, scene)
    height = picture["depth.Z"].shape[0]
    arrays = data.stack(picture, note, height, note["radii"])
    if independent:
        other = data.channels_of(independent)
        arrays |= {f"bdpt_{key}": value for key, value in data.independent_arrays(other, note["exposure"]).items()}
    arrays = {key: value[None] for key, value in arrays.items()}
    iterations = data.header_of(path)["history"][-1]["iterations"]
    blank = np.zeros((2, *arrays["depth"].shape[1:], 3), np.float32)
    return arrays | {"iterations": np.array([iterations]), "halves": blank}, note["exposure"]


@torch.no_grad()
def combined(net, arrays):
    """The combination of a whole picture [h, w, 3], in tiles, and the shares of the weights [n, h, w] of each pair."""
    sample = views.sample(views.snapshot(arrays, 0, net.pairs), net.pairs, net.version)
    image, y, z, _ = (torch.from_numpy(x) for x in sample)
    h, w = image.shape[-2:]
    # The network reads zeros beyond the picture, but the windows of the equation end with it.
    image = torch.nn.functional.pad(image, [0, -w % net.stride, 0, -h % net.stride])
    out, shares = torch.zeros(3, h, w), None
    for top in range(0, h, TILE):
        for left in range(0, w, TILE):
            above, before = max(top - BORDER, 0), max(left - BORDER, 0)
            part = (None, ..., slice(above, top + TILE + BORDER), slice(before, left + TILE + BORDER))
            y_part, z_part = y[part], z[part]
            output = net(image[part])[..., : y_part.shape[-2], : y_part.shape[-1]]
            weights, values = combination.pair_sums(output, y_part, z_part, net.form)
            total = weights.sum(1, keepdim=True)
            shares = torch.zeros(weights.shape[1], h, w) if shares is None else shares
            down, right = min(top + TILE, h), min(left + TILE, w)
            core = (0, ..., slice(top - above, down - above), slice(left - before, right - before))
            out[:, top:down, left:right] = (values.sum(1) / total)[core]
            shares[:, top:down, left:right] = (weights / total)[core]
    return out.permute(1, 2, 0).numpy(), shares.numpy()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--checkpoint", required=True)
    parser.add_argument("--scene", required=True, type=Path)
    parser.add_argument("--independent", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    args = parser.parse_args()
    net, _ = export_network.load(args.checkpoint)
    arrays, exposure = arrays_of(args.picture, args.scene, args.independent)
    picture, shares = combined(net.eval(), arrays)
    channels = {c: np.ascontiguousarray(picture[..., k] / exposure) for k, c in enumerate("RGB")}
    channels |= {f"Share{k + 1}.X": share for k, share in enumerate(shares)}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(args.output))


if __name__ == "__main__":
    main()
