"""Reads UsdRender settings: the picture, and options of `render` from `caustique:*` attributes."""

import fractions
import json
import math
import pathlib

from pxr import UsdGeom, UsdRender

from faults import Fault
from stage import custom_keys

# Keys of the scene's `extras.caustique`. All other `caustique:` attributes of the settings are options of `render`.
SCENE_KEYS = {"environment", "medium", "light_units", "exposure", "tonemap", "contrast", "film_transparent", "frame", "frame_rate",
              "shutter"}
# Options allowed in a stage: about the picture, without files and permissions, because a stage may come from an
# untrusted source. scripts/generate.sh writes the list from the program's definition of options.
OPTIONS = frozenset(json.loads(pathlib.Path(__file__).with_name("options.json").read_text("utf-8"))["files_may_give"])
# {sourceName of a RenderVar: layer}
LAYERS = {
    "ci": "beauty", "color": "beauty", "rgba": "beauty", "beauty": "beauty", "lpe:c.*[<l.>o]": "beauty",
    "albedo": "albedo", "diffusealbedo": "albedo", "n": "normal", "normal": "normal", "nn": "normal",
    "depth": "depth", "z": "Z", "cameradepth": "Z", "p": "P", "position": "P",
}
# The program's table of layers; tests/generated.rs writes the file.
TABLE = json.loads(pathlib.Path(__file__).with_name("layers.json").read_text("utf-8"))


