"""Write src/combine/testdata/contract.f32, with which tests compare the combiners of Rust and Python.

Its content is little-endian float32: m, h, w, F, K; the stack (levels, variances, albedo, normal, depth); the network's
input; random features and the result of equation (6) with them (window 15); the shipped network's image; then, for the
top left h/2 x w/2 pixels, random explicit weights of a window of K and the result of equation (6) with them.
"""

import argparse

import numpy as np
import torch

from . import combination
from . import export_network
from . import model
from . import normalise
from ..record import ROOT

TARGET = ROOT / "src" / "combine" / "testdata" / "contract.f32"
H, W, K = 16, 22, 5


def random_stack(rng, levels=5):
    """A random stack with noise and some background."""
    mean = np.exp(rng.normal(0, 1, (H, W, 3)))
    scale = 0.5 * 2.0 ** -np.arange(levels)[:, None, None, None]
    stack = {
        "levels": mean * np.exp(rng.normal(0, 1, (levels, H, W, 3)) * scale),
        "variances": (mean * scale) ** 2,
        "albedo": rng.uniform(0, 1, (H, W, 3)),
        "normal": rng.normal(0, 0.5, (H, W, 3)),
        "depth": np.where(rng.random((H, W)) < 0.1, 1e10, np.exp(rng.normal(0, 1, (H, W)))),
    }
    return {key: value.astype(np.float32) for key, value in stack.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--checkpoint", help="checkpoint of the shipped network; without it, the untrained network of export_network.py"
    )
    args = parser.parse_args()
    crop = random_stack(np.random.default_rng(7))
    if args.checkpoint:
        net, _ = export_network.load(args.checkpoint)
    else:
        torch.manual_seed(1)
        net = model.build("compact")
    net.eval()
    torch.manual_seed(2)
    m, f = net.levels, net.form.features
    levels = torch.from_numpy(crop["levels"]).permute(0, 3, 1, 2)[None].double()
    y, z = levels[:, :1].expand(-1, m - 1, -1, -1, -1), levels[:, 1:]
    image = normalise.tensor(crop)
    features = torch.randn(1, (m - 1) * (f + 3), H, W)
    features[:, -(m - 1) :] -= 3.0  # falloffs of about 0.05
    expected = combination.combine(features.double(), y, z, combination.Form("features", model.WINDOW, f))
    with torch.no_grad():
        padded = torch.nn.functional.pad(torch.from_numpy(image)[None], [0, -W % net.stride, 0, -H % net.stride])
        output = net(padded)[..., :H, :W].double()
        network = combination.combine(output, y, z, net.form)
    h, w = H // 2, W // 2
    weights = torch.randn(1, (m - 1) * K * K, h, w).exp()
    kernel = combination.combine(weights.double(), y[..., :h, :w], z[..., :h, :w], combination.Form("weights", K))
    rgb = lambda x: x[0].permute(1, 2, 0).numpy()
    parts = [np.array([m, H, W, f, K]), *(crop[k] for k in ("levels", "variances", "albedo", "normal", "depth"))]
    parts += [image, features.numpy(), rgb(expected), rgb(network), weights.numpy(), rgb(kernel)]
    data = np.concatenate([np.asarray(p, "<f4").ravel() for p in parts])
    data.astype("<f4").tofile(TARGET)
    print(f"{TARGET}: {data.nbytes} bytes")


if __name__ == "__main__":
    main()
