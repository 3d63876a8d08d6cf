"""All cases, family by family, in the order of the page."""

import importlib

#: Modules of cases; each has a TITLE and CASES.
MODULES = ("magnitude", "lights", "roughness", "refraction", "grazing", "geometry", "furnace", "media", "determinism")


def cases():
    """All cases, in order, each with its family's title."""
    found = []
    for name in MODULES:
        module = importlib.import_module(f".{name}", __package__)
        for case in module.CASES:
            case.family = module.TITLE
            found.append(case)
    return found
