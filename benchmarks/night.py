"""Run everything that takes long, in pieces that resume, and write a page of what moved.

    ./fx python3 benchmarks/night.py [WORD ...] [--minutes 9] [--jobs 2] [--again WORD]

Pieces are the demos in full against their stored numbers, each slow test, random calls (`fuzz.py`), random moulds,
failures (`reliability.py`) and BLAS kernels (`kernels.py`). A slow test of a demo reads what that demo has written.
WORD chooses the pieces whose names contain it. A call returns after so many minutes, and prints how many pieces are
left; a piece that is under way goes on, and the next call waits for it. A piece that ended is not run again, unless
`--again` names it. The page is `results/night/page.md`. The exit status is 0 if all pieces ended and nothing moved, 1
if something moved, 3 if pieces are left.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import all_demos
import kernels

ROOT = Path(__file__).parents[1]
SECONDS = 3 * 3600                                          # of wall time that a piece may take
SEEDS, CALLS = 10, 1000                                     # of random calls
MOULDS = range(101, 125, 2)                                 # first seeds of pieces of two random moulds


def python(*command: Any) -> list[str]:
    """Return a command of this Python in the checkout."""
    return [sys.executable, *map(str, command)]


def pieces(out: Path) -> dict[str, list[str]]:
    """Return {name: command}; a demo has no command, for its numbers are compared here."""
    found: dict[str, list[str]] = {f"demo {name}": [] for name in all_demos.NAMES}
    for test in slow_tests(out):
        found[f"test {test.removeprefix('tests/test_')}"] = python("-m", "pytest", "-m", "slow", "-n", 0, test)
    for seed in range(SEEDS):
        found[f"fuzz seed {seed}"] = python("benchmarks/fuzz.py", "--calls", CALLS, "--seed", seed)
    for first in MOULDS:
        found[f"moulds {first}"] = python("benchmarks/random_moulds.py", "--seeds", 2, "--first", first, "--out",
                                          out / f"moulds_{first}")
    for part in ("bad", "ranks", "restarts", "files"):
        found[f"reliability {part}"] = python("benchmarks/reliability.py", part)
    for kernel in kernels.available():
        found[f"kernel {kernel}"] = python("benchmarks/kernels.py", kernel, "--out", out / "kernels")
    return found


def slow_tests(out: Path) -> list[str]:
    """Return the slow tests, file::function, asked of pytest once."""
    file = out / "slow_tests.json"
    if not file.exists():
        command = python("-m", "pytest", "-o", "addopts=", "--collect-only", "-q", "-m", "slow")
        listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
        names = dict.fromkeys(line.partition("[")[0] for line in listed.splitlines() if "::" in line)
        file.write_text(json.dumps(list(names)))
    return list(json.loads(file.read_text()))


def file_of(out: Path, name: str) -> Path:
    """Return the file with the result of a piece."""
    return out / "pieces" / ("".join(c if c.isalnum() else "_" for c in name) + ".json")


def run_piece(out: Path, name: str, command: list[str]) -> None:
    """Run a piece, and write its result: whether it failed, what it printed last, the numbers that moved."""
    began, moved, failed, text = time.time(), [], "", ""
    environment = {**os.environ, "FORMINGX_DEMOS": str(out / "demos")}
    if command:
        with (file_of(out, name).with_suffix(".txt")).open("w+") as printed:
            try:
                code = subprocess.run(command, cwd=ROOT, stdout=printed, stderr=subprocess.STDOUT, timeout=SECONDS,
                                      check=False, env=environment).returncode
                failed = f"ended with {code}" if code else ""
            except subprocess.TimeoutExpired:
                failed = f"took more than {SECONDS} s"
            printed.seek(0)
            text = "\n".join(printed.read().splitlines()[-12:])
    else:
        demo = name.split()[1]
        failed = all_demos.run_demo(demo, out / "demos" / demo, False, SECONDS)
        new, stored = all_demos.read(out / "demos", demo), json.loads(all_demos.STORED.read_text())["full"].get(demo)
        if not failed and new is None:
            failed = "no summary"
        elif not failed and stored is not None:
            moved = [(demo, *row) for row in all_demos.differences(stored, new)]
    result = {"name": name, "failed": failed, "moved": moved, "text": text, "seconds": time.time() - began}
    new_file = file_of(out, name).with_suffix(".new")
    new_file.write_text(json.dumps(result))
    new_file.replace(file_of(out, name))


def runs(pid: int) -> bool:
    """Return True if a process runs, and is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def under_way(out: Path) -> dict[str, int]:
    """Return {name: process} of the pieces that run now; a piece whose process was killed is forgotten."""
    found = {}
    for file in (out / "pieces").glob("*.pid"):
        name, pid = json.loads(file.read_text())
        if runs(pid):
            found[name] = pid
        else:
            file.unlink()
    return found


