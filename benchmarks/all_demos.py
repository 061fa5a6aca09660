"""Run all demos in turn and compare the numbers of their summaries with stored ones.

    ./fx python3 benchmarks/all_demos.py [DEMO ...] [--quick] [--against FOLDER] [--store] [--only-compare]

The stored numbers are those of `all_demos.json` beside this file, or of the summaries in the folders of `--against`,
such as those of an earlier run. Prints a table of differences; the exit status is 1 if a demo failed or a number
differs. Processor times are left out. All demos in full take hours.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
STORED = Path(__file__).with_suffix(".json")
NAMES = sorted(file.stem for file in (ROOT / "demos").glob("*.py") if "main()" in file.read_text())
SECONDS = 3600                                              # of wall time that a demo may take
RELATIVE, ABSOLUTE, COUNTED = 1e-4, 1e-9, 0.2               # of numbers; of what a run counts: it depends on round-off
COUNTS = {"steps", "states", "newton_iterations", "iterations", "cutbacks", "failures", "jumps"}
TIMES = ("seconds", "workers")


def run_demo(name: str, out: Path, quick: bool, limit: float = SECONDS) -> str:
    """Run a demo with its results in a folder; return the last line of its error, "" if it ended well."""
    command = [sys.executable, ROOT / "demos" / f"{name}.py", "--out", out, *["--quick"] * quick]
    try:
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=limit, cwd=ROOT)
    except subprocess.TimeoutExpired:
        return f"took more than {limit:g} s"
    except subprocess.CalledProcessError as error:
        return (error.stderr.strip() or str(error)).splitlines()[-1]
    return ""


def numbers(summary: Any, name: str = "") -> dict[str, Any]:
    """Return {path of keys: number, True, False or None} of a summary, without times and words."""
    if isinstance(summary, dict | list):
        items = summary.items() if isinstance(summary, dict) else enumerate(summary)
        found: dict[str, Any] = {}
        for key, value in items:
            found |= numbers(value, f"{name}/{key}".lstrip("/"))
        return found
    wanted = summary is None or isinstance(summary, bool | int | float)
    return {name: summary} if wanted and not any(word in name for word in TIMES) else {}


def differs(key: str, old: Any, new: Any, relative: float = RELATIVE) -> bool:
    """Return whether two values of a key differ by more than their tolerance."""
    if not all(isinstance(value, int | float) and not isinstance(value, bool) for value in (old, new)):
        return type(old) is not type(new) or old != new
    if key.rsplit("/", 1)[-1] in COUNTS:
        return abs(new - old) > max(COUNTED * abs(old), 2)
    return not abs(new - old) <= relative * max(abs(old), abs(new)) + ABSOLUTE


def differences(old: dict[str, Any], new: dict[str, Any], relative: float = RELATIVE) -> list[tuple[str, Any, Any]]:
    """Return (key, stored value, new value) where two summaries differ; "-" where one has no such key."""
    return [(key, old.get(key, "-"), new.get(key, "-")) for key in dict.fromkeys([*old, *new])
            if key not in old or key not in new or differs(key, old[key], new[key], relative)]


def table(rows: list[tuple[str, str, Any, Any]]) -> str:
    """Return a table of rows (demo, key, stored value, new value), with the relative differences."""
    lines = [f"{'demo and key':60}{'stored':>15}{'now':>15}{'off':>9}"]
    for demo, key, old, new in rows:
        both = all(isinstance(v, int | float) and not isinstance(v, bool) for v in (old, new))
        off = f"{(new - old) / old:9.1e}" if both and old and math.isfinite(new) else ""
        old, new = (f"{v:.8g}" if isinstance(v, float) else str(v) for v in (old, new))
        lines.append(f"{demo + ' ' + key:60}{old:>15}{new:>15}{off}")
    return "\n".join(lines)


def read(folder: Path, demo: str) -> dict[str, Any] | None:
    """Return the numbers of a demo's summary in a folder, or None if there is no summary."""
    file = folder / demo / "summary.json"
    return numbers(json.loads(file.read_text())) if file.exists() else None


def write(stored: dict[str, Any]) -> None:
    """Write the stored numbers, to 7 digits, a demo a line."""
    for found in stored.values():
        for demo, values in found.items():
            found[demo] = {key: float(f"{v:.7g}") if isinstance(v, float) else v for key, v in values.items()}
    kinds = [f'"{kind}": {{\n' + ",\n".join(f'"{demo}": {json.dumps(found[demo], separators=(",", ":"))}'
                                          for demo in sorted(found)) + "\n}" for kind, found in sorted(stored.items())]
    STORED.write_text("{\n" + ",\n".join(kinds) + "\n}\n")


def main() -> int:
    """Run the demos, compare their numbers and print; return the exit status."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("demos", nargs="*", metavar="DEMO", help="names without .py (default: all)")
    options.add_argument("--quick", action="store_true", help="run each with --quick")
    options.add_argument("--out", type=Path, default=ROOT / "results" / "all_demos", help="folder for the results")
    options.add_argument("--against", type=Path, help=f"folder of results to compare with (default: {STORED.name})")
    options.add_argument("--relative", type=float, default=RELATIVE, help="largest relative difference of a number")
    options.add_argument("--only-compare", action="store_true", help="run nothing: compare the results in the folder")
    options.add_argument("--store", action="store_true", help=f"store the new numbers in {STORED.name}")
    args = options.parse_args()
    if unknown := sorted({*args.demos} - {*NAMES}):
        options.error(f"no such demos: {', '.join(unknown)}; there are {', '.join(NAMES)}")
    kind = "quick" if args.quick else "full"
    stored: dict[str, Any] = json.loads(STORED.read_text()) if STORED.exists() else {}
    rows: list[tuple[str, str, Any, Any]] = []
    failed: list[str] = []
    for demo in args.demos or NAMES:
        began = time.perf_counter()
        why = "" if args.only_compare else run_demo(demo, args.out / demo, args.quick)
        new = None if why else read(args.out, demo)
        old = read(args.against, demo) if args.against else stored.get(kind, {}).get(demo)
        if new is None:
            failed.append(demo)
            print(f"{demo}: FAILED: {why or 'no summary'}", flush=True)
            continue
        found = [] if old is None else differences(old, new, args.relative)
        rows += [(demo, *row) for row in found]
        said = "nothing stored to compare with" if old is None else f"{len(found)} of {len(new)} numbers differ"
        print(f"{demo}: {said}; {time.perf_counter() - began:.0f} s", flush=True)
        if args.store:
            stored.setdefault(kind, {})[demo] = new
            write(stored)
    if rows:
        print(table(rows))
    print(f"{len(failed)} demos failed{': ' * bool(failed)}{', '.join(failed)}; {len(rows)} numbers differ")
    return int(bool(failed or rows))


if __name__ == "__main__":
    sys.exit(main())
