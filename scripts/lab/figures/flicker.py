"""Flicker of animations: four animated shots (lab/shots.py), each frame rendered by itself at equal time.

Flicker is the root of the mean, over pixels and frames, of the squared temporal difference of the error: the error in
the next frame, at the pixel that shows the same surface point, minus the error. It is relative and trimmed as relMSE is
(lab/picture_errors.py). Beside it is the root of the mean relMSE of the frames. Each frame is compared with two
independent halves of a reference, so that the references' own noise cancels.

Surface points are followed by the transforms of objects and camera; pixels whose point is hidden in the next frame do
not count (lab/temporal.py). Rows: the finished frames of each method, their estimates, Intel OIDN alone on these
estimates, the frames as the temporal finish of `caustique finish` makes them, and other
renderers with OIDN, on single frames of the shots; pictures with another mean than the reference are not stored, because
light that is missing in every frame does not flicker. A film strip of each shot shows eight frames by row.

Renders are cached, so an interrupted run continues. CAUSTIQUE_BIN names the program, and CAUSTIQUE_CACHE the cache.
"""

import functools
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from .. import peer_runs, references, renders, shots, temporal
from ..cache import CACHE, Failed, create, frame_suffix, load, program, run_timed, save, scene_key
from ..commands import command
from ..options import options
from ..picture_errors import Layers, Reference
from ..record import record

ARGUMENTS = {
    "shots": list(shots.SHOTS),
    "frames": shots.FRAMES,
    "width": 320,
    "threads": 2,
    "reference_seconds": 60.0,
    "budgets": [15.0],
    "methods": ["auto"],
    "denoise": ["default"],
    "render_options": [],
    "clock": "cpu",
    "peers": ["cycles_path"],
}
SHORT = {"width": 96, "frames": 6, "threads": 1, "reference_seconds": 5.0, "budgets": [2.0], "peers": []}
# Camera paths per pixel for the positions and normals by which surfaces are followed.
GUIDE_ITERATIONS = 16
TEMPORAL, GIF_MILLISECONDS = ", temporal", 80
# The layers that the temporal finish reads.
LAYERS = ["--layers", "all,Motion,Quarter"]
STRIP_FRAMES, LABEL_WIDTH = 8, 150
KEYS = ("flicker", "flicker_trimmed", "error", "error_trimmed")
PICTURES = {"delivered": "", "noisy": ", estimate", "oidn": ", OIDN alone"}
PEER_PICTURES = {"noisy": "", "oidn": ", OIDN alone"}


def guides(shot, frame):
    """The guides of a frame, from the cache if possible."""
    folder = CACHE / "guides" / scene_key(shot) / f"{options.width}{frame_suffix(frame)}"
    if not folder.exists():
        with create(folder) as draft:
            settings = {"method": "path", "no_finish": True, "iterations": GUIDE_ITERATIONS, "frames": frame}
            settings |= {"width": options.width, "layers": "P,Z,normal,CryptoObject00", "progress": "none"}
            # Equal seeds, so that nothing changes where nothing moves.
            settings |= {"frame_seed": "same", "threads": options.threads}
            run_timed(command("render", shot, "-o", draft / "guides.exr", **settings))
    return temporal.Guides.read(folder / "guides.exr")


