"""Opens and checks a stage, and reads its attributes and assets."""

import math
import os
import re

from pxr import Ar, Gf, Sdf, Tf, Usd, UsdGeom, UsdSkel

from dependencies import check_regular, named_files, open_layers, outer_file
from faults import Fault, Invalid, Losses, check_pointer, text_of
from links import Links

# Limits of metersPerUnit within which squared lengths neither underflow nor overflow.
_MIN_METRES, _MAX_METRES = 1e-30, 1e30
_DEFAULT_METRES = 0.01  # USD's
# Deepest nesting of `caustique:*` keys.
_MAX_DEPTH = 64

PREDICATE = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)


class Stage:
    """A stage at a time code: `time`, `stage` (Usd.Stage), `losses`, and the transform from its axes and units to
    glTF's.

    `has_frame`: whether the time code was given; `by_blender`: whether Blender 4 wrote it, which exports some lights with
    wrong values.
    """

    def __init__(self, path, frame=None, allow_outside=False):
        self.path = os.path.abspath(path)
        self.losses = Losses()
        self._folder = None if allow_outside else os.path.realpath(os.path.dirname(self.path))
        layers = open_layers(self.path, self.check_path)
        _check_pointer_file(self.path, "")
        try:
            self.stage = Usd.Stage.Open(layers[0] if layers else self.path)
        except Tf.ErrorException as error:
            raise Fault("", f"USD cannot read it: {_first_line(error)}", "export it again; usdchecker may say more")
        self.links = Links(self.stage)
        # The files that the stage is read from or names, as absolute paths.
        self.files = {self.path}
        for layer in self.stage.GetUsedLayers():
            if layer.realPath:
                file = outer_file(layer.realPath)
                self.check_path(file, "the stage")
                self.files |= {file, *named_files(layer)}
        for error in self.stage.GetCompositionErrors():
            layer = re.search("@([^@]+)@", text_of(error))
            if layer and self._allows(layer[1]):
                _check_pointer_file(layer[1], layer[1])
            self.losses.add(getattr(error, "rootSite", None) and error.rootSite.path or "stage",
                             f"composition: {text_of(error)}")
        self.has_frame = frame is not None
        self.time = self._time_code(frame)
        # UsdGeom.GetStageMetersPerUnit fails for a value that is not a double.
        said = self.stage.HasAuthoredMetadata("metersPerUnit") and self.stage.GetMetadata("metersPerUnit")
        self.metres = said if isinstance(said, float) else UsdGeom.GetStageMetersPerUnit(self.stage)
        if not _MIN_METRES <= self.metres <= _MAX_METRES:
            self.losses.add("/", f"metersPerUnit is {self.metres}, which is no number above zero: it is taken as "
                             f"{_DEFAULT_METRES}")
            self.metres = _DEFAULT_METRES
        self.by_blender = (self.stage.GetRootLayer().documentation or "").startswith("Blender v4.")
        axis = UsdGeom.GetStageUpAxis(self.stage)
        if axis not in (UsdGeom.Tokens.y, UsdGeom.Tokens.z):
            self.losses.add("/", f"upAxis is {axis}, which is neither Y nor Z: Y is up (turn the stage by a transform)")
        self.z_up = axis == UsdGeom.Tokens.z
        self.to_world = self._axes() * Gf.Matrix4d().SetScale(self.metres)
        self._bake_skins()

    def moves(self):
        """Whether any attribute of a prim may vary in time."""
        return any(attribute.ValueMightBeTimeVarying() for prim in self.stage.Traverse(PREDICATE)
                   for attribute in prim.GetAuthoredAttributes())

    def _time_code(self, frame):
        if frame is not None:
            if not math.isfinite(frame):
                raise Fault("/", f"its frame is {frame}", "give it a number")
            return Usd.TimeCode(frame)
        if not self.stage.HasAuthoredTimeCodeRange():
            return Usd.TimeCode.EarliestTime()
        start = self.stage.GetStartTimeCode()
        if not math.isfinite(start):
            self.losses.add("/", f"its startTimeCode is {start}: the first sample of each attribute is taken")
            return Usd.TimeCode.EarliestTime()
        return Usd.TimeCode(start)

    def _axes(self):
        """The matrix from the stage's axes to right-handed axes with y up, for row vectors."""
        turn = Gf.Matrix4d(1)
        if self.z_up:
            turn = Gf.Matrix4d(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1)
        return turn

    def _bake_skins(self):
        """Bake skeletal deformation at the time code into the points of meshes, in the session layer."""
        roots = [p for p in Usd.PrimRange(self.stage.GetPseudoRoot(), PREDICATE) if p.IsA(UsdSkel.Root)]
        if not roots:
            return
        self.stage.SetEditTarget(self.stage.GetSessionLayer())
        moment = 0.0 if self.time.IsEarliestTime() else self.time.GetValue()
        # Baked meshes have a sample at the time code.
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

    def _allows(self, path):
        """Whether the stage may name the file at `path`."""
        return self._folder is None or os.path.commonpath([self._folder, os.path.realpath(path)]) == self._folder

    def check_path(self, path, what, name=None):
        """Raise a Fault if a file is outside the stage's folder and this is not allowed.

        `name`: how the stage calls it. The message is the same whether the file exists or not.
        """
        if self._allows(path):
            return
        raise Fault(what, f"the file {name or path} is outside the scene's folder",
                    "put it beside the scene file and name it so, or allow such files with --allow-outside")

    def asset(self, prim, value):
        """The bytes and the name of the file of an asset-valued attribute, also inside a package."""
        name = value.resolvedPath or value.path
        where = prim.GetPath()
        if not value.path:
            raise Invalid(where, "it names no file", "give the texture's path in inputs:file")
        if "\0" in name:
            raise Invalid(where, f"no file has a name as {value.path!r}", "give the texture's path in inputs:file")
        if not value.resolvedPath:
            # Do not reveal whether a file outside the folder exists.
            self.check_path(os.path.join(os.path.dirname(self.path), value.path), where, value.path)
            raise Invalid(where, f"the file {value.path} is not found", "put it where the stage looks for it")
        file = outer_file(name)
        self.check_path(file, where, value.path)
        check_regular(file, where)
        self.files.add(os.path.abspath(file))
        opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(name))
        if opened is None:
            raise Invalid(where, f"the file {value.path} cannot be read", "check your right to read it")
        with opened:
            buffer = opened.GetBuffer()
        if buffer is None:
            raise Invalid(where, f"the file {value.path} is empty", "write it again")
        data = bytes(buffer)
        check_pointer(data, f"{where}: {value.path}")
        return data, Ar.SplitPackageRelativePathInner(name)[1] or name

    def get(self, attribute, default=None):
        """The value of an attribute at the time code, or `default`, with a loss if the value is not of the schema's type,
        or not finite."""
        value = attribute.Get(self.time) if attribute else None
        if value is None:
            return default
        # USD returns the file's value even if its type differs from the schema's.
        type_ = attribute.GetTypeName()
        if isinstance(value, Sdf.UnregisteredValue) or kind_of(value) != kind_of(type_.defaultValue):
            what = f"a {_named(value)}, not a {type_}"
        elif not finite(value):
            what = f"{value}, which is not finite"
        else:
            return value
        self.losses.add(attribute.GetPrim().GetPath(), f"{attribute.GetName()} is {what}: it is ignored")
        return default


