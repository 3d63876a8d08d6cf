"""Tables and numbers as Markdown."""


def table(head, rows):
    """Markdown of a table. `rows`: cells of text."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def digits(value):
    """Two significant digits, zeros among them; a dash for nothing."""
    return "-" if value is None else f"{value:#.2g}".rstrip(".")