class Sequence:
    """The references of a shot's frames, and the counterparts of their pixels."""

    def __init__(self, name):
        self.name, self.shot = name, shots.write(name)
        self.frames = range(1, options.frames + 1)
        made = [references.reference(self.shot, frame) for frame in self.frames]
        self.halves = [folder for folder, _ in made]
        self.made = [facts for _, facts in made]
        self.references = [Reference.read(folder) for folder in self.halves]
        self.animation, self.guides = shots.Animation(self.shot), [guides(self.shot, frame) for frame in self.frames]
        self.match = functools.cache(self.match)
        self.matches = [self.match(i, i + 1) for i in range(len(self.frames) - 1)]

    def match(self, first, second):
        """The counterparts of a frame's pixels in another frame, both counted from 0."""
        moved = temporal.vectors(self.animation, self.guides[first], self.frames[first], self.frames[second])
        return temporal.counterparts(moved, self.guides[second])

    def row(self, folders, series, errors):
        """The flicker and the errors of a series of pictures, from the errors of each."""
        found = temporal.flicker([one.astype(float) for one in series], self.references, self.matches)
        for key, error in (("error", "relmse"), ("error_trimmed", "relmse_trimmed")):
            found[key] = float(np.sqrt(max(np.mean([one[error] for one in errors]), 0.0)))
        ratios = np.array([[one["mean_ratio"], one["mean_ratio_error"]] for one in errors])
        found["mean_ratio"] = float(ratios[:, 0].mean())
        found["mean_ratio_error"] = float(np.sqrt(np.square(ratios[:, 1]).sum()) / len(errors))
        found["relmse_trimmed"] = [float(f"{one['relmse_trimmed']:.4g}") for one in errors]
        found["core_seconds"] = self.spent(folders)
        return found

    @staticmethod
    def spent(folders):
        """The mean core-seconds of the renders in folders."""
        return float(np.mean([load(folder / "run.json")["cpu_seconds"] for folder in folders]))

    def rows(self, folders, pictures_of, shown):
        """The rows of a render's pictures, and the pictures of all frames, by the ends of their names."""
        errors = [
            renders.figures(folder, reference, halves, pictures_of)
            for folder, reference, halves in zip(folders, self.references, self.halves, strict=True)
        ]
        pictures = [pictures_of(folder) for folder in folders]
        for name, suffix in shown.items():
            if name in pictures[0]:
                series = [one[name] for one in pictures]
                yield suffix, self.row(folders, series, [one[name] for one in errors]), series

    def finished_together(self, folders):
        """The row of the temporal finish, and its pictures."""
        with tempfile.TemporaryDirectory() as scratch:
            scratch = Path(scratch)
            for frame, folder in zip(self.frames, folders, strict=True):
                (scratch / f"in.{frame:04}.exr").symlink_to(folder / "picture.exr")
            line = command("finish", scratch / "in.####.exr", "-o", scratch / "out.####.exr", threads=options.threads)
            _, _, spent = run_timed(line)
            pictures = [Layers(scratch / f"out.{frame:04}.exr").get("") for frame in self.frames]
        errors = [reference.measure(one) for reference, one in zip(self.references, pictures, strict=True)]
        row = self.row(folders, pictures, errors)
        return {**row, "finish_core_seconds": round(spent / len(pictures), 2)}, pictures


def line(label, found, note=None):
    """Prints a row of the table."""
    values = "".join(f"{found[key]:>17.4f}" for key in KEYS)
    print(f"    {label:<32}{found['core_seconds']:>8.1f}{values}{'  ' + note if note else ''}", flush=True)


def sources(sequence, budget, peers):
    """The rows of a shot: the name, the folders of its frames, the reader of their pictures, and the pictures."""
    for denoise in ["" if name == "default" else name for name in options.denoise]:
        for method in options.methods:

            def ours(frame, method=method, denoise=denoise):
                return renders.render(sequence.shot, method, denoise, budget, 0, frame=frame)

            yield f"{method} {denoise}".strip(), ours, renders.pictures, PICTURES
    height = sequence.references[0].mean.shape[0]
    for name in peers:

        def theirs(frame, name=name):
            still = CACHE / "stills" / f"{sequence.name}{frame_suffix(frame)}.glb"
            shots.write_still(sequence.shot, frame, still)
            return peer_runs.Peers(still, height).render(name, budget, frame)

        def pictures(folder):
            still = CACHE / "stills" / f"{sequence.name}{frame_suffix(sequence.frames[0])}.glb"
            return peer_runs.Peers(still, height).pictures(folder)

        yield name, theirs, pictures, PEER_PICTURES


def display(picture, white):
    """A picture as 8-bit sRGB, with the radiance `white` as white."""
    linear = np.clip(np.nan_to_num(picture / white), 0, 1)
    curve = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return (255 * curve + 0.5).astype(np.uint8)


