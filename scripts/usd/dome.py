"""Converts dome lights to the scene's environment."""

import math
import os

import numpy
import OpenEXR
from pxr import Gf

import textures
from faults import Fault, Invalid
from lights import Light
from stage import custom_keys, kind_of


class Dome:
    """The environment from the first dome light of a stage, and the colours of further ones."""

    def __init__(self, stage, folder):
        self._stage, self._folder = stage, folder
        self.keys = None

    def add(self, prim, matrix):
        """Add a dome light with the transform `matrix` (in glTF's axes)."""
        light = Light(prim, self._stage)
        if light.cone() is not None:
            light.add_loss("shaping of a dome light is not carried: it shines from everywhere")
        asset = light.get("texture:file", None)
        plain = asset is None or not asset.path
        if self.keys is not None:
            if plain and "color" in self.keys and kind_of(self.keys["color"]) == "list":
                self.keys["color"] = [a + b for a, b in zip(self.keys["color"], light.emitted())]
            else:
                light.add_loss("a second dome light is not carried: it gives no light")
            return
        if light.normalized:
            light.add_loss("inputs:normalize says nothing of a dome light")
        self.keys = {"color": list(light.emitted())}
        try:
            self.keys = self.keys if plain else self._image(light, asset, matrix)
        except Invalid as invalid:
            light.add_loss(f"{invalid.fault}: it shines with its colour alone")
        self.keys.update(custom_keys(prim, self._stage))

    def _image(self, light, asset, matrix):
        format_ = light.get("texture:format", "automatic")
        if format_ not in ("automatic", "latlong"):
            light.add_loss(f"a texture of format {format_} is read as latlong")
        data, name = self._stage.asset(light.prim, asset)
        emitted = light.emitted()
        pole = light.prim.GetAttribute("poleAxis")
        axis = self._stage.get(pole, "Y") if pole else "Y"
        if axis == "Z" or (axis == "scene" and self._stage.z_up):
            matrix = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), 90)) * matrix
        turn = numpy.array([[*matrix.TransformDir(Gf.Vec3d(*row)).GetNormalized()] for row in numpy.eye(3)])
        upright = abs(turn[1, 1] - 1) < 1e-6 and numpy.linalg.det(turn) > 0
        grey = max(emitted) - min(emitted) <= 1e-6 * max(emitted)
        suffix = os.path.splitext(name)[1].lower()
        if suffix == ".hdr" and not (upright and grey):
            light.add_loss("a tilted or coloured dome with a Radiance HDR is not carried so: save its image as OpenEXR")
            upright, grey = True, True
        if suffix in (".hdr", ".exr") and upright and grey:
            # In USD the image's centre is at +Z; a positive rotation about +Y turns +Z to +X.
            degrees = math.degrees(math.atan2(turn[2, 0], turn[2, 2])) - 90
            return {"file": self._written("environment" + suffix, data), "rotation_deg": degrees,
                    "strength": max(emitted)}
        return {"file": self._baked(light, data, name, turn, emitted), "rotation_deg": 0.0}

    def _baked(self, light, data, name, turn, emitted):
        """Write the image rotated to glTF's axes and tinted, as an OpenEXR file. Returns its name."""
        texels, bits = textures.read(data, name, light.where)
        texels = texels[:, :, :3] if texels.shape[2] >= 3 else numpy.repeat(texels[:, :, :1], 3, axis=2)
        texels = textures.from_srgb(texels) if bits == 8 else texels
        height, width = texels.shape[:2]
        # Mapping of caustique: u = 1/2 + atan2(z, x) / 2 pi, v = acos(y) / pi.
        phi = ((numpy.arange(width) + 0.5) / width - 0.5) * 2 * math.pi
        theta = (numpy.arange(height) + 0.5) / height * math.pi
        sin, cos = (f(theta)[:, None] for f in (numpy.sin, numpy.cos))
        out = numpy.stack([sin * numpy.cos(phi), numpy.repeat(cos, width, 1), sin * numpy.sin(phi)], axis=2)
        local = out @ turn.T
        # Mapping of OpenEXR: centre at +Z, longitude increases to the left.
        u = 0.5 - numpy.arctan2(local[:, :, 0], local[:, :, 2]) / (2 * math.pi)
        v = numpy.arccos(numpy.clip(local[:, :, 1], -1, 1)) / math.pi
        seen = _bilinear(texels, u * width - 0.5, v * height - 0.5) * numpy.array(emitted)
        path = os.path.join(self._folder, "environment.exr")
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": seen.astype(numpy.float32)}).write(path)
        return "environment.exr"

    def _written(self, name, data):
        try:
            with open(os.path.join(self._folder, name), "wb") as file:
                file.write(data)
        except OSError as error:
            raise Fault(self._folder, str(error), "make room there")
        return name


def _bilinear(texels, x, y):
    """Bilinear lookup of texels (height, width, 3) at pixel coordinates; the image repeats horizontally."""
    height, width = texels.shape[:2]
    left, top = numpy.floor(x).astype(int), numpy.floor(y).astype(int)
    a, b = (x - left)[:, :, None], (y - top)[:, :, None]
    rows = [numpy.clip(top + k, 0, height - 1) for k in (0, 1)]
    upper, lower = (texels[row, left % width] * (1 - a) + texels[row, (left + 1) % width] * a for row in rows)
    return upper * (1 - b) + lower * b


def is_dome(prim):
    """Whether a prim is a DomeLight or a DomeLight_1."""
    return prim.GetTypeName() in ("DomeLight", "DomeLight_1")
