"""Write src/finish/testdata: finish.onnx, a tiny network of the finish, and finish.f32, with which tests compare the
input planes and the output of Rust and Python.

python -m lab.train.finish_fixture

The content of finish.f32 is little-endian float32: h, w, the number of iterations; the planes [h, w] of the channels
CHANNELS, whose beauty is the picture denoised with its parts, and Whole the one without; the input planes of the
network; and its picture [h, w, 3], in units of the channels.
"""

import numpy as np

from . import data, finish_data, finish_views, normalise, views
from ..record import ROOT

FOLDER = ROOT / "src" / "finish" / "testdata"
H, W, ITERATIONS = 13, 18, 9
COLOURS = ("", "Noisy", "Variance1", *(f"Quarter{k + 1}" for k in range(4)), "albedo")
COLOURS += ("Emission", "Direct", "Caustic", "Whole")
CHANNELS = [f"{layer}.{c}".lstrip(".") for layer in COLOURS for c in "RGB"]
CHANNELS += ["normal.X", "normal.Y", "normal.Z", "depth.Z", "A"]
INPUTS = sum(finish_views.PLANES.values())
# Stride, and radius of the input pixels that a pixel depends on.
STRIDE, HALO = 2, 4
# Added to the picture, where tests find its bytes and replace it.
OFFSET = np.float32(1e-30)


def channels(rng):
    """The channels of a random picture: row 0 is exact, row 1 black and empty, row 2 background; a pixel has unknown
    noise, and one is not finite."""
    picture = {name: rng.uniform(0.1, 1, (H, W)).astype(np.float32) for name in CHANNELS}
    picture["A"][:], picture["A"][1], picture["depth.Z"][2] = 1, 0, 1e10
    picture["depth.Z"] *= 7
    for c in "RGB":
        picture[f"Noisy.{c}"] *= 5
        picture[f"Noisy.{c}"][1], picture[f"Variance1.{c}"][:2] = 0, 0
        picture[f"Variance1.{c}"][3:8] *= 0.01
        picture[f"Variance1.{c}"][5, 5] = -1
        for denoised in (picture[c], picture[f"Whole.{c}"]):
            denoised *= 5
            denoised[:2] = picture[f"Noisy.{c}"][:2]
        picture[f"Direct.{c}"][9, 9] = np.nan
    return picture


def planes(picture):
    """The input [planes, h, w] of the network for a picture, as for training."""
    mean = data.rgb(picture, "Noisy")
    note = {"exposure": float(normalise.exposure(mean[None])), "depth": normalise.median_depth(picture["depth.Z"])}
    note["parts"] = [part for part in finish_data.PARTS if f"{part}.R" in picture]
    arrays = {key: value[None] for key, value in finish_data.stack(picture | {"iterations": ITERATIONS}, note).items()}
    arrays |= {"iterations": np.array([ITERATIONS]), "halves": np.zeros((2, H, W, 3), np.float32)}
    arrays["clean"] = arrays["halves"][0]
    image, _, _ = finish_views.sample(views.snapshot(arrays, 0))
    return image, note["exposure"]


def network(rng):
    """A network of two convolutions at half resolution, which weighs the estimate against the denoised picture."""
    from onnx import TensorProto, checker, helper, numpy_helper

    constant = lambda name, value: numpy_helper.from_array(np.asarray(value), name)
    # Start, end and axis of planes.
    bounds = lambda name, *of: [constant(f"{name}{k}", np.array([value], np.int64)) for k, value in enumerate((*of, 1))]
    weights = [rng.normal(0, 0.1, shape).astype(np.float32) for shape in ((6, INPUTS, 3, 3), (4, 6, 3, 3))]
    initial = [constant("first", weights[0]), constant("second", 3 * weights[1]), constant("offset", OFFSET[None])]
    initial += bounds("mean", 0, 3) + bounds("denoised", 3, 6)
    node = helper.make_node
    nodes = [
        node("Conv", ["input", "first"], ["half"], pads=[1] * 4, strides=[2, 2]),
        node("Tanh", ["half"], ["seen"]),
        node("Conv", ["seen", "second"], ["logits"], pads=[1] * 4),
        node("DepthToSpace", ["logits"], ["logit"], blocksize=2),
        node("Sigmoid", ["logit"], ["weight"]),
        node("Slice", ["input", "mean0", "mean1", "mean2"], ["mean"]),
        node("Slice", ["input", "denoised0", "denoised1", "denoised2"], ["denoised"]),
        node("Sub", ["mean", "denoised"], ["difference"]),
        node("Mul", ["weight", "difference"], ["step"]),
        node("Add", ["denoised", "step"], ["mixed"]),
        node("Add", ["mixed", "offset"], ["picture"]),
    ]
    image = lambda name, channels: helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, "h", "w"])
    graph = helper.make_graph(nodes, "finish", [image("input", INPUTS)], [image("picture", 3)], initial)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    known = {"kind": "finish", "version": finish_views.VERSION, "stride": STRIDE, "halo": HALO, "training": "none"}
    for key, value in known.items():
        model.metadata_props.add(key=f"caustique.{key}", value=str(value))
    checker.check_model(model)
    return model


def content():
    """The bytes of both files by name."""
    from onnx.reference import ReferenceEvaluator

    rng = np.random.default_rng(11)
    picture, model = channels(rng), network(rng)
    image, exposure = planes(picture)
    padded = np.pad(image, [(0, 0), (0, -H % STRIDE), (0, -W % STRIDE)])[None]
    (output,) = ReferenceEvaluator(model).run(None, {"input": padded})
    output = np.moveaxis(output[0, :, :H, :W], 0, -1) / np.float32(exposure)
    parts = [np.array([H, W, ITERATIONS]), *(picture[name] for name in CHANNELS), image, output]
    numbers = np.concatenate([np.asarray(part, "<f4").ravel() for part in parts])
    return {"finish.f32": numbers.tobytes(), "finish.onnx": model.SerializeToString()}


def stored():
    """The channels and the input planes in finish.f32."""
    numbers = np.fromfile(FOLDER / "finish.f32", "<f4")[3:].reshape(-1, H, W)[: len(CHANNELS) + INPUTS]
    return dict(zip(CHANNELS, numbers)), numbers[len(CHANNELS) :]


def main():
    for name, written in content().items():
        (FOLDER / name).write_bytes(written)
        print(f"{FOLDER / name}: {len(written)} bytes")


if __name__ == "__main__":
    main()
