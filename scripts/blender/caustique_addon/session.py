"""What the program has said last, for the panels to show. It is not kept in files."""

#: Lines that the last render of each scene has warned of, by the scene's name.
warnings = {}

#: The last plan of each scene, as `diagnosis` leaves it, by the scene's name.
plans = {}


def clear():
    """Forget all."""
    warnings.clear()
    plans.clear()
