"""The answers that cases must meet. Each judges a stage, which plays one case with one method, and says itself in JSON.

`bound` and `resolves` are shares of the answer: what is allowed beside noise, and the most noise with which the case is
decided (judge.py). `peers` tells whether other renderers can be asked.
"""

import re
from dataclasses import asdict, dataclass
from itertools import permutations

from . import judge
from .stage import Broken, read


class Answer:
    """What a case must meet; `derivation` says why, in words."""

    peers = True

    def judge(self, stage):
        """The Verdict."""
        raise NotImplementedError

    def shown(self):
        """The scenes whose pictures the page shows."""
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
    """Scenes of a case, each with its own radiance: {scene: number}. The worst one counts."""

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
    """Scenes that look like a first one, within noise; `warned`: what the program must say of them."""

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
    """Scenes whose pictures are those of a first one times a power of two, to the last bit: {scene: power}."""

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
    """What has no right answer is said: the program's warning matches, and no pixel is outside of low to high."""

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
    """Scenes in order, {scene: what a model says of its mean}: what the model leaves changes smoothly, and the first
    `falling` means fall."""

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
    """The program ends with an error whose text matches."""

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
    """Files are equal whatever the number of threads."""

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
    """Shards merged in any order are the picture of a render that was not divided, to the last bit; with `files` their
    headers are equal as well, among orders."""

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
    """A render that goes on from a checkpoint, after it was killed, is the file of one that was not stopped."""

    derivation: str
    scene: str = "scene"
    peers = False

    def judge(self, stage):
        whole = stage.render(self.scene, 0, name="whole")
        saved, path = stage.picture("state").with_suffix(".checkpoint"), stage.picture("resumed")
        arguments = [a for a in stage.arguments(self.scene, 0) if a != "--no-checkpoint"]
        saved.unlink(missing_ok=True)
        # A share of the time of the whole render, and longer where nothing had been saved by then.
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
    """The verdict of several, {scene: verdict}: the one nearest to its limit, or beyond it."""
    label = max(verdicts, key=lambda label: (not verdicts[label].passed, verdicts[label].share))
    one = verdicts[label]
    return judge.Verdict(
        all(v.passed for v in verdicts.values()),
        f"{label}: {one.figure}" if len(verdicts) > 1 else one.figure,
        one.share,
    )
