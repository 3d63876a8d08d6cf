"""Converts cameras: lens, aperture and focus (UsdGeomCamera), conformed to the picture's aspect ratio (UsdRender)."""

import math

from pxr import UsdGeom

from stage import custom_keys

# Attributes with the schema's defaults, which USD does not return for a blocked attribute (`= None`).
_DEFAULTS = (("horizontalAperture", 20.955), ("verticalAperture", 15.2908), ("focalLength", 50.0))


def node(prim, stage, document, aspect=None, policy="expandAperture", lens=True):
    """The glTF node of a camera. `aspect`: width over height of the picture, None if unknown."""
    camera, where, get = UsdGeom.Camera(prim), prim.GetPath(), stage.get
    # In tenths of the stage's unit.
    width, height, focal = (float(get(camera.GetPrim().GetAttribute(name), default)) for name, default in _DEFAULTS)
    if not all(math.isfinite(x) and x > 0 for x in (width, height, focal)):
        stage.losses.add(where, f"its apertures are {width:g} and {height:g}, its focal length {focal:g}, which are not all "
                          "above zero: the defaults are taken")
        width, height, focal = (default for _, default in _DEFAULTS)
    offsets = [float(get(a, 0.0)) for a in (camera.GetHorizontalApertureOffsetAttr(),
                                            camera.GetVerticalApertureOffsetAttr())]
    if aspect is not None:
        width, height = _conform(width, height, aspect, policy)
    if aspect is None:
        aspect = width / height
    unit = stage.metres / 10
    if get(camera.GetProjectionAttr()) == UsdGeom.Tokens.orthographic:
        entry = {"type": "orthographic", "orthographic": {"xmag": width * unit / 2, "ymag": height * unit / 2,
                                                          "znear": 0.0, "zfar": 1e6}}
    else:
        entry = {"type": "perspective", "perspective": {"yfov": 2 * math.atan(height / (2 * focal)),
                                                        "aspectRatio": width / height, "znear": 1e-3}}
    keys = {}
    if any(offsets):
        keys["shift"] = [offsets[0] / width, offsets[1] / height]
    stop = get(camera.GetFStopAttr(), 0.0)
    focus = get(camera.GetFocusDistanceAttr(), 0.0) if stop > 0 else 0.0
    if stop > 0 and focus > 0 and lens:
        keys.update(aperture_radius=focal * unit / (2 * stop), focus_distance=focus * stage.metres)
    elif stop > 0 and lens:
        stage.losses.add(where, "it has an fStop and no focusDistance: everything is sharp")
    if get(camera.GetClippingPlanesAttr()):
        stage.losses.add(where, "clippingPlanes are not carried: nothing is cut away")
    role = get(camera.GetStereoRoleAttr())
    if role in ("left", "right"):
        stage.losses.add(where, f"it is the {role} one of a pair, of which each is rendered by itself")
    keys.update(custom_keys(prim, stage))
    if keys:
        entry["extras"] = {"caustique": keys}
    return {"camera": document.add("cameras", {"name": str(where), **entry})}


def _conform(width, height, aspect, policy):
    """The aperture conformed to the picture's aspect ratio (UsdRenderSettingsBase, aspectRatioConformPolicy)."""
    wide = aspect > width / height
    by_width = {"adjustApertureWidth": True, "expandAperture": wide, "cropAperture": not wide}
    if by_width.get(policy, False):
        return height * aspect, height
    return width, width / aspect


def shutter(prim, stage):
    """The times at which the shutter of a camera opens and closes, relative to the frame; None if nothing moves then."""
    camera, get = UsdGeom.Camera(prim), stage.get
    times = [float(get(a, 0.0)) for a in (camera.GetShutterOpenAttr(), camera.GetShutterCloseAttr())]
    if times[0] >= times[1] or not stage.moves():
        return None
    if not stage.has_frame:
        stage.losses.add(prim.GetPath(), "its shutter is ignored, because no frame is given (--frames gives one)")
        return None
    return times


def exposure(prim, stage):
    """The exposure of a camera in stops."""
    camera = UsdGeom.Camera(prim)
    scale = camera.ComputeLinearExposureScale(stage.time)
    if not math.isfinite(scale):
        stage.losses.add(prim.GetPath(), f"its exposure brightens by {scale}: it is ignored")
        return 0.0
    return math.log2(scale) if scale > 0 and scale != 1 else 0.0
