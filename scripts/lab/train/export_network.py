"""Write a network as ONNX with the metadata that src/combine/model.rs reads.

python -m lab.train.export_network --checkpoint RUN/last.pt -o src/combine/models/compact.onnx
python -m lab.train.export_network --arch compact --seed 1 -o untrained.onnx
"""

import argparse

import onnx
import torch

from . import model
from . import normalise
from .pairs import PAIRS

OPSET = 17


def export(net, path, training):
    net = net.eval().cpu()
    side = 8 * net.stride
    example = torch.zeros(1, normalise.channels(net.levels, net.version), side, side)
    torch.onnx.export(
        net,
        (example,),
        path,
        opset_version=OPSET,
        dynamo=False,
        input_names=["input"],
        output_names=[net.output],
        dynamic_axes={"input": {2: "h", 3: "w"}, net.output: {2: "h", 3: "w"}},
    )
    graph = onnx.load(path)
    facts = {
        "kind": net.form.kind,
        "levels": net.levels,
        "window": net.form.window,
        "features": net.form.features,
        "dilations": ",".join(map(str, net.form.dilations)),
        "identities": ",".join(map(str, net.form.identities)),
        "stride": net.stride,
        "halo": net.halo,
        "normalisation": net.version,
        "pairs": net.pairs,
        "training": training,
    }
    for key, value in facts.items():
        graph.metadata_props.add(key=f"caustique.{key}", value=str(value))
    onnx.checker.check_model(graph)
    onnx.save(graph, path)


def load(path):
    saved = torch.load(path, map_location="cpu", weights_only=True)
    net = model.build(saved["arch"], saved["pairs"], saved["version"], saved["levels"], saved["window"], saved["wide"])
    net.load_state_dict(saved["best"])
    return net, saved


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--checkpoint", help="checkpoint of train.py; without it the network is untrained")
    parser.add_argument("--arch", choices=["compact", "paper"], default="compact")
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
        net, training = model.build(args.arch, args.pairs), "none"
    export(net, args.output, training)
    print(f"{args.output}: {sum(p.numel() for p in net.parameters())} parameters, training: {training}")


if __name__ == "__main__":
    main()