def start(out: Path, name: str) -> None:
    """Start a piece as a process that outlives this one."""
    process = subprocess.Popen(python(__file__, "--piece", name, "--out", out), start_new_session=True,
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    file_of(out, name).with_suffix(".pid").write_text(json.dumps([name, process.pid]))


def page(out: Path, names: list[str]) -> tuple[str, int]:
    """Return the page, and how many pieces failed or moved."""
    done = [json.loads(file.read_text()) for file in map(lambda name: file_of(out, name), names) if file.exists()]
    failed, rows = [one for one in done if one["failed"]], [row for one in done for row in one["moved"]]
    seconds = sum(one["seconds"] for one in done)
    lines = ["# What moved", "", f"{len(done)} of {len(names)} pieces ended, in {seconds:.0f} s; {len(failed)} failed,"
             f" {len(rows)} numbers of demos moved.", ""]
    for one in failed:
        lines += [f"## {one['name']}: {one['failed']}", "", "```text", one["text"], "```", ""]
    if rows:
        lines += ["## Numbers of demos", "", "```text", all_demos.table(rows), "```", ""]
    lines += ["## Pieces", "", "| piece | seconds | |", "|---|---|---|"]
    lines += [f"| {one['name']} | {one['seconds']:.0f} | {one['failed'] or len(one['moved']) or ''} |" for one in done]
    return "\n".join(lines) + "\n", len(failed) + len(rows)


def main() -> int:
    """Run pieces until the time is up, and write the page."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("words", nargs="*", metavar="WORD", help="pieces whose names contain a word (default: all)")
    options.add_argument("--minutes", type=float, default=9.0, help="time after which this command returns")
    options.add_argument("--jobs", type=int, default=os.cpu_count(), help="pieces at a time")
    options.add_argument("--again", action="append", default=[], metavar="WORD", help="forget these pieces' results")
    options.add_argument("--out", type=Path, default=ROOT / "results" / "night", help="folder for results and page")
    options.add_argument("--piece", help=argparse.SUPPRESS)
    args = options.parse_args()
    out = args.out.resolve()
    (out / "pieces").mkdir(parents=True, exist_ok=True)
    commands = pieces(out)
    if args.piece:
        run_piece(out, args.piece, commands[args.piece])
        return 0
    names = [name for name in commands if not args.words or any(word in name for word in args.words)]
    for name in names:
        if any(word in name for word in args.again):
            file_of(out, name).unlink(missing_ok=True)
            shutil.rmtree(out / "demos" / name.split()[1], ignore_errors=True)
    end = time.monotonic() + 60 * args.minutes
    while True:
        now, left = under_way(out), [name for name in names if not file_of(out, name).exists()]
        waiting = [name for name in left if name not in now]
        if not left or time.monotonic() > end:
            break
        for name in waiting[: max(args.jobs - len(now), 0)]:
            print(name, flush=True)
            start(out, name)
        time.sleep(1.0)
    text, bad = page(out, names)
    (out / "page.md").write_text(text)
    print(text.splitlines()[2], f"{len(left)} pieces are left; the page is {out / 'page.md'}")
    return 3 if left else int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
