"""Export a .blend for the program, which embeds this script: `caustique render IN.blend`.

    blender -b --factory-startup --disable-autoexec --python export_blend.py -- IN.blend OUT.glb [options]
    python -I export_blend.py -- IN.blend OUT.glb [options]                                in a Python that has bpy

The last line on stdout is a JSON list of the files that the scene is read from. An error is a line of JSON on stderr,
{"place": text, "fault": text, "hint": remedy or null}, with exit code 1. The process ends when its standard input closes,
because the program has ended then, and removes its own folder, which the program made.
"""

import argparse
import glob
import itertools
import json
import os
import shutil
import sys
import threading

try:
    import resource
except ModuleNotFoundError:  # Windows
    resource = None

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

_HERE = os.path.dirname(os.path.abspath(__file__))
_OLDEST = (4, 2, 0)  # the exporter needs the materials and the glTF exporter of this version
# Patterns for the tokens that stand for the number of a tile in the path of a texture.
_TILES = {"<UDIM>": "[0-9]" * 4, "<UVTILE>": "u[0-9]*_v[0-9]*"}
_CHOOSE = "set CAUSTIQUE_BLENDER to another Blender, or to a Python in which 'pip install bpy' has been run"


class Fault(Exception):
    """An error for the user: the fault, its remedy, and its place in the file."""

    def __init__(self, fault, hint=None, place=""):
        super().__init__(fault)
        self.fault, self.hint, self.place = fault, hint, place


def end(fault=None):
    """End the process, with an error if there is one. Blender as a module may hang while it shuts down."""
    if fault is not None:
        print("\n" + json.dumps({"place": fault.place, "fault": fault.fault, "hint": fault.hint}), file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0 if fault is None else 1)


def watch(seconds):
    """End the process after `seconds`, or when its standard input closes."""
    late = Fault(f"the export takes longer than {seconds} s", "simplify the scene, or set CAUSTIQUE_BLENDER_SECONDS to more")
    clock = threading.Timer(seconds, end, [late])
    clock.daemon = True
    clock.start()
    os.read(sys.stdin.fileno(), 1)  # `sys.stdin` has a lock that Python wants when it exits
    # Remove only a folder that the program made for this export.
    if os.path.basename(_HERE).startswith("caustique-blend-"):
        shutil.rmtree(_HERE, ignore_errors=True)
    os._exit(1)


def convert(given):
    """Export the file. Returns the files that it is read from."""
    try:
        import bpy
    except ModuleNotFoundError as error:
        raise Fault(f"{sys.executable} has no Blender: {error}", _CHOOSE) from error
    if bpy.app.version < _OLDEST:
        raise Fault(f"Blender {bpy.app.version_string} is too old to export it: 4.2 or newer is needed", _CHOOSE)
    try:
        # Python in the file does not run: a file may come from anybody.
        bpy.ops.wm.open_mainfile(filepath=given.blend, load_ui=False, use_scripts=False)
    except RuntimeError as error:
        raise Fault(f"Blender cannot open it: {last_line(error)}", "open it in Blender, and save it again") from error
    files = files_of(bpy, given.allow_outside)
    scene = scene_of(bpy, given.scene)
    for layer in scene.view_layers if given.motion_vectors else ():
        layer.use_pass_vector = True
    # Makes the dependency graph the active one: only that writes animated values of materials to their data.
    bpy.context.evaluated_depsgraph_get()
    if given.frame is not None:
        scene.frame_set(given.frame)
    import export  # imports bpy, which is there by now
    export.write(given.glb)
    return files


def scene_of(bpy, name):
    """The scene of this name, opened; the open one without a name."""
    if name is not None:
        if name not in bpy.data.scenes:
            raise Fault(f'there is no scene "{name}"', "its scenes are " + ", ".join(f'"{s.name}"' for s in bpy.data.scenes))
        bpy.context.window.scene = bpy.data.scenes[name]
    return bpy.context.scene


def files_of(bpy, allow_outside):
    """The existing files that the open file is read from, itself included. Files outside its folder are a Fault unless they
    are allowed: a file may come from anybody, and a picture of its scene may be published."""
    own = os.path.realpath(bpy.data.filepath)
    bundled = os.path.realpath(bpy.utils.system_resource("DATAFILES") or own)
    found = {own}
    named = (_existing(path) for path in bpy.utils.blend_paths(absolute=True))
    for path in map(os.path.realpath, itertools.chain.from_iterable(named)):
        if _lies_in(path, bundled):
            continue
        if not (allow_outside or _lies_in(path, os.path.dirname(own))):
            raise Fault(f"it names the file {path}, which is outside its folder",
                        "pack the file into the .blend, put it beside it, or allow such files with --allow-outside")
        if os.path.isfile(path):
            found.add(path)
    return sorted(found)


def _existing(path):
    """The files and folders that a path in a .blend stands for: a path with a token stands for all tiles of a texture."""
    pattern = glob.escape(path)
    for token, tiles in _TILES.items():
        pattern = pattern.replace(token, tiles)
    return glob.glob(pattern)


def _lies_in(path, folder):
    return path.startswith(os.path.join(folder, ""))


def last_line(error):
    """The last line of an error: operators of Blender put a whole traceback into its text."""
    return ([line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__])[-1][:300]


def main(arguments):
    """Run the command line, and end the process."""
    parser = argparse.ArgumentParser(prog="export_blend.py")
    parser.add_argument("blend", metavar="IN.blend")
    parser.add_argument("glb", metavar="OUT.glb")
    parser.add_argument("--frame", type=int, help="[default: the current one]")
    parser.add_argument("--scene", help="name of the scene [default: the open one]")
    parser.add_argument("--motion-vectors", action="store_true", help="export the frames before and after, too")
    parser.add_argument("--allow-outside", action="store_true", help="let the file name files outside its own folder")
    parser.add_argument("--seconds", type=int, default=3600, help="time limit")
    parser.add_argument("--bytes", type=int, default=0, help="memory limit; 0 for none")
    given = parser.parse_args(arguments)
    if given.bytes and resource is not None:
        resource.setrlimit(resource.RLIMIT_DATA, (given.bytes, given.bytes))
    threading.Thread(target=watch, args=(given.seconds,), daemon=True).start()
    try:
        print("\n" + json.dumps(convert(given)))
    except Fault as fault:
        end(fault)
    except MemoryError:
        end(Fault("the scene takes more memory than there is", "simplify it, or use smaller textures"))
    except Exception as error:  # any error of Blender: a message and an exit code, never a hanging process
        import export_guard
        place = getattr(error, "place", "")
        end(Fault(f"the scene cannot be exported: {type(error).__name__}: {last_line(error)}",
                  export_guard.remedy(place), place))
    end()


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1:])
