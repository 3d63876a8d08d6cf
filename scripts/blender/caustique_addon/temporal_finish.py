"""The temporal finish of animations: each frame is finished again with its neighbours, while later frames render.

The program's EXRs of the frames are kept in the folder `temporal` beside Blender's files, where `caustique finish` writes
the finished frames. A frame is finished as soon as the second one after it is rendered; the last two are finished at the
end of the animation.
"""

import contextlib
import glob
import os
import pathlib
import shutil
import subprocess

import bpy

from . import session

_REACH = 2  # frames on each side with which the program averages a frame
_FOLDER = "temporal"
_ENDS = bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel, bpy.app.handlers.load_pre
#: Layers that the finish needs, besides those of the passes.
_LAYERS = ("all", "Motion", "Quarter")
_VECTORS = ("the temporal finish has no motion vectors, and takes all that moves for another surface: switch on Passes > "
            "Data > Vector of the view layer")


def applies(scene, is_animation):
    """Whether the frames of a render are finished with their neighbours."""
    settings = scene.caustique_render
    return is_animation and settings.use_temporal and settings.finish != "off"


def layers(chosen):
    """The value of `--layers`, from its value without a temporal finish."""
    named = [name for name in chosen.split(",") if name not in {"beauty", *_LAYERS}]
    return ",".join([*_LAYERS, *named])


def with_seed_of_frame(words, frame):
    """The options of the method with another seed for each frame, because equal noise does not average out."""
    at = words.index("--seed") + 1
    return [*words[:at], str((int(words[at]) + frame) % 2**31), *words[at + 1:]]


class _Sequence:
    """The frames of a view layer, in a folder."""

    def __init__(self, folder, name):
        self.input, self.output = (os.path.join(folder, f"{name}{part}.####.exr") for part in (".frame", ""))
        self.frames, self._waiting, self._process, self._frame, self.faults = [], [], None, None, []
        for old in pathlib.Path(folder).glob(f"{glob.escape(name)}.frame.*.exr"):
            old.unlink()  # of an earlier render, whose frames are no neighbours

    def add(self, frame, source, words):
        """Keep a frame's EXR, and finish those whose neighbours are all rendered."""
        shutil.copyfile(source, self.input.replace("####", f"{frame:04}"))
        self.frames.append(frame)
        self._waiting.append((frame, words))
        while self._waiting and self._waiting[0][0] + _REACH <= frame and self._is_idle():
            self._start(*self._waiting.pop(0))

    def end(self):
        """Finish the frames that wait, and delete those that were kept."""
        self._wait()
        for frame, words in self._waiting:
            self._start(frame, words)
            self._wait()
        self._waiting = []
        self._discard(self.frames)

    def _is_idle(self):
        if self._process is not None and self._process.poll() is None:
            return False
        self._wait()
        return True

    def _start(self, frame, words):
        self._frame = frame
        line = [words[0], "finish", self.input, "-o", self.output, "--png", self.output.replace(".exr", ".png"),
                "--frames", str(frame), *words[1:]]
        self._process = subprocess.Popen(line, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.PIPE, text=True)

    def _wait(self):
        """Wait for the frame that is being finished, and note its fault."""
        if self._process is None:
            return
        _, said = self._process.communicate()
        if self._process.returncode:
            lines = said.strip().splitlines() or ["it said nothing"]
            self.faults.append(f"frame {self._frame} is not finished with its neighbours: {lines[0]}")
        self._process = None
        self._discard([frame for frame in self.frames if frame <= self._frame - _REACH])  # later frames do not need them

    def _discard(self, frames):
        """Delete the files of frames that were kept."""
        for frame in frames:
            with contextlib.suppress(OSError):
                os.remove(self.input.replace("####", f"{frame:04}"))
        self.frames = [frame for frame in self.frames if frame not in frames]


_sequences = {}  # {(scene's name, view layer's name): _Sequence}


def keep(scene, layer, frame, source, program):
    """Keep the EXR `source` of a frame that is rendered, and finish the frames that have all their neighbours. Returns
    warnings."""
    key = scene.name, layer.name
    if key not in _sequences:
        folder = os.path.join(os.path.dirname(bpy.path.abspath(scene.render.frame_path(frame=frame))), _FOLDER)
        os.makedirs(folder, exist_ok=True)
        _sequences[key] = _Sequence(folder, bpy.path.clean_name(layer.name))
    denoiser = scene.caustique_render.finish
    words = [program] + (["--denoise", denoiser] if denoiser != "auto" else [])
    if scene.render.threads_mode == "FIXED":
        words += ["--threads", str(scene.render.threads)]
    _sequences[key].add(frame, source, words)
    return [] if layer.use_pass_vector else [f'view layer "{layer.name}": {_VECTORS}']


@bpy.app.handlers.persistent
def end(*_):
    """Finish the last frames of a render."""
    while _sequences:
        (scene, _), sequence = _sequences.popitem()
        sequence.end()
        for fault in sequence.faults:
            print("warning: " + fault)
            session.warnings.setdefault(scene, []).append(fault)


def register():
    """End the finish with the render."""
    for handlers in _ENDS:
        handlers.append(end)


def unregister():
    """Stop that."""
    for handlers in _ENDS:
        handlers.remove(end)
    end()
