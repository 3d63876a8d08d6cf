"""Light linking (Blender 4), as keys of the scene format: which collections an object is in, and which ones receive its
light.

A collection of Blender has objects that it includes and objects that it excludes; the latter become a collection of
their own.
"""

import bpy

# {key of the scene format: property of Blender}
_KINDS = {"receivers": "receiver_collection"}


class Links:
    """The links of all objects of the file."""

    def __init__(self):
        # For each kind: {name of an object: names of its collections}
        self._collections = {kind: {} for kind in _KINDS}
        self._of_lights = {}
        read = {}
        for thing in bpy.data.objects:
            for kind, name in _KINDS.items():
                collection = getattr(getattr(thing, "light_linking", None), name, None)
                if collection is not None:
                    if (kind, collection) not in read:
                        read[kind, collection] = self._read(kind, collection)
                    self._of_lights.setdefault(thing.name, {})[kind] = read[kind, collection]

    def _read(self, kind, collection):
        """Note the objects of a collection of this kind. Returns the value of the key."""
        linked = {}
        for state, thing in _objects(collection):
            name = collection.name if state == "INCLUDE" else f"{collection.name} (excluded)"
            linked[state.lower()] = [name]
            self._collections[kind].setdefault(thing.name, set()).add(name)
        return linked

    def of(self, thing, instancer):
        """The keys of `extras.caustique` of an object. As in Cycles, the collections of its instancer count, if it has
        some, else its own."""
        names = set()
        for known in self._collections.values():
            names |= known.get(instancer.name, set()) if instancer is not None and instancer.name in known else (
                known.get(thing.name, set()))
        keys = {kind: linked for kind, linked in self._of_lights.get(thing.name, {}).items() if linked}
        return {**({"collections": sorted(names)} if names else {}), **keys}


def _objects(collection):
    """(INCLUDE or EXCLUDE, object) for all objects of a collection. Its children have one state each."""
    for link, child in zip(collection.collection_children, collection.children, strict=True):
        for thing in child.all_objects:
            yield link.light_linking.link_state, thing
    for link, thing in zip(collection.collection_objects, collection.objects, strict=True):
        yield link.light_linking.link_state, thing


def write(document, keys, bodies):
    """Add `keys`, {name of an object of the flat scene: its keys}, to the nodes of a document. `bodies`: the name of each
    node's object."""
    for node, name in zip(document.get("nodes", []), bodies, strict=True):
        if keys.get(name):
            node.setdefault("extras", {}).setdefault("caustique", {}).update(keys[name])
