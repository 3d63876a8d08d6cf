"""Wraps long text in panels, because Blender's labels have one line and cut off the rest."""

import textwrap

_LETTER_PIXELS = 6.5  # average width of a letter of the interface's font at scale 1
_MARGIN_PIXELS = 70  # beside the text: icon and borders of the panel


def draw(layout, context, text, icon="NONE"):
    """Add `text` to `layout`, wrapped to the width of the region."""
    scale = context.preferences.system.ui_scale
    room = max(int((context.region.width / scale - _MARGIN_PIXELS) / _LETTER_PIXELS), 20)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(text, room) or [""]):
        column.label(text=line, icon=icon if number == 0 else "BLANK1" if icon != "NONE" else "NONE")


def draw_fault(layout, context, fault):
    """Add a fault to `layout`, with its remedy below."""
    box = layout.box()
    draw(box, context, fault.what, "ERROR")
    if fault.remedy:
        draw(box, context, fault.remedy, "TOOL_SETTINGS")
