"""The page of results, one file: pictures, verdicts with their numbers, answers with their derivations."""

import base64
import html
import io
import shlex

import numpy as np
from PIL import Image

COLOURS = {"met": "#2a7d3f", "known": "#b3261e", "failed": "#b3261e", "passed": "#8a6d00", "cannot": "#777"}
WORDS = {
    "met": "met",
    "known": "known to fail",
    "failed": "FAILED",
    "passed": "passes, although known to fail",
    "cannot": "cannot be translated",
}
STYLE = """body{font:15px/1.45 sans-serif;max-width:72em;margin:2em auto;padding:0 1em;color:#222;background:#fff}
table{border-collapse:collapse;margin:.5em 0}td,th{padding:.2em .7em .2em 0;text-align:left;vertical-align:top}
img{width:96px;height:96px;image-rendering:pixelated;border:1px solid #999}figure{display:inline-block;margin:.2em}
figcaption{font-size:11px;max-width:96px;overflow-wrap:anywhere}code{font-size:12px;overflow-wrap:anywhere}
h3{margin-bottom:0}.word{color:#fff;padding:0 .5em;border-radius:.3em;white-space:nowrap}"""


def page(results):
    """The page, as text."""
    families = {}
    for result in results:
        families.setdefault(result.case.family, {}).setdefault(result.case.name, []).append(result)
    body = [f"<h2>{_text(family)}</h2>" + "".join(map(_case, cases.values())) for family, cases in families.items()]
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>Hard cases</title><style>{STYLE}</style>"
        f"<h1>Hard cases</h1><p>{_counts(results)}. A verdict compares a deviation with a stated bound and with noise "
        "at the error rate of four standard errors. Pictures are of the first seed, each scaled to its brightest pixel."
        f"</p>{_overview(results)}{''.join(body)}</html>"
    )


def _counts(results):
    return ", ".join(
        f"{sum(r.state == state for r in results)} {word}"
        for state, word in WORDS.items()
        if any(r.state == state for r in results)
    )


def _overview(results):
    """The table of verdicts by case and method."""
    methods = list(dict.fromkeys(r.method for r in results))
    rows = {}
    for result in results:
        rows.setdefault(result.case.name, {})[result.method] = result
    head = "".join(f"<th>{_text(m)}</th>" for m in methods)
    lines = "".join(
        f"<tr><td><a href='#{name}'>{_text(name)}</a></td>"
        + "".join(f"<td>{_word(of[m].state) if m in of else ''}</td>" for m in methods)
        + "</tr>"
        for name, of in rows.items()
    )
    return f"<table><tr><th>case</th>{head}</tr>{lines}</table>"


def _case(results):
    case = results[0].case
    rows = "".join(
        f"<tr><td>{_text(r.method)}</td><td>{_word(r.state)}</td><td>{_text(r.verdict.figure)}{_reason(r)}</td>"
        f"<td>{r.seconds:.1f} s</td></tr>"
        for r in results
    )
    pictures = "".join(_figures(r) for r in results)
    command = next((r.commands[0] for r in results if r.commands), [])
    return (
        f"<h3 id='{case.name}'>{_text(case.name)}</h3><p>{_text(case.title)}. <b>Answer:</b> "
        f"{_text(case.answer.derivation)}</p><table>{rows}</table>{pictures}"
        f"<details><summary>command</summary><code>{_text(shlex.join(command))}</code></details>"
    )


def _reason(result):
    reason = result.case.fails.get(result.method)
    return f"<br><i>{_text(reason)}</i>" if reason else ""


def _figures(result):
    top = max((float(np.nanmax(p)) for p in result.pictures.values() if np.isfinite(p).any()), default=1.0) or 1.0
    return "".join(
        f"<figure><img alt='' src='{png(picture / top)}'><figcaption>{_text(result.method)} {_text(label)}"
        "</figcaption></figure>"
        for label, picture in result.pictures.items()
    )


def png(picture):
    """A picture of linear values from 0 to 1 as a data URL of a PNG."""
    bytes_ = np.uint8(np.round(255 * np.clip(np.nan_to_num(picture), 0, 1) ** (1 / 2.2)))
    out = io.BytesIO()
    Image.fromarray(bytes_).save(out, "png")
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()


def _word(state):
    return f"<span class=word style='background:{COLOURS[state]}'>{WORDS[state]}</span>"


def _text(value):
    return html.escape(str(value), quote=True)
