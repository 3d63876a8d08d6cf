"""Tables of farms: engines, merges, kills, checkpoints, and the model of scale."""

import scale

from .markdown import digits, table


def engines(figures):
    """By engine: what was killed, and the number of channels that equal those of one render."""
    of = figures.one("farms")
    rows = []
    for row in of["rows"]:
        same = f"{row['same']} of {row['channels']}"
        rows.append([row["engine"], row["killed"], str(row["shards"]), same, f"{row['seconds']:.0f}"])
    return table(["engine", "killed", "shards", "channels equal to those of one render", "seconds"], rows)


def merges(figures):
    """Seconds and memory of merging many shards, and of rendering one."""
    rows = []
    for of in sorted(figures.all("merge64"), key=lambda of: of["rule"]):
        cells = [f"`{of['rule']}`", f"{of['shards']}", f"{of['shard']['file_mib']:.0f}"]
        cells += [f"{of['one']['seconds']:.0f}", f"{of['all']['seconds']:.0f} ({of['all']['core_seconds']:.0f})"]
        peaks = [of["shard"]["peak_mib"], of["one"]["peak_mib"], of["all"]["peak_mib"]]
        rows.append([*cells, *(f"{peak:,}" for peak in peaks)])
    head = ["method", "shards", "file of a shard, MiB", "merge of one, s", "merge of all, s (core-s)"]
    return table([*head, "peak memory of a shard, MiB", "of a merge of one", "of the merge of all"], rows)


def kills(figures):
    """Killed renders, by method."""
    rows = []
    for of in figures.one("kills")["rows"]:
        numbers = [str(of[key]) for key in ("kills", "resumed", "halves", "same")]
        rows.append([f"`{of['method']}`", *numbers])
    return table(
        ["method", "kills", "resumed from a checkpoint", "with an unfinished file (`.part`)", "equal bytes"], rows
    )


def checkpoints(figures):
    """Seconds and size of a checkpoint, by method."""
    of = figures.one("checkpoints")
    rows = [
        [f"`{row['method']}`", f"{row['seconds']:.1f} ({row['slowest']:.1f})", f"{row['mib']}", f"{row['percent']:.1f}"]
        for row in of["rows"]
    ]
    return table(["method", "seconds (slowest)", "MiB", f"per cent of the time, every {of['every']} s"], rows)


def costs(figures):
    """The measured costs of the model of scale."""
    values = figures.one("scale")
    names = {
        "load": "before the pilot",
        "pilot": "pilot of guided light paths",
        "iteration": "an iteration",
        "write": "writing a shard's file",
        "each": "merging a shard",
        "finish": "the rest of a merge: finish and layers",
    }
    rows = [[text, *(digits(values[size][name]) for size in ("small", "large"))] for name, text in names.items()]
    rows.append(["file of a shard, MiB", *(digits(values[size]["file"] / 2**20) for size in ("small", "large"))])
    width = values["width"]
    return table(["core-seconds", f"{width // 4} x {width * 9 // 64}", f"{width} x {width * 9 // 16}"], rows)


def choices(figures):
    """The model's choices by number of cores, for one picture and for a shot, and the shares of the time."""
    values = figures.one("scale")
    of, rows = scale.costs_of(values["large"]), []
    for frames in (1, 1000):
        for cores in (1, 4, 16, 64, 256, 1000, 4000, 10000):
            farm, job = scale.best(of, cores, frames, values["iterations"])
            parts = scale.predict(of, farm, job)
            total = sum(parts.values())
            shares = [f"{100 * sum(parts[name] for name in names) / total:.0f} %" for names in SHARES.values()]
            rows.append([f"{frames:,}", f"{cores:,}", str(farm.threads), str(job.shards), f"{total:,.0f}", *shares])
    return table(["frames", "cores", "cores per task", "shards per picture", "seconds", *SHARES], rows)


SHARES = {
    "iterations": ("iterations",),
    "start and load": ("start", "load"),
    "pilot": ("pilot",),
    "files": ("write",),
    "merge": ("merge",),
    "finish": ("finish",),
}

KINDS = {
    "farms": engines,
    "merge64": merges,
    "kills": kills,
    "checkpoints": checkpoints,
    "scale-costs": costs,
    "scale-choices": choices,
}
