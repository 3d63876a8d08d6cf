"""The program's last messages, for the panels. Files do not store them."""

#: {scene's name: warnings of its last render}
warnings = {}

#: {scene's name: fault that ended its last render}
faults = {}

#: {scene's name: its last `diagnosis.Plan`}
plans = {}


def clear():
    """Clear the warnings, faults and plans of all scenes, which the add-on's panels show."""
    warnings.clear()
    faults.clear()
    plans.clear()
