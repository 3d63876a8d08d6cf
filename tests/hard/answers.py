"""The answers that cases must meet. An answer tests the pictures of a stage, which renders one case by one method, and
has a form in JSON.

`bound` and `resolves` are shares of the answer: the deviation that is allowed besides noise, and the largest noise with
which a case is decided (judge.py). `peers` is False for answers that other renderers cannot give.
"""

import re
from dataclasses import asdict, dataclass
from itertools import permutations

from . import judge
from .stage import Broken, read


class Answer:
    """An answer that a case must meet; `derivation` gives the reason in words."""

    peers = True

    def judge(self, stage):
        """The Verdict on the pictures of a stage."""
        raise NotImplementedError

    def shown(self):
        """The labels of the scenes whose pictures the page shows."""
        raise NotImplementedError

    def document(self):
        """The answer as JSON."""
        return {"kind": type(self).__name__.lower(), **asdict(self)}


@dataclass(frozen=True)
class Value(Answer):
    """Every pixel of a scene has this radiance: a number above zero, or three."""

    value: object
    derivation: str
    bound: float = 0.002
    resolves: float = 0.03
    scene: str = "scene"

    def judge(self, stage):
        return judge.value(stage.pictures(self.scene), self.value, self.bound, self.resolves)

    def shown(self):
        return [self.scene]


@dataclass(frozen=True)
class Values(Answer):
    """Every pixel of each scene has the scene's radiance, {scene: number}. The worst scene counts."""

    values: dict
    derivation: str
    bound: float = 0.002
    resolves: float = 0.03

    def judge(self, stage):
        found = {
            label: judge.value(stage.pictures(label), value, self.bound, self.resolves)
            for label, value in self.values.items()
        }
        return worst(found)

    def shown(self):
        return list(self.values)


@dataclass(frozen=True)
class Equal(Answer):
    """All `scenes` look like the scene `like`, within noise; `warned`: a pattern that the program's warnings must match."""

    like: str
    scenes: tuple
    derivation: str
    bound: float = 0.002
    resolves: float = 0.03
    warned: str = ""

    def judge(self, stage):
        like = stage.pictures(self.like)
        verdict = worst(
            {label: judge.equal(stage.pictures(label), like, self.bound, self.resolves) for label in self.scenes}
        )
        if not re.search(self.warned, stage.said, re.IGNORECASE):
            return judge.Verdict(False, "no warning", 1.0)
        return verdict

    def shown(self):
        return [self.like, *self.scenes]


@dataclass(frozen=True)
class Exact(Answer):
    """The picture of each scene is, to the last bit, the picture of `like` times a power of two: {scene: power}."""

    like: str
    powers: dict
    derivation: str

    def judge(self, stage):
        like = stage.pictures(self.like)
        return worst(
            {label: judge.exact(stage.pictures(label), like, 2.0**power) for label, power in self.powers.items()}
        )

    def shown(self):
        return [self.like, *self.powers]


@dataclass(frozen=True)
class Black(Answer):
    """No pixel is brighter than `most`."""

    most: float
    derivation: str
    scene: str = "scene"

    def judge(self, stage):
        return judge.black(stage.pictures(self.scene), self.most)

    def shown(self):
        return [self.scene]


@dataclass(frozen=True)
class Warned(Answer):
    """The scene has no correct picture: a warning matches `match`, and all pixels are between `low` and `high`."""

    match: str
    low: float
    high: float
    derivation: str
    scene: str = "scene"
    peers = False

    def judge(self, stage):
        pictures = stage.pictures(self.scene)
        least, most = float(pictures.min()), float(pictures.max())
        said = re.search(self.match, stage.said, re.IGNORECASE)
        return judge.Verdict(
            bool(said) and self.low <= least and most <= self.high,
            f"pixels from {least:.3g} to {most:.3g}; {'a warning' if said else 'no warning'}",
        )

    def shown(self):
        return [self.scene]


@dataclass(frozen=True)
class Sweep(Answer):
    """A sequence of scenes, {scene: mean that a model predicts}: the difference from the model changes smoothly, and the
    first `falling` means decrease."""

    model: dict
    derivation: str
    bound: float
    resolves: float = 0.03
    falling: int = 0

    def judge(self, stage):
        series = [stage.pictures(label) for label in self.model]
        return judge.sweep(series, list(self.model.values()), self.bound, self.resolves, self.falling)

    def shown(self):
        return list(self.model)


