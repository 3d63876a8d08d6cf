"""Puts the program's messages, which name files and options of the command line, into the words of Blender's interface."""

import re

from . import handoff

# Patterns and what replaces them, in this order: remedies first, then single options.
_WORDS = [(re.compile(pattern), words) for pattern, words in (
    (r"add --light-preset studio, --env, a lamp or an emissive material;[^)]*",
     "add a lamp or an emissive material, or give the world a strength"),
    (r"--light-preset chooses another light or none, --env an image", "add a lamp, or give the world a strength"),
    (r"--light-preset studio or --env gives one", "add a lamp, or give the world a strength"),
    (r", or choose another with --camera", ", or make another one the active camera"),
    (r"--effects [+-](\w+): left out", r"the effect '\1' is switched off in the panel Effects: left out"),
    (r"choose --method ([\w, ]+)", r"choose the Method \1 in the panel Method"),
    (r"--method (\w+)", r"the method \1"),
    (r"more --time\b", "more Time in the panel Stop"),
    (r"--time\b", "Time in the panel Stop"),
    (r"--iterations\b", "Iterations in the panel Stop"),
    (r"--target-error\b", "Error in the panel Stop"),
    (r"(a smaller )?--width\b", r"\1Resolution in Blender's panel Format"),
)]
_OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
_ARGUMENTS = "Arguments in the panel Method takes options"


def of_interface(line):
    """The program's message `line` for a user who sees neither the exported file nor a command line."""
    line = line.replace(f"{handoff.GLB}: ", "", 1)
    for pattern, words in _WORDS:
        line = pattern.sub(words, line)
    # A line that begins with an option is about what the user has given there.
    is_remedy = _OPTION.search(line) and not line.startswith("--")
    return f"{line} ({_ARGUMENTS})" if is_remedy else line
