"""Write the pages of data/*.template with the numbers of the demos' and benchmarks' summaries.

    ./fx python3 docs/make_pages.py [--collect FOLDER] [--check]

The text of NAME.md stands in `data/NAME.template`, the comparisons of `validation.md` in `validation_rows.py`; the
numbers come from `data/summaries.json`. `--collect results` renews those numbers from the files
FOLDER/NAME/summary.json that are there. `--check` writes nothing; the exit status is 1 if a page is not what it would
write.

In the template `{{NAME/KEY/KEY FORMAT}}` is a number of results/NAME/summary.json in Python's format, and
`{{A OVER B FORMAT}}` a quotient of two, less 1 if the format is a percentage (`+.1%`). `{{TABLE NAME}}` is a table of
comparisons.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))
from validation_rows import TABLES, Row  # noqa: E402

STORED = DOCS / "data" / "summaries.json"
TEMPLATES = {file.stem: file for file in sorted((DOCS / "data").glob("*.template"))}
PLACE, OVER = re.compile(r"\{\{(.+?)\}\}"), " OVER "
HEAD = "<!-- Written by docs/make_pages.py from data/{}.template: do not change this page. -->\n"
WIDTH, DIGITS = 140, 12                                      # columns of a filled page, digits of a stored number
FILLED = {"validation"}                                      # pages whose paragraphs are filled anew


def paths(template: str) -> Iterator[str]:
    """Yield NAME/KEY/... of every number that a page needs."""
    for place in PLACE.findall(template):
        if not place.startswith("TABLE "):
            yield from place.rsplit(" ", 1)[0].split(OVER)
            continue
        for row in TABLES[place.removeprefix("TABLE ")]:
            yield from (path for key in (row.ours, row.reference) if isinstance(key, str) for path in key.split(OVER))


def wanted() -> set[str]:
    """Return NAME/KEY/... of every number of all pages."""
    return {path for template in TEMPLATES.values() for path in paths(template.read_text())}


def found(summary: Any, path: str) -> Any:
    """Return a summary's value at KEY/KEY/...; a key may be the index of a list. Raises a KeyError."""
    for key in path.split("/"):
        summary = summary[int(key)] if isinstance(summary, list) else summary[key]
    return summary


def collect(folder: Path, needed: set[str], stored: dict[str, Any]) -> dict[str, Any]:
    """Return {path: number} of all needed paths: those of the folder's summaries, else the stored ones.

    Raises:
        KeyError: paths that neither has.
    """
    summaries: dict[str, Any] = {}
    for name in {path.split("/")[0] for path in needed}:
        file = folder / name / "summary.json"
        if file.is_file():
            summaries[name] = json.loads(file.read_text())
    result, missing = {}, []
    for path in sorted(needed):
        name, _, rest = path.partition("/")
        try:
            value = found(summaries[name], rest) if name in summaries else stored[path]
        except (KeyError, IndexError, ValueError):
            missing.append(path)
            continue
        result[path] = float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
    if missing:
        raise KeyError(f"no number for {', '.join(missing)}: run the demo or benchmark, then collect its results")
    return result


def number(text: str, numbers: dict[str, Any]) -> Any:
    """Return the number at `PATH`, or the quotient of those at `PATH OVER PATH`."""
    one, *other = (numbers[path] for path in text.split(OVER))
    return one / other[0] if other else one


def cell(text: str, style: str, numbers: dict[str, Any]) -> str:
    """Return `number(text)` in a format; a quotient as a percentage is less 1."""
    value = number(text, numbers)
    if style.endswith("%"):
        digits = style.removesuffix("%")
        return f"{100 * (value - (OVER in text)):{digits if digits.endswith('g') else digits + 'f'}} %"
    return "none" if value is None else format(value, style)


def table(rows: list[Row], numbers: dict[str, Any]) -> str:
    """Return the lines of a table of comparisons."""
    lines = ["| what | ours | reference | deviation | reference from | script |", "|---|---|---|---|---|---|"]
    for row in rows:
        def shown(value: float, row: Row = row) -> str:
            return f"{value:{row.style}} {row.unit}".rstrip()
        ours, reference, deviation = number(row.ours, numbers), row.reference, row.note
        if isinstance(reference, str):
            reference = number(reference, numbers)
        elif callable(reference):
            reference = reference()
        if reference is not None:
            off = ours - reference if row.absolute else ours / reference - 1
            exact = f"{off:+.1e}" if row.absolute or abs(off) < 1e-3 else f"{100 * off:+.1f} %"
            deviation = "; ".join(filter(None, ("below 1e-9" if abs(off) < 1e-9 else exact, row.note)))
        beside = "" if reference is None else shown(reference) if reference else "0"
        lines.append(f"| {row.what} | {shown(ours)} | {beside} | {deviation} | {row.source} |"
                     f" `{row.ours.split('/')[0]}` |")
    return "\n".join(lines)


def wrapped(text: str) -> str:
    """Return a page whose paragraphs and items are filled to `WIDTH` columns; tables and headings stay."""
    blocks = []
    for lines in (block.splitlines() for block in text.split("\n\n")):
        if lines and not lines[0].startswith(("|", "#", "!", "<", "```")):
            items = "\n".join(lines).replace("\n* ", "\n\n* ").split("\n\n")
            lines = [line for item in items for line in textwrap.wrap(
                " ".join(item.split()), WIDTH, subsequent_indent="  " * item.startswith("* "), break_long_words=False,
                break_on_hyphens=False)]
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks) + "\n"


def page(name: str, template: str, numbers: dict[str, Any]) -> str:
    """Return the whole page of a template."""
    def put(match: re.Match[str]) -> str:
        place = match[1]
        if place.startswith("TABLE "):
            return table(TABLES[place.removeprefix("TABLE ")], numbers)
        return cell(*place.rsplit(" ", 1), numbers)
    text = PLACE.sub(put, template)
    return HEAD.format(name) + (wrapped(text) if name in FILLED else text)


def main() -> int:
    """Run the command; return its exit status."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--collect", type=Path, metavar="FOLDER", help="renew the stored numbers from it")
    options.add_argument("--check", action="store_true", help="write nothing; status 1 if a page is not up to date")
    args = options.parse_args()
    numbers = json.loads(STORED.read_text()) if STORED.is_file() else {}
    if args.collect:
        numbers = collect(args.collect, wanted(), numbers)
        STORED.write_text(json.dumps(numbers, indent=1) + "\n")
    pages = {DOCS / f"{name}.md": page(name, file.read_text(), numbers) for name, file in TEMPLATES.items()}
    if args.check:
        return int(any(not file.is_file() or file.read_text() != text for file, text in pages.items()))
    for file, text in pages.items():
        file.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
