"""Command lines of the program, and its JSON output."""

import json
import subprocess

from .cache import BIN


def command(*words, program=BIN, **options):
    """A command line as texts. The option `max_depth=4` becomes `--max-depth 4`, `reproducible=True` the flag alone; an
    option of None is left out."""
    line = [program, *words]
    for name, value in options.items():
        if value is not None:
            line += [f"--{name.replace('_', '-')}", *([] if value is True else [value])]
    return list(map(str, line))


def read(*arguments):
    """The JSON object that a command prints."""
    done = subprocess.run(
        command(*arguments, json=True), check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    return json.loads(done.stdout)
