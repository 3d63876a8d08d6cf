"""The command line of the program for what a scene says."""

import shlex

from . import properties
from .fault import Fault


def method(settings):
    """Options that `render` and `plan` share: method, seed, when to stop, effects, finish, and what the user adds."""
    words = ["--method", settings.method, "--seed", str(settings.seed)]
    stops = (("use_iterations", "--iterations", settings.iterations), ("use_time", "--time", settings.time),
             ("use_error", "--target-error", settings.error / 100))
    for switch, option, value in stops:
        if getattr(settings, switch):
            words += [option, f"{value:.9g}"]
    off = [name for name in properties.EFFECTS if not getattr(settings, f"use_{name}")]
    if off:
        words.append("--effects=" + ",".join(f"-{name}" for name in off))
    if settings.finish == "off":
        words.append("--no-combine")
    elif settings.finish != "auto":
        words += ["--denoise", settings.finish]
    try:
        return words + shlex.split(settings.arguments)
    except ValueError as error:
        raise Fault(f"the additional arguments cannot be read: {error}", "close every quotation mark") from error


def size(width, height):
    """Options for a picture of so many pixels."""
    return ["--width", str(width), "--height", str(height)]


def threads(render):
    """Options for the threads that Blender's settings allow."""
    return ["--threads", str(render.threads)] if render.threads_mode == "FIXED" else []
