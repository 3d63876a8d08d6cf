"""Light linking and shadow linking of UsdLux as keys of `extras.caustique`: the collections `lightLink` and
`shadowLink` of each light."""

from pxr import UsdLux


class Links:
    """The lights of a stage that are linked to some prims only."""

    def __init__(self, stage):
        # {path of a light: {key of its node: (name of its collection, which paths the collection contains)}}
        self._linked = {}
        for prim in stage.Traverse():
            if prim.HasAPI(UsdLux.LightAPI):
                light, path = UsdLux.LightAPI(prim), str(prim.GetPath())
                for key, name, collection in (("receivers", path, light.GetLightLinkCollectionAPI()),
                                              ("blockers", f"{path} (shadows)", light.GetShadowLinkCollectionAPI())):
                    if collection.GetIncludesRel().GetTargets() or collection.GetExcludesRel().GetTargets():
                        self._linked.setdefault(path, {})[key] = name, collection.ComputeMembershipQuery()

    def of_mesh(self, prim):
        """The key `collections` of a mesh's node, if linked lights name it."""
        linked = [link for links in self._linked.values() for link in links.values()]
        names = [name for name, members in linked if members.IsPathIncluded(prim.GetPath())]
        return {"collections": names} if names else {}

    def of_light(self, prim):
        """The keys `receivers` and `blockers` of a light's node, if it is linked."""
        links = self._linked.get(str(prim.GetPath()), {})
        return {key: {"include": [name]} for key, (name, _) in links.items()}
