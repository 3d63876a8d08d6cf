"""The stage: opened, checked, and what all of its prims have in common."""

import math
import os
import re

from pxr import Ar, Gf, Sdf, Tf, Usd, UsdGeom, UsdSkel

from faults import Fault, Losses, text_of

# Lengths and their squares stay numbers between these.
_LEAST, _MOST = 1e-30, 1e30
# Keys in keys that `caustique:*` may give.
_DEEPEST = 64

PREDICATE = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


class Stage:
    """A stage at a moment: `time`, `stage` (Usd.Stage), `losses`, and the way from its axes and units to glTF's.

    `by_blender`: Blender 4 wrote it, some of whose lights mean other than they say.
    """

    def __init__(self, path, frame=None, allow_outside=False):
        self.path = os.path.abspath(path)
        self.losses = Losses()
        self._folder = None if allow_outside else os.path.realpath(os.path.dirname(self.path))
        try:
            self.stage = Usd.Stage.Open(self.path)
        except Tf.ErrorException as error:
            raise Fault("", f"USD cannot read it: {_first_line(error)}", "export it again; usdchecker may say more")
        for layer in self.stage.GetUsedLayers():
            if layer.realPath:
                self.check_place(layer.realPath, "the stage")
        for error in self.stage.GetCompositionErrors():
            self.losses.add(getattr(error, "rootSite", None) and error.rootSite.path or "stage",
                             f"composition: {text_of(error)}")
        self.time = self._moment(frame)
        # USD's own function refuses a number that is no double.
        said = self.stage.HasAuthoredMetadata("metersPerUnit") and self.stage.GetMetadata("metersPerUnit")
        self.metres = said if isinstance(said, float) else UsdGeom.GetStageMetersPerUnit(self.stage)
        if not _LEAST <= self.metres <= _MOST:
            raise Fault("/", f"metersPerUnit is {self.metres}", "it has to be a number above zero")
        self.by_blender = (self.stage.GetRootLayer().documentation or "").startswith("Blender v4.")
        axis = UsdGeom.GetStageUpAxis(self.stage)
        if axis not in (UsdGeom.Tokens.y, UsdGeom.Tokens.z):
            self.losses.add("/", f"upAxis is {axis}, which is neither Y nor Z: Y is up (turn the stage by a transform)")
        self.z_up = axis == UsdGeom.Tokens.z
        self.to_world = self._axes() * Gf.Matrix4d().SetScale(self.metres)
        self._bake_skins()

    def _moment(self, frame):
        if frame is None and not self.stage.HasAuthoredTimeCodeRange():
            return Usd.TimeCode.EarliestTime()
        moment = self.stage.GetStartTimeCode() if frame is None else frame
        if not math.isfinite(moment):
            raise Fault("/", f"its {'startTimeCode' if frame is None else 'frame'} is {moment}", "give it a number")
        return Usd.TimeCode(moment)

    def _axes(self):
        """From the stage's axes to right-handed ones with y up; row vectors."""
        turn = Gf.Matrix4d(1)
        if self.z_up:
            turn = Gf.Matrix4d(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1)
        return turn

    def _bake_skins(self):
        """Puts what skeletons do to meshes at this moment into their points, in the session layer."""
        roots = [p for p in Usd.PrimRange(self.stage.GetPseudoRoot(), PREDICATE) if p.IsA(UsdSkel.Root)]
        if not roots:
            return
        self.stage.SetEditTarget(self.stage.GetSessionLayer())
        moment = 0.0 if self.time.IsEarliestTime() else self.time.GetValue()
        # What is baked is what has a sample at the moment.
        for prim in Usd.PrimRange(self.stage.GetPseudoRoot()):
            for attribute in prim.GetAttributes() if prim.IsA(UsdSkel.Animation) else ():
                value = attribute.Get(self.time)
                if attribute.ValueMightBeTimeVarying() and value is not None:
                    attribute.Set(value, moment)
        for prim in roots:
            if prim.IsInstanceProxy():
                self.losses.add(prim.GetPath(), "the skeleton of an instance is not carried: it stands as it is bound")
            elif not UsdSkel.BakeSkinning(UsdSkel.Root(prim), Gf.Interval(moment, moment)):
                self.losses.add(prim.GetPath(), "its skeleton could not be evaluated: it stands as it is bound")

    def check_place(self, path, what):
        """Raises where a file lies outside the stage's folder and may not."""
        if self._folder is None or os.path.commonpath([self._folder, os.path.realpath(path)]) == self._folder:
            return
        raise Fault(what, f"the file {path} is outside the scene's folder",
                    "put it beside the scene file and name it so, or allow such files with --allow-outside")

    def asset(self, prim, value):
        """The bytes of the file that an asset-valued attribute names, also inside a package, and its name."""
        name = value.resolvedPath or value.path
        where = prim.GetPath()
        if not value.path:
            raise Fault(where, "it names no file", "give the texture's path in inputs:file")
        if "\0" in name:
            raise Fault(where, f"no file has a name as {value.path!r}", "give the texture's path in inputs:file")
        if not value.resolvedPath:
            # Whether a file outside exists is not told.
            self.check_place(os.path.join(os.path.dirname(self.path), value.path), where)
            raise Fault(where, f"the file {value.path} is not found", "put it where the stage looks for it")
        self.check_place(Ar.SplitPackageRelativePathOuter(name)[0], where)
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(name))
        if opened is None:
            raise Fault(where, f"the file {value.path} cannot be read", "check your right to read it")
        with opened:
            buffer = opened.GetBuffer()
        if buffer is None:
            raise Fault(where, f"the file {value.path} is empty", "write it again")
        data = bytes(buffer)
        return data, Ar.SplitPackageRelativePathInner(name)[1] or name

    def get(self, attribute, default=None):
        """The value of an attribute at the moment; `default` where it has none. It is of the kind that the attribute's
        schema says, and a number or a vector is finite."""
        value = attribute.Get(self.time) if attribute else None
        if value is None:
            return default
        # USD hands on a value as the file says it, whatever the schema says.
        type_ = attribute.GetTypeName()
        if isinstance(value, Sdf.UnregisteredValue) or kind_of(value) != kind_of(type_.defaultValue):
            raise Fault(attribute.GetPrim().GetPath(), f"{attribute.GetName()} is a {_named(value)}, not a {type_}",
                        "give it a value of that type")
        if not finite(value):
            raise Fault(attribute.GetPrim().GetPath(), f"{attribute.GetName()} is {value}, which is not finite",
                        "give it numbers")
        return value


