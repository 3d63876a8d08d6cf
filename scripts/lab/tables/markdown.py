"""Tables and numbers as Markdown."""


def table(head, rows):
    """A table in Markdown, from the cells of its head and its rows."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def digits(value):
    """A number with two significant digits, including zeros, or a dash for None."""
    return "-" if value is None else f"{value:#.2g}".rstrip(".")
