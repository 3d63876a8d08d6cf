"""Train a network that combines pictures by equation (5) or (6) on the views of data.py.

  python -m lab.train.train --data DIR --out RUN --minutes 120

A repeated command with the same --out continues, at any time and on another machine; --init starts from another run's
network. Validation uses only held-out views: whole families, and all of scenes/. RUN/log.jsonl has the curves.
export_network.py reads RUN/last.pt. Without a GPU, training runs on the CPU with --threads threads.
"""

import argparse
import json
import math
import time
from pathlib import Path

import numpy as np
import torch

from . import combination, model, views
from .evaluate import validate
from .pairs import PAIRS

DECAY = 0.999  # of the moving average of the weights, which is validated and exported
# Seconds between checkpoints, most seconds between validations, and their least number in a run.
SAVE_SECONDS, VALIDATE_SECONDS, VALIDATIONS = 120, 1200, 4


def relative_loss(image, target):
    """Equation (8): the relative L1 error of log(1 + x)."""
    image, target = (torch.log1p(x.clamp(min=0)) for x in (image, target))
    return ((image - target).abs() / (target.mean(1, keepdim=True) + 0.01)).mean()


def squared_loss(image, target):
    """The relative squared error, compressed where it exceeds 1. With small errors its mean is least at the mean of
    noisy targets, which an absolute error would replace by their median; the denominator must therefore not be the
    target."""
    scale = image.detach().mean(1).square() + 0.01
    return torch.log1p((image - target).square().mean(1) / scale).mean()


def loss_of(net, batch, squared):
    """The loss of a batch (input, y, z, halves)."""
    image, y, z, halves = batch
    combined = combination.combine(net(image), y, z, net.form)
    target = halves.mean(1)
    return (1 - squared) * relative_loss(combined, target) + squared * squared_loss(combined, target)


def moving_average(average, new, count):
    """An exponential moving average, over fewer steps at first, so that it forgets the random initial weights."""
    return torch.lerp(average, new, 1 - min(DECAY, (1 + float(count)) / (10 + float(count))))