def _check_pointer_file(path, where):
    """Raise a Fault if the file at `path` is a pointer of Git LFS."""
    if os.path.isfile(path):
        with open(path, "rb") as file:
            check_pointer(file.read(64), where)


def kind_of(value):
    """The type of a USD value as text; numbers of all precisions are equal."""
    if isinstance(value, (bool, int, float)):
        return "number"
    name = re.sub(r"^(Vec\d|Matrix\d|Quat)[dfhi]", r"\1", type(value).__name__)
    name = re.sub(r"^(Bool|U?Char|U?Short|U?Int|U?Int64|Half|Float|Double)Array$", "list of numbers", name)
    return {"str": "text", "StringArray": "list of texts", "TokenArray": "list of texts"}.get(name, name)


def _named(value):
    return "value of an unknown type" if isinstance(value, Sdf.UnregisteredValue) else kind_of(value)


def finite(value):
    """Whether a number, vector, matrix or tuple of numbers is finite; true for other types."""
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
    """Keys for `extras.caustique` from a prim's attributes `caustique:KEY`; colons separate nested keys."""
    found = {}
    for attribute in prim.GetAuthoredPropertiesInNamespace("caustique"):
        value = stage.get(attribute) if isinstance(attribute, Usd.Attribute) else None
        if value is None:
            stage.losses.add(prim.GetPath(), f"{attribute.GetName()} has no value and is ignored")
            continue
        *above, key = attribute.GetName().split(":")[1:]
        if len(above) > _MAX_DEPTH:
            stage.losses.add(prim.GetPath(), f"an attribute caustique:* has more than {_MAX_DEPTH} colons: it is "
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
    """A USD value converted for JSON."""
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Sdf.AssetPath):
        return value.resolvedPath or value.path
    return [plain(part) for part in value]  # values without components, such as quaternions, raise a TypeError