def write_strip(sequence, budget, rows):
    """Writes the film strip of a shot: a row for each series of pictures, the references first."""
    count = min(STRIP_FRAMES, len(sequence.frames))
    chosen = np.linspace(0, len(sequence.frames) - 1, count).round().astype(int)
    truth = [reference.mean for reference in sequence.references]
    rows = {"reference": truth, **rows}
    height, width = truth[0].shape[:2]
    white = np.nanpercentile(np.stack(truth).mean(-1), 98)
    strip = Image.new("RGB", (LABEL_WIDTH + count * width, len(rows) * height))
    pen = ImageDraw.Draw(strip)
    for at, (label, series) in enumerate(rows.items()):
        pen.text((4, at * height + 4), label)
        for column, frame in enumerate(chosen):
            strip.paste(Image.fromarray(display(series[frame], white)), (LABEL_WIDTH + column * width, at * height))
    folder = CACHE / "strips"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{sequence.name}-{width}-{budget:g}s.png"
    strip.save(path)
    print(f"    {path}", flush=True)


def write_animation(sequence, budget, label, rows):
    """Writes a GIF of a shot: the frames finished alone on the left, with their neighbours on the right."""
    sides = [rows[label], rows[label + TEMPORAL]]
    white = np.nanpercentile(np.stack([reference.mean for reference in sequence.references]).mean(-1), 98)
    pictures = [Image.fromarray(display(np.concatenate(pair, 1), white)) for pair in zip(*sides, strict=True)]
    # One palette and no dithering, which would flicker too.
    palette = pictures[0].quantize(256)
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    path = CACHE / "strips" / f"{sequence.name}-{frames[0].width}-{budget:g}s.gif"
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=GIF_MILLISECONDS, loop=0)
    print(f"    {path}", flush=True)


def measure(name, budget, peers):
    """Measures a shot at a budget; returns the rows of the table, and the notes."""
    sequence = Sequence(name)
    own = np.sqrt(np.mean([reference.error for reference in sequence.references]))
    head = "".join(f"{key.replace('_', ', '):>17}" for key in KEYS)
    print(f"\n{name}, {budget:g} s, the references' own error {own:.2g}\n    {'':<32}{'core-s':>8}{head}", flush=True)
    rows, strip, notes = [], {}, {}
    for label, render, pictures_of, shown in sources(sequence, budget, peers):
        try:
            folders = [render(frame) for frame in sequence.frames]
        except Failed as failed:
            notes[label] = str(failed)
            print(f"    {label:<32}{failed}", flush=True)
            continue
        found = [*sequence.rows(folders, pictures_of, shown)]
        if shown is PICTURES:
            found.append((TEMPORAL, *sequence.finished_together(folders)))
        mismatch = peer_runs.mean_mismatch(found[0][1]) if shown is PEER_PICTURES else None
        if mismatch:
            notes[label] = mismatch
        for suffix, row, strip[label + suffix] in found:
            line(label + suffix, row, mismatch)
            if not mismatch:
                rows.append({"shot": name, "budget": budget, "row": label + suffix, **rounded(row)})
    write_strip(sequence, budget, strip)
    for label in strip:
        if label + TEMPORAL in strip:
            write_animation(sequence, budget, label, strip)
    used = {"error": float(f"{own:.3g}"), "core_seconds": [made["core_seconds"] for made in sequence.made]}
    return rows, notes, {**used, "options": sequence.made[0]["options"], "program": sequence.made[0]["program"]}


def rounded(found):
    """A row for the record, with four digits."""
    return {key: value if isinstance(value, list) else float(f"{value:.4g}") for key, value in found.items()}


def main():
    unknown = set(options.shots) - set(shots.SHOTS)
    if unknown or not 2 <= options.frames <= shots.FRAMES:
        raise SystemExit(f"--shots are some of {', '.join(shots.SHOTS)}, and --frames is 2 to {shots.FRAMES}")
    peers, reason = peer_runs.select()
    if reason:
        print(reason, file=sys.stderr)
    options.render_options = [*options.render_options, *LAYERS]
    rows, notes, known = [], {}, {}
    for name in options.shots:
        for budget in options.budgets:
            found, notes[f"{name}, {budget:g} s"], known[name] = measure(name, budget, peers)
            rows += found
    settings = {key: getattr(options, key) for key in ("width", "frames", "threads", "clock", "reference_seconds")}
    values = {"program": program(), **settings, "set": "short" if options.short else None, "short": options.short}
    values |= {"options": options.render_options, "references": known, "notes": notes, "rows": rows}
    save(CACHE / "flicker.json", values)
    record("flicker", values)
