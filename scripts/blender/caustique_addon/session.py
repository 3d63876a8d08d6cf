"""The program's last messages, for the panels. Files do not store them."""

#: {scene's name: warnings of its last render}
warnings = {}

#: {scene's name: fault that ended its last render}
faults = {}

#: {scene's name: iterations of its last render, which the user has stopped}
stopped = {}

#: {scene's name: its last `diagnosis.Plan`}
plans = {}


def clear():
    """Clear what the add-on's panels show of all scenes."""
    warnings.clear()
    faults.clear()
    plans.clear()
    stopped.clear()
