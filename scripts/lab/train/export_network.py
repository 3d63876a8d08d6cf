"""Write a network as ONNX with the metadata that src/combine/model.rs reads.

python -m lab.train.export_network --checkpoint RUN/last.pt -o src/combine/models/compact.onnx
python -m lab.train.export_network --arch compact --seed 1 -o untrained.onnx
"""

import argparse

import onnx
import torch

from . import finish_model, finish_views
from . import model
from . import normalise
from .pairs import PAIRS

OPSET = 17


def facts(net):
    """The metadata of a network by key."""
    if isinstance(net, finish_model.FinishNet):
        return {"kind": "finish", "version": finish_views.VERSION}
    return {
        "kind": net.form.kind,
        "levels": net.levels,
        "window": net.form.window,
        "features": net.form.features,
        "dilations": ",".join(map(str, net.form.dilations)),
        "identities": ",".join(map(str, net.form.identities)),
        "normalisation": net.version,
        "pairs": net.pairs,
    }


def planes(net):
    """The number of planes of a network's input."""
    if isinstance(net, finish_model.FinishNet):
        return sum(finish_views.PLANES.values())
    return normalise.channels(net.levels, net.version)


def export(net, path, training):
    """Writes a network and its metadata as ONNX."""
    net = net.eval().cpu()
    side = 8 * net.stride
    torch.onnx.export(
        net,
        (torch.ones(1, planes(net), side, side),),
        path,
        opset_version=OPSET,
        dynamo=False,
        input_names=["input"],
        output_names=[net.output],
        dynamic_axes={"input": {2: "h", 3: "w"}, net.output: {2: "h", 3: "w"}},
    )
    graph = onnx.load(path)
    known = facts(net) | {"stride": net.stride, "halo": net.halo, "training": training}
    for key, value in known.items():
        graph.metadata_props.add(key=f"caustique.{key}", value=str(value))
    onnx.checker.check_model(graph)
    onnx.save(graph, path)


def untrained(arch, pairs="multi"):
    """A network with random weights."""
    return finish_model.FinishNet() if arch == "finish" else model.build(arch, pairs)


def load(path):
    """The network of a checkpoint of train.py or finish_train.py, and the checkpoint."""
    saved = torch.load(path, map_location="cpu", weights_only=True)
    if saved["arch"] == "finish":
        net = finish_model.FinishNet(saved["half"], saved["quarter"])
    else:
        known = (saved[key] for key in ("arch", "pairs", "version", "levels", "window", "wide"))
        net = model.build(*known)
    net.load_state_dict(saved["best"])
    return net, saved


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--checkpoint", help="checkpoint of train.py; without it the network is untrained")
    parser.add_argument("--arch", choices=["compact", "paper", "finish"], default="compact")
    parser.add_argument("--pairs", choices=list(PAIRS), default="multi")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", required=True)
    args = parser.parse_args()
    if args.checkpoint:
        net, saved = load(args.checkpoint)
        training = (
            f"{saved['steps']} steps, {saved['seconds']:.0f} s on {', '.join(saved['machines'])}, data {saved['data']}"
        )
    else:
        torch.manual_seed(args.seed)
        net, training = untrained(args.arch, args.pairs), "none"
    export(net, args.output, training)
    print(f"{args.output}: {sum(p.numel() for p in net.parameters())} parameters, training: {training}")


if __name__ == "__main__":
    main()
