"""The arguments of figures. A figure lists its arguments with their defaults as ARGUMENTS. `options` holds the values of
this run, for the figure and for the modules that figures share."""

import argparse
import shlex
from typing import NamedTuple

options = argparse.Namespace()


class Argument(NamedTuple):
    """The parser of an argument's text, and its help."""

    read: object
    help: str


def names(text):
    """A comma-separated list of names."""
    return [name for name in text.split(",") if name]


def numbers(text):
    """A comma-separated list of numbers."""
    return [float(number) for number in names(text)]


def integers(text):
    """A comma-separated list of integers."""
    return [int(number) for number in names(text)]


def budget(text):
    """A number of seconds."""
    return float(text)


KNOWN = {
    "before": Argument(str, "another build of the program"),
    "model": Argument(str, "the file of a network of the finish"),
    "budgets": Argument(numbers, "seconds of a render; one render for each number"),
    "clock": Argument(str, "wall, or cpu: budgets are core-seconds divided by threads"),
    "denoise": Argument(names, "values of --denoise; one render for each; `default` omits the option"),
    "frames": Argument(int, "frames of each shot, from the first"),
    "iterations": Argument(int, "iterations of a render"),
    "methods": Argument(names, "methods to measure"),
    "name": Argument(str, "a name for the stored figure, so that it does not replace the unnamed one"),
    "peers": Argument(names, "other renderers with their modes"),
    "reference_seconds": Argument(budget, "seconds or core-seconds of a reference, or of each of its halves"),
    "render_options": Argument(shlex.split, "more options of our renders, one argument in quotes"),
    "rounds": Argument(int, "number of repetitions; the fastest counts"),
    "scenes": Argument(names, "names below scenes/, such as pool,second/still,twin/pool, or paths that end in .glb"),
    "seconds": Argument(budget, "seconds or core-seconds of a render"),
    "seeds": Argument(int, "number of renders of each kind, with different seeds"),
    "set": Argument(
        str,
        "first, second, all, twins: scenes without features that other renderers' drivers lack, "
        "or random: a scene of each family of the training data",
    ),
    "shots": Argument(names, "animated shots: pool, turntable, interior, gems"),
    "target": Argument(float, "relative error that stops a render"),
    "threads": Argument(int, "threads of a render"),
    "width": Argument(int, "width of the pictures, in pixels"),
}


def shown(value):
    """A default as a user would type it."""
    if not isinstance(value, list):
        return value
    return ",".join(f"{one:g}" if isinstance(one, float) else str(one) for one in value)


def parser(name, figure, short):
    """The parser of a figure's arguments; `short` selects the defaults of its short form."""
    made = argparse.ArgumentParser(
        prog=f"scripts/lab.sh {name}", description=figure.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    defaults = getattr(figure, "ARGUMENTS", {})
    if hasattr(figure, "SHORT"):
        made.add_argument("--short", action="store_true", help="half an hour on two cores")
        defaults = defaults | (figure.SHORT if short else {})
    for key, value in defaults.items():
        known, flag = KNOWN[key], f"--{key.replace('_', '-')}"
        default = "" if value is None else f" [default: {shown(value)}]"
        made.add_argument(flag, type=known.read, default=value, help=known.help + default, metavar=key.upper())
    if hasattr(figure, "add_arguments"):
        figure.add_arguments(made)
    return made


def parse(name, figure, words):
    """Reads a figure's arguments into `options`."""
    parser(name, figure, "--short" in words).parse_args(words, namespace=options)
