"""Train a network that chooses the weights of equation (6).

The loss is equation (8) of [Choi and Moon 2021], an absolute error. Its minimum is a median, so pictures with skewed
noise become too dark. --squared S adds S log(1 + relMSE) of every pixel; the logarithm limits the weight of fireflies.

  python -m lab.train.train --data DIR --out RUN --minutes 60

Each DIR has crops of data.py or synthetic.py, and provides an equal share of a batch. The scenes of --held-out, and
variant 0 of every other scene, are only for validation (with several DIRs, those of the first). Training stops after
--minutes or --steps, whichever comes first. A repeated command with the same --out continues; --init starts from another
run's network. export_network.py reads RUN/last.pt. Without a GPU, training runs on the CPU with --threads threads.
"""

import argparse
import json
import math
import pathlib
import time

import numpy as np
import torch

from . import combination
from . import crops
from . import model
from .evaluate import relmse

DECAY = 0.999  # of the moving average of the weights, which is validated and exported


def loss_of(image, reference):
    """Equation (8): the relative L1 error of log(1 + x)."""
    image, reference = (torch.log1p(x.clamp(min=0)) for x in (image, reference))
    return ((image - reference).abs() / (reference.mean(1, keepdim=True) + 0.01)).mean()


class Data:
    """All crops in memory."""

    def __init__(self, folders, held_out, levels):
        self.train, self.valid, counts = [], [], []
        for number, folder in enumerate(folders):
            scenes = crops.files(folder)
            valid = {file for files in crops.held_out(scenes, held_out).values() for file in files}
            train = [read(file, levels) for files in scenes.values() for file in files if file not in valid]
            if not train or not valid:
                raise SystemExit(f"{folder}: {len(train)} crops to train with, {len(valid)} held out; both are needed")
            self.train.append(train)
            if number == 0:
                self.valid = [read(file, levels) for file in sorted(valid)]
            counts.append(f"{len(train)} crops of {pathlib.Path(folder).name}")
        self.description = " and ".join(counts)

    def batch(self, rng, size, side, device):
        folders = [self.train[i % len(self.train)] for i in range(size)]
        chosen = [augment(items[rng.integers(len(items))], rng, side) for items in folders]
        return [torch.stack(part).to(device) for part in zip(*chosen)]


def read(file, levels):
    item = tuple(torch.from_numpy(np.ascontiguousarray(x)) for x in crops.load(file))
    if len(item[1]) != levels:
        raise SystemExit(f"{file}: {len(item[1])} levels, the network takes {levels}")
    return item


def augment(item, rng, side):
    """A random part of a crop, rotated and mirrored, with permuted colours."""
    h, w = item[0].shape[-2:]
    side = min(side, h, w)
    y, x = rng.integers(h - side + 1), rng.integers(w - side + 1)
    turns, mirror, order = rng.integers(4), rng.random() < 0.5, torch.from_numpy(rng.permutation(3))
    image, levels, reference = item
    m = levels.shape[0]
    channel = torch.cat([(torch.arange(m)[:, None] * 3 + order).flatten(), torch.arange(3 * m, 4 * m)])
    # Albedo is permuted like the colours; permuting the axes of the normal rotates or mirrors it.
    channel = torch.cat([channel, 4 * m + order, 4 * m + 3 + order, torch.tensor([4 * m + 6])])
    out = []
    for part in (image[channel], levels[:, order], reference[order]):
        part = torch.rot90(part[..., y : y + side, x : x + side], int(turns), (-2, -1))
        out.append(part.flip(-1) if mirror else part)
    return out


def moving_average(average, new, count):
    """An exponential moving average, over fewer steps at first, so that it forgets the random initial weights."""
    return torch.lerp(average, new, 1 - min(DECAY, (1 + float(count)) / (10 + float(count))))


def forward(net, batch, squared):
    image, levels, reference = batch
    combined = combination.combine(net(image), levels, net.kind, net.window, net.features)
    loss = loss_of(combined, reference)
    return loss + squared * torch.log1p(relmse(combined, reference)).mean() if squared else loss


