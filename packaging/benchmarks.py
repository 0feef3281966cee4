"""The history of what `make bench` prints, and a page that shows it.

Usage: benchmarks.py add HISTORY COMMIT < OUTPUT, which appends a line of JSON; benchmarks.py page HISTORY FILE.html."""

import datetime
import html
import json
import os
import pathlib
import platform
import re
import sys

#: A figure with its unit. Text before it, up to the figure before, names it.
FIGURE = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?) (ns|ms|s|MB|Mrow/s)\b")
WIDTH, HEIGHT = 220, 36


def figures(text: str) -> dict[str, float]:
    """Name with unit to value, for each figure of each line that has a time."""
    found = {}
    for line in text.splitlines():
        matches = list(FIGURE.finditer(line))
        if not any(m[2] in ("ns", "ms", "s") for m in matches):
            continue
        begin, head = 0, ""
        for match in matches:
            words = " ".join(re.sub(r"[:;,()]", " ", line[begin : match.start()]).split())
            head = head or words
            name = head if words in ("", head) else f"{head}: {words}"
            key = f"{name}, {match[2]}"
            # A line may have two figures of one unit between which it has no word, as the sizes of a file and of the memory.
            found[f"{key} (2)" if key in found else key] = float(match[1])
            begin = match.end()
    return found


def add(history: pathlib.Path, commit: str) -> None:
    text = sys.stdin.read()
    measured = figures(text)
    if not measured:
        sys.exit("benchmarks.py: the output has no figure")
    now = datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d %H:%M")
    machine = f"{platform.machine()}, {os.cpu_count()} processors"
    with history.open("a") as file:
        file.write(json.dumps({"date": now, "commit": commit, "machine": machine, "figures": measured}) + "\n")


def curve(values: list[float | None]) -> str:
    """A line through the values, from 0 to the largest."""
    top = max(v for v in values if v is not None) or 1.0
    step = WIDTH / max(len(values) - 1, 1)
    points = " ".join(f"{k * step:.1f},{HEIGHT - 2 - (HEIGHT - 4) * v / top:.1f}" for k, v in enumerate(values) if v is not None)
    return f'<svg width="{WIDTH}" height="{HEIGHT}" role="img" aria-label="history"><polyline points="{points}" fill="none" stroke="#06c" stroke-width="1.5"/></svg>'


def page(history: pathlib.Path) -> str:
    runs = [json.loads(line) for line in history.read_text().splitlines()]
    last = runs[-1]
    rows = []
    for name, value in last["figures"].items():
        past = [run["figures"].get(name) for run in runs]
        known = [v for v in past if v is not None]
        rows.append(f"<tr><td>{html.escape(name)}</td><td>{value:g}</td><td>{min(known):g} to {max(known):g}</td><td>{curve(past)}</td></tr>")
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>mimu, benchmarks</title>'
        "<style>body { font: 16px sans-serif; margin: 2em; max-width: 60em } td, th { text-align: left; padding: 0.2em 1em 0.2em 0 }</style>"
        f"<h1>Benchmarks of mimu</h1><p>What <code>make bench</code> measured, in {len(runs)} runs; the last on {last['date']} UTC at commit "
        f"<code>{html.escape(last['commit'][:8])}</code> ({html.escape(last['machine'])}). Machines differ by tens of per cent from run to run.</p>"
        f"<table><tr><th>figure, unit</th><th>last</th><th>lowest to highest</th><th>history, from 0</th></tr>{''.join(rows)}</table></html>\n"
    )


def main(words: list[str]) -> None:
    match words:
        case ["add", history, commit]:
            add(pathlib.Path(history), commit)
        case ["page", history, output]:
            pathlib.Path(output).write_text(page(pathlib.Path(history)))
        case _:
            sys.exit(__doc__)


main(sys.argv[1:])
