"""Command line: python -m formingx [demo NAME | check SCRIPT | compare OURS THEIRS | COMMAND FOLDER]."""

from __future__ import annotations

import argparse
import ast
import os
import runpy
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from . import InputError, compare
from .results.files import checkpoint_data, status
from .results.files.column_table import PRINTED_ROWS
from .results.show import report
from .units import NONE, Units

_COMPARE = """Compare a run's CSV file with another program's curve: differences, limit points, a picture.
The header of THEIRS names its columns and may state units: pressure [psi]."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command with `arguments`, None: those of this process; return the exit status, 2 for a wrong argument."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        if words[:1] == ["demo"]:
            _demo(words[1:])
        else:
            options = _parser().parse_args(words)
            {"compare": _compare, "check": _check, "open": _open, "report": _report, "status": _status,
             "watch": _watch, None: lambda _: _say(_overview())}[options.command](options)
    except BrokenPipeError:                                 # the reading program, such as head, has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (InputError, OSError) as error:
        if MPI.COMM_WORLD.rank == 0:
            print(f"formingx: {error}", file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    """Return the parser of the command line, for all commands but `demo`."""
    parser = argparse.ArgumentParser(prog="python -m formingx", description=_overview(),
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    commands.add_parser("demo", help="run a demo: demo NAME [its options]")
    check = commands.add_parser("check", help="look over the scene of a script", description="Look over the first"
                                " scene that a script runs, and its targets: the script is executed up to there, and"
                                " nothing is solved.")
    check.add_argument("script", metavar="SCRIPT", help="a Python file")
    check.add_argument("arguments", nargs=argparse.REMAINDER, help="its own options")
    comparison = commands.add_parser("compare", help="compare two curves",
                                     formatter_class=argparse.RawDescriptionHelpFormatter, description=_COMPARE)
    comparison.add_argument("ours", metavar="OURS", help="CSV file of a run (Path.to_csv)")
    comparison.add_argument("theirs", metavar="THEIRS",
                            help="CSV file of the other program, rows in order along its path")
    comparison.add_argument("--columns", nargs="+", metavar="OURS=THEIRS", default=[],
                            help="columns that belong together, at least two (a bare NAME: the same on both sides);"
                                 " default: the first two that both have, of two walls the first and the wall")
    comparison.add_argument("--units", nargs="+", metavar="OURS=UNIT", default=[],
                            help="of a column of ours: a factor for theirs, or our unit, if their header states theirs")
    comparison.add_argument("--out", type=Path, default=Path("results") / "compare",
                            help="folder for curves.png and pairs.csv (default: %(default)s)")
    contents = commands.add_parser("open", help="show what is in a checkpoint", description="Show what is in a"
                                   " checkpoint: the scene, the states, how the run ended.")
    report_ = commands.add_parser("report", help="make a report of a checkpoint", description="Make one HTML file of a"
                                  " checkpoint: inputs, curves, thickness, convergence.")
    status_ = commands.add_parser("status", help="show how far a run has come", description="Show where a run with a"
                                  " checkpoint stands: stage, target, what limits its steps, admissibility, time left.")
    watch = commands.add_parser("watch", help="show the status again and again", description="Show the status of a run"
                                " whenever it has new states, until it ends, has had none for --patience seconds, or"
                                " Ctrl-C.")
    for entry in (contents, report_, status_, watch):
        entry.add_argument("folder", metavar="FOLDER", help="a checkpoint (trace(..., checkpoint=FOLDER), Path.save)")
    report_.add_argument("--out", type=Path, help="the HTML file (default: report.html in the checkpoint)")
    report_.add_argument("--title", default="", help="heading of the report")
    report_.add_argument("--units", metavar="LENGTH,STRESS", help="units of the script, such as mm,MPa")
    report_.add_argument("--density", type=float, help="of the material in g/cm3, for the weight")
    report_.add_argument("--trim", type=float, metavar="R", help="radius at which the part is cut off")
    watch.add_argument("--every", type=float, default=5.0, metavar="SECONDS",
                       help="time between two looks (default: 5)")
    watch.add_argument("--patience", type=float, default=600.0, metavar="SECONDS",
                       help="how long a run may be without a new state (default: 600)")
    return parser


def _overview() -> str:
    """Return the list of commands and demos as text, which is printed if there are no arguments."""
    lines = ["formingx: finite element simulation of polymer forming.", "", "Commands:",
             "  demo NAME [OPTIONS]        run a demo (demo NAME --help: its options)",
             "  check SCRIPT               look over the scene of a script before it runs",
             "  compare OURS THEIRS        compare two curves (compare --help)",
             "  open FOLDER                show what is in a checkpoint",
             "  status, watch FOLDER       show how far a run with a checkpoint has come, once or again and again",
             "  report FOLDER              make one HTML file of a checkpoint (report --help)", ""]
    demos = _demos()
    if not demos:
        return "\n".join([*lines, "No demos here: they are in the folder demos/ of the checkout."])
    width = max(map(len, demos))
    return "\n".join([*lines, "Demos:", *(f"  {name:{width}}  {line}" for name, line in demos.items())])


def _folder() -> Path:
    """Return the folder of the repository that contains the demos."""
    return Path(__file__).resolve().parents[1] / "demos"


def _demos() -> dict[str, str]:
    """Return {name: first line of the docstring} of the demos."""
    found = {}
    for file in sorted(_folder().glob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        if any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
            found[file.stem] = (ast.get_docstring(tree) or "").partition("\n")[0]
    return found


def _demo(words: list[str]) -> None:
    """Run a demo in this process, like `python demos/NAME.py OPTIONS`, also under mpirun; words: name and options."""
    demos = _demos()
    listed = ", ".join(demos) or f"none; {os.fspath(_folder())} holds no demo"
    if not words:
        raise InputError(f"demo: needs a NAME; known: {listed}")
    name, *options = words
    if name in ("-h", "--help"):
        _say(_overview())
        return
    if name not in demos:
        raise InputError(f"demo {name!r} is not known; known: {listed}")
    script = os.fspath(_folder() / f"{name}.py")
    before = sys.argv, sys.path[:]
    sys.argv, sys.path[:0] = [script, *options], [os.fspath(_folder())]
    try:
        runpy.run_path(script, run_name="__main__")
    finally:
        sys.argv, sys.path[:] = before


def _check(options: argparse.Namespace) -> None:
    """Run the command `check`: print the findings on the first scene of the script `options.script`."""
    from .checks.scripts import check_script
    _say(str(check_script(options.script, options.arguments)))


def _compare(options: argparse.Namespace) -> None:
    """Run `compare`: print the differences of two curves, and write a picture and a table of pairs to folder `out`."""
    comm = MPI.COMM_WORLD
    columns = {our: their or our for our, their in (_pair("--columns", word, False) for word in options.columns)}
    units: dict[str, float | str] = {}
    for our, unit in (_pair("--units", word, True) for word in options.units):
        try:
            units[our] = float(unit)
        except ValueError:
            units[our] = unit
    found = compare(options.ours, options.theirs, columns=columns or None, units=units)
    _say(str(found))
    found.to_csv(options.out / "pairs.csv", comm)
    if comm.rank == 0:
        found.plot().savefig(options.out / "curves.png", dpi=150)
    _say(f"Results are in {options.out}/: curves.png, pairs.csv")


def _open(options: argparse.Namespace) -> None:
    """Run the command `open`: print scene, states and end of the run in the checkpoint `options.folder`."""
    about, states = checkpoint_data.contents(options.folder)
    record = report.of_checkpoint(about, states)
    width = max(map(len, record.summary))
    lines = [f"{part:{width}}  {line}" for part, line in record.summary.items()]
    _say("\n".join([*lines, "", *_states(record), "", *record.warnings()]).rstrip())


def _states(record: report.ReportData) -> list[str]:
    """Return the lines of a table of states of a run: limit points, jumps, ends of stages, and others evenly spaced."""
    ends = ("process_time", "pressure", "travel", "displacement", "pole_height", "pole_stretch", "contact_length")
    columns = [c for end in ends for c in record.measures if c.endswith(end)][:6]
    n, stages = len(record.kinds), record.stages
    marked = [k for k in range(n) if record.kinds[k] in ("limit point", "jump") or stages[k:k + 2] != [stages[k]] * 2]
    room = max(2 * PRINTED_ROWS - len(marked), 2)
    shown = sorted({*marked, *np.linspace(0, n - 1, min(n, room)).round().astype(int).tolist()})
    lines = [f"{'state':>5}  {'kind':12}" + "".join(f"{c.replace('_', ' '):>16}" for c in columns)]
    lines += [f"{k:5}  {record.kinds[k]:12}" + "".join(f"{record.measures[c][k]:16.8g}" for c in columns)
              + f"  {stages[k]}".rstrip() for k in shown]
    return lines + [f"({n - len(shown)} more states)"] * (len(shown) < n)


def _report(options: argparse.Namespace) -> None:
    """Run the command `report`: write the report of the checkpoint `options.folder` to an HTML file."""
    out = options.out or Path(options.folder) / "report.html"
    record = report.of_checkpoint(*checkpoint_data.contents(options.folder))
    report.write(record, out, options.title, None, MPI.COMM_WORLD, _units(options.units), options.density,
                 options.trim)
    _say(f"The report is in {out}")


def _units(given: str | None) -> Units:
    """Return the units of the value of the option --units, such as mm,MPa; for None units without names."""
    if given is None:
        return NONE
    length, comma, stress = given.partition(",")
    if not comma:
        raise InputError(f"--units {given!r}: must be LENGTH,STRESS, such as mm,MPa")
    return Units(length.strip(), stress.strip())


def _status(options: argparse.Namespace) -> None:
    """Run the command `status`: print the status of the run with the checkpoint `options.folder`."""
    _say(str(status.of_folder(options.folder)))


def _watch(options: argparse.Namespace) -> None:
    """Run the command `watch`: print the status of the run with the checkpoint `options.folder` at each new state."""
    if not checkpoint_data.begun(options.folder):
        _say(f"waiting up to {options.patience:g} s for a run to write its first state to {options.folder}")
    for found in status.watch(options.folder, options.every, options.patience):
        _say(str(found))


def _pair(option: str, word: str, both: bool) -> tuple[str, str]:
    """Return the parts of OURS=THEIRS, else an InputError; unless `both` are needed, OURS alone gives (OURS, "")."""
    ours, equals, theirs = word.partition("=")
    if not ours or (equals or both) and not theirs:
        raise InputError(f"{option} {word!r}: must be {'COLUMN=UNIT or COLUMN=FACTOR' if both else 'OURS=THEIRS'}")
    return ours, theirs


def _say(text: str) -> None:
    """Print a text on rank 0."""
    if MPI.COMM_WORLD.rank == 0:
        print(text, flush=True)


if __name__ == "__main__":
    sys.exit(main())
