"""A case: scenes, the methods that it concerns, and the answer that they must meet."""

import json
from dataclasses import dataclass, field
from pathlib import Path

#: The program's table of methods: tests/generated.rs writes the file.
_TABLE = json.loads((Path(__file__).parents[1] / "methods.json").read_text("utf-8"))
#: All methods.
ALL_METHODS = tuple(method["name"] for method in _TABLE)
#: Methods that send a number of light paths of their own.
PHOTON_METHODS = tuple(method["name"] for method in _TABLE if method["photons"])
#: Methods of a case unless it says others: paths, connections, both with photons, and photons alone.
METHODS = ("path", "bdpt", "vcm", "sppm")

#: Seeds of cases whose pictures have next to no noise.
FEW = 6


@dataclass
class Case:
    """name: of files and on the command line; title: what it tests; scenes: {label: function that makes a Scene}.

    iterations, photons and options: of every method, or {method: ...} with those of the others at None.
    fails: {method: why the program is known not to meet the answer}. long: whether the long form alone has it.
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
        """What iterations, photons or options are with a method."""
        said = getattr(self, key)
        return said.get(method, said[None]) if isinstance(said, dict) else said

    def document(self):
        """All that others need to play the case, as JSON: NAME.json beside the scenes."""
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
