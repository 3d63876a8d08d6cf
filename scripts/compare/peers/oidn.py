#!/usr/bin/env python3
"""Denoises one picture with Intel OIDN: oidn.py IN.exr OUT.exr THREADS. Needs pyoidn (scripts/compare/setup.sh peers).

IN.exr has R G B and optionally albedo and normal, which are treated as noise-free. Prints the seconds of the filter.
"""

import sys
import time

import numpy as np
import OpenEXR
import pyoidn


def interleave(channels, names):
    """Three channels interleaved, as OIDN expects."""
    return np.ascontiguousarray(
        np.stack([np.nan_to_num(channels[name].pixels, posinf=0, neginf=0) for name in names], -1), np.float32
    )


def denoise(channels, threads):
    """The denoised picture, and the seconds of the filter."""
    images = {"color": interleave(channels, "RGB")}
    if "albedo.R" in channels and "normal.X" in channels:
        images["albedo"] = interleave(channels, ["albedo.R", "albedo.G", "albedo.B"])
        images["normal"] = interleave(channels, ["normal.X", "normal.Y", "normal.Z"])
    height, width, _ = images["color"].shape
    images["output"] = np.zeros_like(images["color"])
    start = time.perf_counter()
    with pyoidn.Device() as device:
        device.set_int("numThreads", threads)
        device.commit()
        with pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT) as network:
            for name, image in images.items():
                network.set_image(
                    getattr(pyoidn, f"OIDN_IMAGE_{name.upper()}"), image, pyoidn.OIDN_FORMAT_FLOAT3, width, height
                )
            network.set_bool("hdr", True)
            network.set_bool("cleanAux", "albedo" in images)
            network.set_int("quality", pyoidn.OIDN_QUALITY_HIGH)
            network.commit()
            network.execute()
        fault = device.get_error()
    if fault:
        sys.exit(f"OIDN: {fault}")
    return images["output"], time.perf_counter() - start


def main():
    source, target, threads = sys.argv[1:]
    with OpenEXR.File(source, separate_channels=True) as file:
        picture, seconds = denoise(file.channels(), int(threads))
    channels = {name: np.ascontiguousarray(picture[..., i]) for i, name in enumerate("RGB")}
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(target)
    print(f"{seconds:.3f}")


if __name__ == "__main__":
    main()
