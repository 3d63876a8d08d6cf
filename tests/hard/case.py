"""A case: scenes, the methods that render them, and the answer that the pictures must meet."""

import json
from dataclasses import dataclass, field
from pathlib import Path

#: The program's table of methods, written by tests/generated.rs.
_TABLE = json.loads((Path(__file__).parents[1] / "methods.json").read_text("utf-8"))
#: All methods.
ALL_METHODS = tuple(method["name"] for method in _TABLE)
#: Methods whose number of light paths is an option.
PHOTON_METHODS = tuple(method["name"] for method in _TABLE if method["photons"])
#: The default methods of a case: camera paths, connections, connections with photons, and photons.
METHODS = ("path", "bdpt", "vcm", "sppm")

#: Number of seeds for cases with little noise.
FEW = 6


@dataclass
class Case:
    """name: in files and on the command line; title: what the case tests; scenes: {label: function that makes a Scene}.

    iterations, photons and options: one value for all methods, or {method: value} with the default under None.
    fails: {method: reason of a known failure}. long: whether only --long runs the case.
    """

    name: str
    title: str
    scenes: dict
    answer: object
    methods: tuple = METHODS
    size: int = 16
    iterations: object = 2
    seeds: int = 16
    photons: object = 20000
    options: object = ()
    fails: dict = field(default_factory=dict)
    long: bool = False
    family: str = ""

    def file(self, label):
        """The file of a scene."""
        return f"{self.name}.glb" if len(self.scenes) == 1 else f"{self.name}-{label}.glb"

    def of(self, key, method):
        """The value of iterations, photons or options for a method."""
        value = getattr(self, key)
        return value.get(method, value[None]) if isinstance(value, dict) else value

    def document(self):
        """The case as JSON for other renderers, written as NAME.json beside the scenes."""
        return {
            "name": self.name,
            "family": self.family,
            "title": self.title,
            "scenes": {label: self.file(label) for label in self.scenes},
            "width": self.size,
            "height": self.size,
            "seeds": self.seeds,
            "methods": {
                method: {key: self.of(key, method) for key in ("iterations", "photons", "options")}
                for method in self.methods
            },
            "answer": self.answer.document(),
            "fails": self.fails,
        }

    def write(self, folder):
        """Writes NAME.json and the scenes."""
        for label, made in self.scenes.items():
            made().write(folder / self.file(label))
        (folder / f"{self.name}.json").write_text(json.dumps(self.document(), indent=1) + "\n")
