"""The stage: opened, checked, and what all of its prims have in common."""

import math
import os

from pxr import Ar, Gf, Sdf, Tf, Usd, UsdGeom, UsdSkel

from faults import Fault, Losses

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
            self.losses.name(getattr(error, "rootSite", None) and error.rootSite.path or "stage",
                             f"composition: {' '.join(str(error).split())}")
        self.time = self._moment(frame)
        self.metres = UsdGeom.GetStageMetersPerUnit(self.stage)
        if not (math.isfinite(self.metres) and self.metres > 0):
            raise Fault("/", f"metersPerUnit is {self.metres}", "it has to be a number above zero")
        self.by_blender = (self.stage.GetRootLayer().documentation or "").startswith("Blender v4.")
        self.z_up = UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z
        self.to_world = self._axes() * Gf.Matrix4d().SetScale(self.metres)
        self._bake_skins()

    def _moment(self, frame):
        if frame is not None:
            return Usd.TimeCode(frame)
        if self.stage.HasAuthoredTimeCodeRange():
            return Usd.TimeCode(self.stage.GetStartTimeCode())
        return Usd.TimeCode.EarliestTime()

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
                self.losses.name(prim.GetPath(), "the skeleton of an instance is not carried: it stands as it is bound")
            elif not UsdSkel.BakeSkinning(UsdSkel.Root(prim), Gf.Interval(moment, moment)):
                self.losses.name(prim.GetPath(), "its skeleton could not be evaluated: it stands as it is bound")

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
        if not value.resolvedPath:
            # Whether a file outside exists is not told.
            self.check_place(os.path.join(os.path.dirname(self.path), value.path), where)
            raise Fault(where, f"the file {value.path} is not found", "put it where the stage looks for it")
        self.check_place(Ar.SplitPackageRelativePathOuter(name)[0], where)
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(name))
        if opened is None:
            raise Fault(where, f"the file {value.path} cannot be read", "check your right to read it")
        with opened:
            data = bytes(opened.GetBuffer())
        return data, Ar.SplitPackageRelativePathInner(name)[1] or name

    def get(self, attribute, default=None):
        """The value of an attribute at the moment; `default` where it has none."""
        value = attribute.Get(self.time) if attribute else None
        return default if value is None else value


def _first_line(error):
    lines = [line.strip() for line in str(error).splitlines() if "Error" in line or "rror:" in line]
    return (lines or [str(error).strip()])[0]


def said(prim, stage):
    """Keys of `extras.caustique` that a prim's attributes `caustique:KEY` give; a colon stands for what is nested."""
    found = {}
    for attribute in prim.GetAuthoredPropertiesInNamespace("caustique"):
        value = stage.get(attribute) if isinstance(attribute, Usd.Attribute) else None
        if value is None:
            stage.losses.name(prim.GetPath(), f"{attribute.GetName()} has no value and is ignored")
            continue
        *above, key = attribute.GetName().split(":")[1:]
        at = found
        for part in above:
            at = at.setdefault(part, {})
        at[key] = plain(value)
    return found


def plain(value):
    """A value of USD in terms of JSON."""
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Sdf.AssetPath):
        return value.resolvedPath or value.path
    return [plain(part) for part in value]
