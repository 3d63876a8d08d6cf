"""Text of many words in a panel: Blender's labels are one line each and cut what is longer."""

import textwrap

_LETTER = 6.5  # pixels, a letter of the interface's font at scale 1, about
_MARGIN = 70  # pixels beside the text: icon and borders of the panel


def draw(layout, context, text, icon="NONE"):
    """Write `text` into `layout` on as many lines as the region is narrow."""
    scale = context.preferences.system.ui_scale
    room = max(int((context.region.width / scale - _MARGIN) / _LETTER), 20)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(text, room) or [""]):
        column.label(text=line, icon=icon if number == 0 else "BLANK1" if icon != "NONE" else "NONE")


def draw_fault(layout, context, fault):
    """Write what is wrong, and below it the remedy."""
    box = layout.box()
    draw(box, context, fault.what, "ERROR")
    if fault.remedy:
        draw(box, context, fault.remedy, "TOOL_SETTINGS")
