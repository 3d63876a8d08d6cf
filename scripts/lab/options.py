"""The arguments of the figures. A figure lists those it takes with its defaults as ARGUMENTS; `options` holds the values
of this run, which the modules that figures share read, too."""

import argparse
import shlex
from typing import NamedTuple

options = argparse.Namespace()


class Argument(NamedTuple):
    """How the text of an argument is read, and its help."""

    read: object
    help: str


def names(text):
    """Names with commas between them."""
    return [name for name in text.split(",") if name]


def numbers(text):
    """Numbers with commas between them."""
    return [float(number) for number in names(text)]


def integers(text):
    """Integers with commas between them."""
    return [int(number) for number in names(text)]


def budget(text):
    """A number of seconds, or of anything else."""
    return float(text)


KNOWN = {
    "before": Argument(str, "a commit, which is built in a folder of the cache, or a program"),
    "block": Argument(int, "side of the blocks that choose a level, pixels"),
    "budgets": Argument(numbers, "seconds of a render, a render each"),
    "clock": Argument(str, "wall, or cpu: budgets are core-seconds over threads"),
    "denoise": Argument(names, "what --denoise is given, a render each; `default` gives none"),
    "engines": Argument(names, "schedulers of farms"),
    "height": Argument(int, "height of the pictures, pixels"),
    "iterations": Argument(int, "iterations of a render"),
    "largest": Argument(int, "triangles of the largest scene"),
    "levels": Argument(str, "bandwidth levels of our renders; `default` leaves them to the method"),
    "methods": Argument(names, "methods that are measured"),
    "moments": Argument(int, "kills of a method's render"),
    "name": Argument(str, "a name for what is stored, beside what is stored without one"),
    "peers": Argument(names, "other renderers with their modes"),
    "photons": Argument(integers, "light paths of an iteration; more than one number: a render each"),
    "places": Argument(str, "x,y,x,y: two pixels"),
    "reference_seconds": Argument(budget, "seconds or core-seconds of a reference, or of each of its halves"),
    "render_options": Argument(shlex.split, "more options of our renders, one argument in quotes"),
    "rounds": Argument(int, "times that everything is measured; the least counts"),
    "saves": Argument(int, "checkpoints that are timed"),
    "scenes": Argument(names, "names below scenes/, such as pool,second/still,twin/pool"),
    "seconds": Argument(budget, "seconds or core-seconds of a render"),
    "seed": Argument(int, "seed of the moments"),
    "seeds": Argument(int, "renders of each kind"),
    "set": Argument(str, "first, second, all, or twins: scenes as far as peers' drivers can translate them"),
    "shards": Argument(int, "shards of a picture"),
    "spp": Argument(int, "samples per pixel"),
    "threads": Argument(int, "threads of a render"),
    "width": Argument(int, "width of the pictures, pixels"),
}


def shown(value):
    """A default as it would be typed."""
    return (
        ",".join(f"{one:g}" if isinstance(one, float) else str(one) for one in value)
        if isinstance(value, list)
        else value
    )


def parser(name, figure, short):
    """The parser of a figure. `short`: whether the defaults are those of its short form."""
    made = argparse.ArgumentParser(
        prog=f"scripts/lab.sh {name}", description=figure.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    defaults = getattr(figure, "ARGUMENTS", {})
    if hasattr(figure, "SHORT"):
        made.add_argument("--short", action="store_true", help="half an hour on two cores")
        defaults = defaults | (figure.SHORT if short else {})
    for key, value in defaults.items():
        known, flag = KNOWN[key], f"--{key.replace('_', '-')}"
        told = "" if value is None else f" [default: {shown(value)}]"
        made.add_argument(flag, type=known.read, default=value, help=known.help + told, metavar=key.upper())
    if hasattr(figure, "add_arguments"):
        figure.add_arguments(made)
    return made


def parse(name, figure, words):
    """Reads a figure's arguments into `options`."""
    parser(name, figure, "--short" in words).parse_args(words, namespace=options)
