"""Families of random scenes to train the combiner with. A family is a function of a random generator.

python -m lab.train.families FAMILY INDEX ATTEMPT FILE.glb    (in .venv-bpy)
"""

# Modules and their families; a view of a family is a number of its random generator.
FAMILIES = {
    "rooms": [
        "closed_box",
        "window_room",
        "glazed_room",
        "lamp_room",
        "mirror_room",
        "corridor",
        "bookshelf",
        "breakfast",
    ],
    "glassware": ["tumblers", "goblets", "bottles", "glass_balls", "glass_solids", "fluted", "lenses", "frosted"],
    "water": ["pool", "night_pool", "tub", "aquarium", "puddles", "water_light", "waves"],
    "many_lights": ["stage", "bulbs", "shades", "neon", "small_lights", "studio"],
    "gems": ["jewels", "prisms", "rings", "reflectors", "brushed", "matte_things"],
    "fog_and_milk": ["foggy_room", "smoky_stage", "milky", "wax", "dusty_window"],
    "exteriors": ["courtyard", "facade", "garden", "night_street", "terrace"],
}
# Families without any training data.
HELD_OUT = ("bookshelf", "aquarium")


def module_of(family):
    """The module that defines a family."""
    return next(module for module, names in FAMILIES.items() if family in names)


def names():
    """All families."""
    return [name for group in FAMILIES.values() for name in group]
