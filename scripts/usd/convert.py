"""Convert a USD stage (.usd, .usda, .usdc, .usdz) to a .glb that caustique renders.

    python3 scripts/usd/convert.py STAGE -o OUT.glb [--frame N] [--allow-outside]     print the files of the stage
    python3 scripts/usd/convert.py STAGE --arguments     print the options of `render` from its RenderSettings

The script needs the packages in scripts/requirements-usd.txt, such as `usd-core`, which composes the stage. `caustique
render STAGE` runs it. `extras.caustique` holds features that glTF lacks (docs/scene-format.md); an environment image is
written beside OUT.glb. The file's `losses` list all ignored or approximated features. An error is a line of JSON on
stderr, {"prim": path, "fault": text, "hint": remedy or null}, with exit code 1.
"""

import argparse
import contextlib
import json
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

from faults import Fault, text_of  # from this folder
from guard import limit_memory, run_guarded


@contextlib.contextmanager
def _checked_text():
    """Convert errors about text that is not UTF-8 to a Fault, because USD passes names and texts on unchecked."""
    try:
        yield
    except UnicodeDecodeError as error:
        raise Fault("", f"it holds a name or text that is not UTF-8: {error.object!r:.80}",
                    "write the stage again, in UTF-8")


def write(path, out, frame=None, allow_outside=False):
    """Convert the stage at `path` at time code `frame` to the .glb `out`. Returns the losses, a list of texts."""
    return _written(path, out, frame, allow_outside).losses.lines


@_checked_text()
def _written(path, out, frame, allow_outside):
    """Convert as `write`. Returns the stage."""
    from scene import Scene
    from stage import Stage
    stage = Stage(path, frame, allow_outside)
    scene = Scene(stage, os.path.dirname(os.path.abspath(out)))
    scene.fill()
    scene.document.write(out)
    return stage


@_checked_text()
def arguments(path, allow_outside=False):
    """Options of `caustique render` from the RenderSettings of the stage at `path`, a list of texts."""
    from render_settings import Settings
    from stage import Stage
    return Settings(Stage(path, None, allow_outside)).arguments()


def main(given):
    """Run the command line. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="convert.py")
    parser.add_argument("stage", help=".usd, .usda, .usdc or .usdz")
    parser.add_argument("-o", "--output", metavar="OUT.glb")
    parser.add_argument("--arguments", action="store_true", help="print options of caustique render as JSON")
    parser.add_argument("--frame", type=float, metavar="N", help="time code [default: the stage's first]")
    parser.add_argument("--allow-outside", action="store_true",
                        help="let the stage name files outside its own folder")
    parser.add_argument("--guard", type=int, nargs=2, metavar=("SECONDS", "BYTES"), help=argparse.SUPPRESS)
    parser.add_argument("--confined", type=int, metavar="BYTES", help=argparse.SUPPRESS)
    words, given = given, parser.parse_args(given)
    if given.arguments == bool(given.output):
        parser.error("give either -o OUT.glb or --arguments")
    if given.guard is None:
        return _convert(given) if given.confined is None else _convert_confined(given)
    script, guard = os.path.abspath(__file__), words.index("--guard")
    words = [*words[:guard], *words[guard + 3:], "--confined", str(given.guard[1])]
    python = [sys.executable, "-I", "-B", *(["-S"] if sys.flags.no_site else [])]
    try:
        return run_guarded([*python, script, *words], os.path.dirname(script), *given.guard)
    except Fault as fault:
        return _print_error(fault.where, fault.fault, fault.hint)


def _convert_confined(given):
    """Convert as `_convert`, in a process of its own. USD looks for layers beside the stage alone."""
    limit_memory(given.confined)
    if not given.allow_outside:
        given.stage, given.output = (path and os.path.abspath(path) for path in (given.stage, given.output))
        # USD would also look in the current folder and in those of this variable.
        os.environ.pop("PXR_AR_DEFAULT_SEARCH_PATH", None)
        with contextlib.suppress(OSError):
            os.chdir(os.path.dirname(given.stage))
    return _convert(given)


def _convert(given):
    """Convert and print the files of the stage, or print the arguments. Returns the exit code."""
    try:
        if given.arguments:
            print(json.dumps(arguments(given.stage, given.allow_outside)))
        else:
            stage = _written(given.stage, given.output, given.frame, given.allow_outside)
            print(json.dumps(sorted(stage.files)))
        return 0
    except Fault as fault:
        where, what, hint = fault.where, fault.fault, fault.hint
    except ImportError as error:
        where, what = "", f"{sys.executable} lacks a module: {error}"
        hint = ("run 'scripts/setup.sh usd', or install what scripts/requirements-usd.txt lists (pip install usd-core "
                "numpy OpenEXR pillow mapbox-earcut) and set CAUSTIQUE_USD_PYTHON to that Python")
    except MemoryError:
        where, what, hint = "", "the stage takes more memory than there is", "use a simpler stage or smaller textures"
    except Exception as error:  # USD raises many kinds of errors about invalid stages
        fault = Fault("", f"USD says: {text_of(error)}")
        where, what, hint = fault.where, fault.fault, fault.hint
    return _print_error(where, what, hint)


def _print_error(where, what, hint):
    print(json.dumps({"prim": where, "fault": what, "hint": hint}), file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