class Settings:
    """The RenderSettings of a stage, from its metadata or else the first prim, and their first product."""

    def __init__(self, stage):
        self._stage, self.prim, self.product, self.products = stage, None, None, ()
        named = UsdRender.Settings.GetStageRenderSettings(stage.stage)
        found = [named.GetPrim()] if named else [p for p in stage.stage.Traverse() if p.IsA(UsdRender.Settings)]
        if not found:
            return
        self.prim = found[0]
        if len(found) > 1:
            stage.losses.add(self.prim.GetPath(), "the stage has several RenderSettings and names none as its own: "
                              "these are taken")
        products = [stage.stage.GetPrimAtPath(p) for p in UsdRender.Settings(self.prim).GetProductsRel().GetTargets()]
        self.products = [p for p in products if p and p.IsA(UsdRender.Product)]
        self.product = self.products[0] if self.products else None
        for other in self.products[1:]:
            stage.losses.add(other.GetPath(), "only the first product is rendered: make RenderSettings with this product "
                              "alone")
        self._warn()

    def get(self, name, default=None):
        """A value of the product, or of the settings if the product has none."""
        for prim in (self.product, self.prim):
            attribute = prim.GetAttribute(name) if prim else None
            if attribute and attribute.HasAuthoredValue():
                return self._stage.get(attribute, default)
        return default

    def camera(self):
        """The path of the camera prim that the RenderSettings name, or None."""
        for prim in (self.product, self.prim):
            targets = prim.GetRelationship("camera").GetForwardedTargets() if prim else ()
            if targets:
                found = self._stage.stage.GetPrimAtPath(targets[0])
                if found and found.IsA(UsdGeom.Camera):
                    return targets[0]
                # Viewers leave settings with cameras of their session layer behind.
                self._stage.losses.add(prim.GetPath(), f"its camera {targets[0]} is not there: the first of the stage is "
                                        "taken")
        return None

    def purposes(self):
        """The purposes of UsdGeom prims (such as "default" and "render") that the RenderSettings include."""
        found = self.get("includedPurposes")
        return {"default", "render"} if found is None else {"default", *found}

    def lens(self):
        """Whether cameras have depth of field."""
        return not self.get("disableDepthOfField", False)

    def blurs(self):
        """Whether the stage asks for motion blur."""
        return not self.get("disableMotionBlur", False)

    def aspect(self):
        """Aspect ratio of the displayed picture, or None."""
        resolution = self._resolution()
        if resolution is None:
            return None
        pixel = self.get("pixelAspectRatio", 1.0)
        if pixel <= 0:
            self._stage.losses.add(self.prim.GetPath(), f"its pixelAspectRatio is {pixel}: it is ignored")
            pixel = 1.0
        return resolution[0] / resolution[1] * pixel

    def _resolution(self):
        """Width and height of the picture, or None."""
        resolution = self.get("resolution")
        if resolution is not None and min(resolution) < 1:
            self._stage.losses.add(self.prim.GetPath(), f"its resolution is {resolution}: it is ignored")
            return None
        return resolution

    def policy(self):
        """The policy that conforms a camera to the picture's aspect ratio."""
        return self.get("aspectRatioConformPolicy", "expandAperture")

    def keys(self):
        """Keys for the scene's `extras.caustique`."""
        out = {"light_units": "radiometric"}
        resolution = self._resolution()
        if resolution is not None:
            out["resolution"] = [int(resolution[0]), int(resolution[1])]
        window = self.get("dataWindowNDC")
        crop = self._crop(window) if window is not None and tuple(window) != (0, 0, 1, 1) else None
        if crop:
            out["crop"] = crop
        rate = self._stage.stage.GetTimeCodesPerSecond()
        if not math.isfinite(rate):
            self._stage.losses.add("/", f"timeCodesPerSecond is {rate}: it is taken as 24")
            rate = 24.0
        rate = fractions.Fraction(f"{rate:.6g}")
        if rate > 0:
            out["frame_rate"] = [rate.numerator, rate.denominator]
        if not self._stage.time.IsEarliestTime() and not self._stage.time.IsDefault():
            out["frame"] = round(self._stage.time.GetValue())
        out.update((key, value) for key, value in self._attributes().items() if key in SCENE_KEYS)
        return out

    def _crop(self, window):
        """Convert (xmin, ymin, xmax, ymax) from the bottom left to left, top, width and height; None if it is empty."""
        left, low, right, high = window
        inside = [min(max(x, 0.0), 1.0) for x in (left, low, right, high)]
        if inside != [left, low, right, high]:
            self._stage.losses.add(self.prim.GetPath(), "its dataWindowNDC reaches beyond the picture: it is cut there")
        left, low, right, high = inside
        if right <= left or high <= low:
            self._stage.losses.add(self.prim.GetPath(), "its dataWindowNDC is empty: it is ignored")
            return None
        return [left, 1 - high, right - left, high - low]

    def arguments(self):
        """Options of `caustique render` from the settings.

        First an output for each product if any has a name ("" for one without), then the layers of the RenderVars and
        the options of `caustique:*`.
        """
        names = [self._stage.get(UsdRender.Product(p).GetProductNameAttr(), "") for p in self.products]
        out = [f"--output={name}" for name in names] if any(names) else []
        layers = self._layers()
        if layers:
            out.append("--layers=" + ",".join(layers))
        for key, value in self._attributes().items():
            if key in SCENE_KEYS:
                continue
            option = "--" + key.replace("_", "-")
            if key not in OPTIONS or isinstance(value, dict):
                raise Fault(self.prim.GetPath(), f"caustique:{key} is nothing that a stage may say of its render",
                            f"give {option} on the command line, if there is such an option")
            if value is False:
                continue
            text = ",".join(map(_number, value)) if isinstance(value, list) else _number(value)
            out.append(option if value is True else f"{option}={text}")
        return out

    def _attributes(self):
        return custom_keys(self.prim, self._stage) if self.prim else {}

    def _layers(self):
        """Layers of the product's RenderVars. Unknown ones are losses."""
        targets = UsdRender.Product(self.product).GetOrderedVarsRel().GetTargets() if self.product else ()
        found = []
        for target in targets:
            var = self._stage.stage.GetPrimAtPath(target)
            name = self._stage.get(var.GetAttribute("sourceName"), "") if var else ""
            ours = name in TABLE["layers"] or name.startswith(tuple(TABLE["groups"]))
            layer = LAYERS.get(name.lower(), name if ours else None)
            if layer is None:
                self._stage.losses.add(target, f'there is no layer for the RenderVar\'s sourceName "{name}"')
            elif layer not in found:
                found.append(layer)
        return found

    def _warn(self):
        where, add_loss = self.prim.GetPath(), self._stage.losses.add
        if self.get("pixelAspectRatio", 1.0) != 1.0:
            add_loss(where, "pixels that are not square are not carried")
        space = self.get("renderingColorSpace")
        if space and space not in ("lin_rec709", "lin_rec709_scene"):
            add_loss(where, f"renderingColorSpace {space} is not carried: colours are linear Rec. 709")
        if self.product and self.get("productType", "raster") != "raster":
            add_loss(self.product.GetPath(), "a product that is no raster is rendered as one")
        if self.product and UsdRender.Product(self.product).GetProductNameAttr().ValueMightBeTimeVarying():
            add_loss(self.product.GetPath(), "its productName changes with time: the first is taken: write #### where the "
                 "frame's number belongs, or give -o")


def _number(value):
    return f"{value:.9g}" if isinstance(value, float) else str(value)