def kind_of(value):
    """What a value of USD is; numbers count as alike whatever their precision is."""
    if isinstance(value, (bool, int, float)):
        return "number"
    name = re.sub(r"^(Vec\d|Matrix\d|Quat)[dfhi]", r"\1", type(value).__name__)
    name = re.sub(r"^(Bool|U?Char|U?Short|U?Int|U?Int64|Half|Float|Double)Array$", "list of numbers", name)
    return {"str": "text", "StringArray": "list of texts", "TokenArray": "list of texts"}.get(name, name)


def _named(value):
    return "value of an unknown type" if isinstance(value, Sdf.UnregisteredValue) else kind_of(value)


def finite(value):
    """Whether a number, vector or matrix, or a tuple of numbers, is finite; true of anything else."""
    if isinstance(value, float):
        return math.isfinite(value)
    if kind_of(value) == "tuple" or re.fullmatch(r"(Vec|Matrix)\d", kind_of(value)):
        return all(finite(part) for part in value)
    return True


def _first_line(error):
    try:
        lines = str(error).splitlines()
    except UnicodeDecodeError:
        return text_of(error)
    return ([line.strip() for line in lines if "Error" in line or "rror:" in line] or [str(error).strip()])[0]


def custom_keys(prim, stage):
    """Keys of `extras.caustique` that a prim's attributes `caustique:KEY` give; a colon stands for what is nested."""
    found = {}
    for attribute in prim.GetAuthoredPropertiesInNamespace("caustique"):
        value = stage.get(attribute) if isinstance(attribute, Usd.Attribute) else None
        if value is None:
            stage.losses.add(prim.GetPath(), f"{attribute.GetName()} has no value and is ignored")
            continue
        *above, key = attribute.GetName().split(":")[1:]
        if len(above) > _DEEPEST:
            stage.losses.add(prim.GetPath(), f"an attribute caustique:* has more than {_DEEPEST} colons: it is "
                              "ignored")
            continue
        at = found
        for part in above:
            at = at.setdefault(part, {}) if isinstance(at, dict) else None
        if not isinstance(at, dict):
            stage.losses.add(prim.GetPath(), f"{attribute.GetName()} is ignored: what it is a part of has a value of "
                              "its own")
            continue
        try:
            at[key] = plain(value)
        except TypeError:
            stage.losses.add(prim.GetPath(), f"{attribute.GetName()} is a {attribute.GetTypeName()} and is ignored")
    return found


def plain(value):
    """A value of USD in terms of JSON."""
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Sdf.AssetPath):
        return value.resolvedPath or value.path
    return [plain(part) for part in value]  # what has no parts, such as a quaternion, raises a TypeError
