"""Checks the layers of a stage before USD opens them."""

import os

from pxr import Ar, Sdf, Tf, UsdUtils

from faults import Fault


def outer_file(name):
    """The file of a layer or asset, which may lie in a package: `a.usdz` of `a.usdz[b.usda]`."""
    return Ar.SplitPackageRelativePathOuter(Sdf.Layer.SplitIdentifier(name)[0])[0]


def check_regular(path, where):
    """Raise a Fault if a path names a pipe, a device or a folder: reading it may wait forever or never end."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise Fault(where, f"{path} is not a regular file", "name a file")


def open_layers(path, check_path):
    """Open the layer at `path` and all layers that it names, directly or not. Returns them.

    Every file is checked before it is opened: `check_path(path, where)` raises a Fault if it is outside the stage's
    folder. Without this, a stage would learn whether a file outside exists. Layers that USD cannot read are left out.
    """
    found, seen, waiting = [], set(), [path]
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        file = os.path.abspath(outer_file(name))
        check_path(file, "the stage")
        check_regular(file, "the stage")
        try:
            layer = Sdf.Layer.FindOrOpen(name) if os.path.exists(file) else None
        except Tf.ErrorException:
            layer = None  # composing the stage reports it
        if layer is None:
            continue
        found.append(layer)
        variables = {**layer.expressionVariables, **found[0].expressionVariables}
        for asset in layer.GetCompositionAssetDependencies():
            waiting += _anchored(layer, _evaluated(asset, variables))
        for clip in _clips(layer, check_path):
            waiting += _anchored(layer, _evaluated(clip, variables))
    return found


def named_files(layer):
    """The files that a layer names, read or not, as absolute paths."""
    try:
        _, assets, _ = UsdUtils.ExtractExternalReferences(layer.identifier)
    except Tf.ErrorException:
        return set()
    return {os.path.abspath(outer_file(path)) for asset in assets for path in _anchored(layer, asset)}


def _anchored(layer, asset):
    return [Sdf.ComputeAssetPathRelativeToLayer(layer, asset)] if asset else []


def _evaluated(asset, variables):
    """The value of an asset path, which may be a variable expression; an empty text if that has none."""
    if not Sdf.VariableExpression.IsExpression(asset):
        return asset
    value = Sdf.VariableExpression(asset).Evaluate(variables).value
    return value if isinstance(value, str) else ""


def _clips(layer, check_path):
    """The asset paths of a layer's value clips. Checks the folders of templates."""
    found = []

    def visit(path):
        if not (path.IsPrimPath() or path.IsPrimVariantSelectionPath()):
            return
        spec = layer.GetObjectAtPath(path)
        sets = spec.GetInfo("clips") if isinstance(spec, Sdf.PrimSpec) and spec.HasInfo("clips") else {}
        for clips in sets.values():
            clips = clips if isinstance(clips, dict) else {}
            assets = [*(clips.get("assetPaths") or ()), clips.get("manifestAssetPath")]
            found.extend(asset.path for asset in assets if isinstance(asset, Sdf.AssetPath))
            for template in _anchored(layer, clips.get("templateAssetPath")):
                check_path(os.path.abspath(os.path.dirname(outer_file(template))), path)

    layer.Traverse("/", visit)
    return found
