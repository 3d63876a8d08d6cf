"""Light linking of UsdLux as keys of `extras.caustique`: the collection `lightLink` of each light."""

from pxr import UsdLux


class Links:
    """The lights of a stage that are linked to some prims only."""

    def __init__(self, stage):
        # {path of a light: which paths its collection contains}
        self._members = {}
        for prim in stage.Traverse():
            if prim.HasAPI(UsdLux.LightAPI):
                collection = UsdLux.LightAPI(prim).GetLightLinkCollectionAPI()
                if collection.GetIncludesRel().GetTargets() or collection.GetExcludesRel().GetTargets():
                    self._members[str(prim.GetPath())] = collection.ComputeMembershipQuery()

    def of_mesh(self, prim):
        """The key `collections` of a mesh's node, if it receives light of linked lights. The collections have the names of
        the lights."""
        names = [name for name, members in self._members.items() if members.IsPathIncluded(prim.GetPath())]
        return {"collections": names} if names else {}

    def of_light(self, prim):
        """The key `receivers` of a light's node, if it is linked."""
        name = str(prim.GetPath())
        return {"receivers": {"include": [name]}} if name in self._members else {}
