"""What the program has said last, for the panels to show. It is not kept in files."""

#: Lines that the last render of each scene has warned of, by the scene's name.
warnings = {}

#: The fault that the last render of each scene has ended with, by the scene's name.
faults = {}

#: The last plan of each scene, as `diagnosis` leaves it, by the scene's name.
plans = {}


def clear():
    """Forget all."""
    warnings.clear()
    faults.clear()
    plans.clear()
