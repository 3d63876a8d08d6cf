"""Light linking and shadow linking (Blender 4), as keys of the scene format: which collections an object is in, and
which ones receive or block its light.

A collection of Blender has objects that it includes and objects that it excludes; the latter become a collection of
their own.
"""

import bpy


class Links:
    """The links of all objects of the file."""

    def __init__(self):
        # {name of an object: names of its collections}, and {name of an object: its keys `receivers` and `blockers`}
        self._collections, self._linked = {}, {}
        read = {}
        for thing in bpy.data.objects:
            links = thing.light_linking
            for key, collection in (("receivers", links.receiver_collection), ("blockers", links.blocker_collection)):
                if collection is not None:
                    if collection not in read:
                        read[collection] = self._read(collection)
                    self._linked.setdefault(thing.name, {})[key] = read[collection]

    def _read(self, collection):
        """Note the objects of a linking collection. Returns the key `receivers` or `blockers` of its lights."""
        linked = {}
        for state, thing in _objects(collection):
            name = collection.name if state == "INCLUDE" else f"{collection.name} (excluded)"
            linked[state.lower()] = [name]
            self._collections.setdefault(thing.name, set()).add(name)
        return linked

    def of(self, thing, instancer):
        """The keys of `extras.caustique` of an object. As in Cycles, the collections of its instancer count, if it has
        some, else its own."""
        own = instancer if instancer is not None and instancer.name in self._collections else thing
        keys = {"collections": sorted(self._collections.get(own.name, ())), **self._linked.get(thing.name, {})}
        return {key: value for key, value in keys.items() if value}


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