def common_arguments(description):
    """A parser of the arguments that all trainers have."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", required=True, type=Path)
    parser.add_argument("--init", help="checkpoint with the initial network")
    parser.add_argument("--out", required=True, type=Path)
    parser.add_argument("--minutes", type=float, default=60, help="minutes of this call")
    parser.add_argument("--steps", type=int, default=40_000, help="steps of the learning-rate schedule")
    parser.add_argument(
        "--seconds", type=float, default=math.inf, help="seconds of the schedule, if it ends before its steps"
    )
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--side", type=int, default=64, help="pixels of a training crop's side")
    parser.add_argument("--rate", type=float, default=5e-4, help="largest learning rate (Adam)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1, help="threads; 0 uses all cores")
    return parser


def arguments():
    parser = common_arguments(__doc__)
    parser.add_argument("--arch", choices=["compact", "paper"], default="compact")
    parser.add_argument("--pairs", choices=list(PAIRS), default="multi")
    parser.add_argument("--version", type=int, help="version of the input (normalise.py); default: the least")
    parser.add_argument("--window", type=int, help="pixels; default: 19 (paper) or 15")
    parser.add_argument("--wide", action="store_true", help="the wide form of the compact network (model.py)")
    parser.add_argument("--methods", nargs="+", default=["sppm", "vcm"], help="methods of the noisy stacks")
    parser.add_argument(
        "--paths", nargs="+", type=int, default=[2], help="camera paths of the noisy stacks: 1, 2 or both"
    )
    parser.add_argument("--squared", type=float, default=0.5, help="weight of the squared error in the loss, 0 to 1")
    return parser.parse_args()


class Run:
    """A training run: network, optimiser and counts, which a checkpoint holds."""

    # Options that belong to a run and are stored with it.
    stored = (
        "arch",
        "pairs",
        "version",
        "window",
        "wide",
        "squared",
        "rate",
        "batch",
        "side",
        "methods",
        "paths",
        "steps",
        "seed",
    )

    def __init__(self, args):
        self.args, self.device = args, "cuda" if torch.cuda.is_available() else "cpu"
        torch.manual_seed(args.seed)
        net = self.build().to(self.device)
        self.net, self.average = net, torch.optim.swa_utils.AveragedModel(net, avg_fn=moving_average)
        self.optimiser = torch.optim.Adam(net.parameters(), lr=args.rate)
        self.step, self.seconds, self.machines, self.losses = 0, 0.0, [], []
        if args.init and not self.file().exists():
            given = torch.load(args.init, map_location=self.device, weights_only=True)
            net.load_state_dict(given["best"])
            self.average.module.load_state_dict(given["best"])
        if self.file().exists():
            self.load()
        if self.device not in self.machines:
            self.machines.append(self.device)

    def build(self):
        """The untrained network."""
        args = self.args
        return model.build(args.arch, args.pairs, args.version, window=args.window, wide=args.wide)

    def loss(self, batch):
        """The loss of a batch."""
        return loss_of(self.net, batch, self.args.squared)

    def validate(self):
        """Figures of the network on held-out views, by name."""
        return validate(self.average.module, self.args.data, self.args.methods, self.args.paths, self.device)

    def description(self):
        """What a checkpoint says of the network and its data."""
        count = len({item[0] for item in views.files(self.args.data, False)})
        return {
            "version": self.net.version,
            "window": self.net.form.window,
            "levels": self.net.levels,
            "data": f"{count} views of {self.args.data.name}",
        }

    def file(self):
        return self.args.out / "last.pt"

    def load(self):
        saved = torch.load(self.file(), map_location=self.device, weights_only=True)
        self.net.load_state_dict(saved["model"])
        self.average.load_state_dict(saved["average"])
        self.optimiser.load_state_dict(saved["optimiser"])
        self.step, self.seconds, self.machines = saved["steps"], saved["seconds"], saved["machines"]

    def save(self):
        state = {name: getattr(self.args, name) for name in self.stored} | self.description()
        state |= {
            "model": self.net.state_dict(),
            "average": self.average.state_dict(),
            "best": self.average.module.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "steps": self.step,
            "schedule": self.args.steps,
            "seconds": self.seconds,
            "machines": self.machines,
        }
        torch.save(state, self.args.out / "last.tmp")
        (self.args.out / "last.tmp").replace(self.file())

    def report(self):
        """Validates, and appends a line to the curves."""
        line = {"step": self.step, "seconds": round(self.seconds), "loss": round(float(np.mean(self.losses or [0])), 5)}
        self.losses.clear()
        line |= self.validate()
        print(json.dumps(line), flush=True)
        with open(self.args.out / "log.jsonl", "a", encoding="utf-8") as log:
            log.write(json.dumps(line) + "\n")

    def progress(self):
        """The finished share of the schedule."""
        return min(max(self.step / self.args.steps, self.seconds / self.args.seconds), 1)

    def train_step(self, pool):
        """One step. The learning rate is a cosine after a short warm-up. Random numbers depend on the step, so a
        resumed run does not repeat crops."""
        args = self.args
        rate = args.rate * min(1, (self.step + 1) / 200) * (0.5 + 0.5 * math.cos(math.pi * self.progress()))
        for group in self.optimiser.param_groups:
            group["lr"] = rate + 1e-6
        batch = pool.batch(np.random.default_rng([args.seed, self.step]), args.batch, args.side, self.net.version)
        loss = self.loss([torch.from_numpy(x).to(self.device) for x in batch])
        self.optimiser.zero_grad()
        loss.backward()
        # A step with a loss that is not finite would destroy the network.
        norm = torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        if torch.isfinite(norm):
            self.optimiser.step()
            self.average.update_parameters(self.net)
            self.losses.append(loss.item())
        self.step += 1


def train(run, pool):
    """Trains until the end of the schedule or of the minutes of this call."""
    args = run.args
    before = run.seconds
    start = saved = time.monotonic()
    between = min(VALIDATE_SECONDS, args.seconds / VALIDATIONS)
    reported = start - between + 120
    while run.progress() < 1 and run.seconds - before < args.minutes * 60:
        run.train_step(pool)
        now = time.monotonic()
        run.seconds = before + now - start
        if now - saved > SAVE_SECONDS:
            run.save()
            saved = now
        if now - reported > between:
            run.report()
            reported = now
    run.save()
    if run.losses:
        run.report()


def prepare(args):
    """Makes the folder of a run, and sets its threads."""
    args.out.mkdir(parents=True, exist_ok=True)
    if args.threads:
        torch.set_num_threads(args.threads)


def main():
    args = arguments()
    prepare(args)
    train(Run(args), views.Pool(args.data, args.methods, args.paths, args.pairs))


if __name__ == "__main__":
    main()
