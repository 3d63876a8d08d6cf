"""Attributes that materials read from objects, instancers and view layers, as Cycles' Attribute node finds them."""

import bpy

from shading import nodes_of

_INSTANCER = "caustique instancer "  # before the name of an instancer's attribute, as a property of the instance
_NO_INDEX = 2 ** 31 - 1


class Attributes:
    """The values of all attributes that the open file's materials read by an Attribute node of the types Object,
    Instancer and View Layer. `warn(where, what)` receives a warning for each loss."""

    def __init__(self, warn):
        self._warn, self._names, self._instances = warn, {}, {}
        for tree in [*filter(None, map(nodes_of, bpy.data.materials)), *bpy.data.node_groups]:
            for node in tree.nodes if tree.type == "SHADER" else ():
                if node.type == "ATTRIBUTE" and node.attribute_name:
                    self._names.setdefault(node.attribute_type, set()).add(node.attribute_name)

    def of_scene(self, scene, layer):
        """{name: value} for the attributes of a scene and its view layer."""
        return self._found("VIEW_LAYER", layer, scene)

    def of_instance(self, instance):
        """{property: value} for the attributes of an instance of the dependency graph, and of its instancer."""
        thing = instance.object
        values = self._found("OBJECT", thing, thing.data)
        for name in self._names.get("INSTANCER", ()):
            value = None
            if instance.is_instance:
                value = self._of_nodes(instance, name)
                value = _value(instance.parent, name) if value is None else value
            for block in (thing, thing.data):
                value = _value(block, name) if value is None else value
            if value is not None:
                values[_INSTANCER + name] = value
        return values

    def _found(self, kind, *blocks):
        found = {name: [_value(block, name) for block in blocks] for name in self._names.get(kind, ())}
        first = {name: next((v for v in values if v is not None), None) for name, values in found.items()}
        return {name: value for name, value in first.items() if value is not None}

    def _of_nodes(self, instance, name):
        """The attribute that geometry nodes give an instance, or None."""
        parent = instance.parent
        key = parent.original.name_full
        if key not in self._instances:
            self._instances[key] = None
            if hasattr(parent, "evaluated_geometry"):
                geometry = parent.evaluated_geometry()  # owns the points
                points = geometry.instances_pointcloud()
                found = points.attributes if points is not None else ()
                self._instances[key] = {a.name: _numbers(a) for a in found if a.name in self._names["INSTANCER"]}
            elif any(m.type == "NODES" for m in parent.original.modifiers):
                self._warn(f'object "{parent.name}"', f'the attribute "{name}" of its instances is read with Blender 4.5 and '
                           "newer only: instances have the value of the object itself; use a newer Blender, or store the "
                           "attribute on real objects (Object > Apply > Make Instances Real)")
        levels = [index for index in instance.persistent_id if index != _NO_INDEX]
        values = (self._instances[key] or {}).get(name, ())
        return values[levels[-1]] if levels and levels[-1] < len(values) else None


def read_from_object(node):
    """Make an Attribute node in a copied material read the instancer's attribute from the instance."""
    node.attribute_type, node.attribute_name = "OBJECT", _INSTANCER + node.attribute_name


def numbers_of(block):
    """{name: value} for the custom properties of a data block that are numbers."""
    found = {name: _plain(block[name]) for name in block.keys() if name != "cycles"}
    return {name: value for name, value in found.items() if value is not None}


def _value(block, name):
    """The custom property, or the property, of a data block: a number or numbers, or None."""
    if block is None:
        return None
    try:
        return _plain(block[name] if name in block.keys() else block.path_resolve(name))
    except (TypeError, ValueError, AttributeError):
        return None


def _numbers(attribute):
    """The value of each element of a mesh's or point cloud's attribute."""
    field = {"FLOAT_COLOR": "color", "BYTE_COLOR": "color", "FLOAT_VECTOR": "vector", "FLOAT2": "vector"}
    name = field.get(attribute.data_type, "value")
    return [_plain(getattr(item, name, None)) for item in attribute.data]


def _plain(value):
    """A number, a list of up to four numbers, or None for other values."""
    if isinstance(value, (bool, int, float)):
        return float(value)
    try:
        numbers = [float(x) for x in value]
    except (TypeError, ValueError):
        return None
    return numbers if 1 <= len(numbers) <= 4 else None
