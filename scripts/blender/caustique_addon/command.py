"""Builds the program's command line from the settings of a scene."""

import re
import shlex

from . import definition, properties
from .fault import Fault

#: Options allowed in the Arguments of a .blend: about the picture, without file names, because a .blend may come from
#: an untrusted source.
OPTIONS = frozenset(name.replace("_", "-") for name in definition.FILES_MAY_GIVE) | {"no-finish", "light-units", "strict"}


def method(settings):
    """Options that `render` and `plan` share: method, seed, stop conditions, effects, finish, and the user's
    arguments."""
    # The exporter writes lumens, so the program need not guess.
    words = ["--light-units", "photometric", "--method", settings.method, "--seed", str(settings.seed)]
    stops = (("use_iterations", "--iterations", settings.iterations), ("use_time", "--time", settings.time),
             ("use_error", "--target-error", settings.error / 100))
    for switch, option, value in stops:
        if getattr(settings, switch):
            words += [option, f"{value:.9g}"]
    off = [name for name in properties.EFFECTS if not getattr(settings, f"use_{name}")]
    if off:
        words.append("--effects=" + ",".join(f"-{name}" for name in off))
    if settings.finish == "off":
        words.append("--no-finish")
    elif settings.finish != "auto":
        words += ["--denoise", settings.finish]
    return words + additional(settings.arguments)


def additional(text):
    """Split the user's additional command-line arguments into words, and check them."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise Fault(f"the additional arguments cannot be read: {error}", "close every quotation mark") from error
    for before, word in zip([""] + words, words):
        # A value may begin with a dash where it is a number or a list of effects.
        option = re.match(r"-+[^=]*", word) if before != "--effects" and not re.match(r"-\.?\d", word) else None
        if option and option[0].removeprefix("--") not in OPTIONS:
            raise Fault(f"the additional arguments name {option[0]}, and a file may come from anybody",
                        "take it out: Arguments holds options about the picture, without files and permissions")
    return words


def resolution(width, height):
    """Command-line options that set the picture's `width` and `height` in pixels."""
    return ["--width", str(width), "--height", str(height)]


def threads(render):
    """Options for the number of threads in Blender's settings."""
    return ["--threads", str(render.threads)] if render.threads_mode == "FIXED" else []