@dataclass(frozen=True)
class Refused(Answer):
    """The program ends with an error whose text matches `match`."""

    match: str
    derivation: str
    scene: str = "scene"
    peers = False

    def judge(self, stage):
        try:
            stage.render(self.scene, 0)
        except Broken as broken:
            said = str(broken)
            meant = re.search(self.match, said, re.IGNORECASE) and "panicked" not in said
            return judge.Verdict(bool(meant), said.splitlines()[-1][:300], 0.0 if meant else 1.0)
        return judge.Verdict(False, "rendered without an error", 1.0)

    def shown(self):
        return []


@dataclass(frozen=True)
class Threads(Answer):
    """Files are equal for all numbers of threads."""

    derivation: str
    counts: tuple = (1, 2, 3, 7)
    scene: str = "scene"
    peers = False

    def judge(self, stage):
        return judge.same(
            {
                f"{n} threads": stage.render(self.scene, 0, name=f"threads-{n}", threads=n).read_bytes()
                for n in self.counts
            }
        )

    def shown(self):
        return []


@dataclass(frozen=True)
class Shards(Answer):
    """Shards that are merged in any order give, to the last bit, the picture of an undivided render. With `files`, the
    merged files of all orders are equal, including their headers."""

    derivation: str
    files: bool = False
    count: int = 3
    scene: str = "scene"
    peers = False

    def judge(self, stage):
        shards = [
            stage.render(self.scene, 0, "--shard", f"{i}/{self.count}", name=f"shard-{i}") for i in range(self.count)
        ]
        found = {} if self.files else {"whole": read(stage.render(self.scene, 0, name="whole")).tobytes()}
        for order in permutations(range(self.count)):
            name = "".join(map(str, order))
            path = stage.picture(f"merged-{name}")
            code, said = stage.run(
                "merge", *(shards[i] for i in order), "-o", path, "--no-combine", *["--reproducible"] * self.files
            )
            if code:
                raise Broken(said.strip())
            found[f"order {name}"] = path.read_bytes() if self.files else read(path).tobytes()
        return judge.same(found)

    def shown(self):
        return []


@dataclass(frozen=True)
class Resumed(Answer):
    """A killed render that resumes from its checkpoint writes the same file as an uninterrupted one."""

    derivation: str
    scene: str = "scene"
    peers = False

    def judge(self, stage):
        whole = stage.render(self.scene, 0, name="whole")
        saved, path = stage.picture("state").with_suffix(".checkpoint"), stage.picture("resumed")
        arguments = [a for a in stage.arguments(self.scene, 0) if a != "--no-checkpoint"]
        saved.unlink(missing_ok=True)
        # The kill comes after a share of the whole render's time, and later if nothing has been saved by then.
        after = 0.4 * stage.seconds
        for _ in range(8):
            code, said = stage.run(
                *arguments, "--checkpoint", saved, "--checkpoint-every", "0.05", "-o", path, stop_after=after
            )
            if saved.is_file():
                break
            after *= 1.5
        if code == 0:
            return judge.Verdict(False, "undecided: the render ended before it could be killed", 1.0)
        if not saved.is_file():
            return judge.Verdict(False, f"killed after {after:.1f} s, nothing was saved: {said.strip()[-200:]}", 1.0)
        code, said = stage.run(*arguments, "--checkpoint", saved, "--resume", saved, "-o", path)
        if code:
            raise Broken(said.strip())
        return judge.same({"whole": whole.read_bytes(), "resumed": path.read_bytes()})

    def shown(self):
        return []


def worst(verdicts):
    """The verdict on several scenes, {scene: verdict}: the one that is closest to its limit, or farthest beyond it."""
    label = max(verdicts, key=lambda label: (not verdicts[label].passed, verdicts[label].share))
    one = verdicts[label]
    return judge.Verdict(
        all(v.passed for v in verdicts.values()),
        f"{label}: {one.figure}" if len(verdicts) > 1 else one.figure,
        one.share,
    )