@torch.no_grad()
def validate(net, items, device, most=64):
    """The mean loss and relMSE of the combination and of Level1, Level2, ... over at most `most` validation crops."""
    net.eval()
    totals = []
    for item in items[:: max(1, len(items) // most)][:most]:
        image, levels, reference = (x[None].to(device) for x in item)
        image = image[..., : image.shape[-2] // net.stride * net.stride, : image.shape[-1] // net.stride * net.stride]
        levels, reference = (x[..., : image.shape[-2], : image.shape[-1]] for x in (levels, reference))
        combined = combination.combine(net(image), levels, net.kind, net.window, net.features)
        images = [combined, *levels.unbind(1)]
        totals.append(
            [loss_of(x, reference).item() for x in images] + [relmse(x, reference).mean().item() for x in images]
        )
    net.train()
    mean = np.mean(totals, axis=0)
    half = len(mean) // 2
    return {
        "loss": round(float(mean[0]), 5),
        "levels_loss": [round(float(x), 5) for x in mean[1:half]],
        "relmse": round(float(mean[half]), 5),
        "levels_relmse": [round(float(x), 5) for x in mean[half + 1 :]],
    }


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", required=True, nargs="+")
    parser.add_argument("--held-out", nargs="*", default=crops.HELD_OUT, help="scenes that are only for validation")
    parser.add_argument("--init", help="checkpoint with the initial network")
    parser.add_argument("--out", required=True)
    parser.add_argument("--arch", choices=["compact", "paper"], default="compact")
    parser.add_argument("--levels", type=int, default=5)
    parser.add_argument("--window", type=int, default=model.WINDOW)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument(
        "--steps", type=int, default=1_000_000, help="steps of the learning-rate schedule, if --minutes allows them"
    )
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--side", type=int, default=64, help="pixels of a training crop's side")
    parser.add_argument("--squared", type=float, default=0.0, help="weight of log(1 + relMSE) in the loss")
    parser.add_argument("--rate", type=float, default=5e-4, help="largest learning rate (Adam)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=0, help="threads; 0 uses all cores")
    return parser.parse_args()


def main():
    args = arguments()
    out = pathlib.Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    if args.threads:
        torch.set_num_threads(args.threads)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    torch.manual_seed(args.seed)
    net = model.build(args.arch, args.levels, args.window).to(device)
    average = torch.optim.swa_utils.AveragedModel(net, avg_fn=moving_average)
    optimiser = torch.optim.Adam(net.parameters(), lr=args.rate)
    data = Data(args.data, args.held_out, args.levels)
    print(f"{device}; {data.description} to train, {len(data.valid)} to validate")
    step, seconds, before_that = 0, 0.0, ""
    if args.init:
        given = torch.load(args.init, map_location=device, weights_only=True)
        net.load_state_dict(given["best"])
        average.module.load_state_dict(given["best"])
        before_that = f", after {given['steps']} steps on {given['data']}"
    if (out / "last.pt").exists():
        saved = torch.load(out / "last.pt", map_location=device, weights_only=True)
        net.load_state_dict(saved["model"])
        average.load_state_dict(saved["average"])
        optimiser.load_state_dict(saved["optimiser"])
        step, seconds = saved["steps"], saved["seconds"]
    before, start, spoken = seconds, time.monotonic(), time.monotonic()
    recent = []

    def save():
        state = {
            "arch": args.arch,
            "levels": args.levels,
            "window": args.window,
            "model": net.state_dict(),
            "average": average.state_dict(),
            "best": average.module.state_dict(),
            "optimiser": optimiser.state_dict(),
            "steps": step,
            "seconds": seconds,
            "device": device,
            "data": data.description + before_that,
        }
        torch.save(state, out / "last.tmp")
        (out / "last.tmp").replace(out / "last.pt")
        report = {"step": step, "seconds": round(seconds, 1), "train_loss": round(float(np.mean(recent or [0])), 5)}
        report |= validate(average.module, data.valid, device)
        recent.clear()
        print(json.dumps(report), flush=True)
        with open(out / "log.jsonl", "a") as log:
            log.write(json.dumps(report) + "\n")

    while step < args.steps and seconds - before < args.minutes * 60:
        # A cosine over the limit that is closer to its end, after a short warm-up. Random numbers depend on the step, so
        # a resumed run does not repeat crops.
        progress = max(step / args.steps, (seconds - before) / (args.minutes * 60))
        for group in optimiser.param_groups:
            group["lr"] = args.rate * min(1, (step + 1) / 100) * (0.5 + 0.5 * math.cos(math.pi * progress)) + 1e-6
        rng = np.random.default_rng([args.seed, step])
        loss = forward(net, data.batch(rng, args.batch, args.side, device), args.squared)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        average.update_parameters(net)
        recent.append(loss.item())
        step += 1
        seconds = before + time.monotonic() - start
        if time.monotonic() - spoken > 180:
            save()
            spoken = time.monotonic()
    save()


if __name__ == "__main__":
    main()
