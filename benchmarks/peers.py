"""Compare formingx with NGSolve and FElupe: time, error and memory on the same problems, one thread each.

    ./fx python3 benchmarks/peers.py [--only treloar cup] [--codes formingx ngsolve] [--sizes 20x1 40x2] [--repeat 3]

On first use each peer gets a virtual environment of its own in .cache/peers, from PyPI. Their scripts are in
benchmarks/peers, a short file for each code and problem. Runs alternate; medians count. The error is relative to the
code's own solution on the finest mesh, so that no code is measured by another one.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
from pathlib import Path
from statistics import median

import numpy as np

ROOT = Path(__file__).parents[1]
PACKAGES = {"formingx": [], "ngsolve": ["ngsolve", "mkl"], "felupe": ["felupe", "contique", "pypardiso"]}
SIZES = {"treloar": ["10x1", "20x1", "40x2", "80x4"], "cup": ["20x1", "40x2", "80x4"],
         "loading": ["20x2", "60x6", "200x20", "400x40"],
         "plug": ["20x1", "40x2", "80x4", "160x8"]}
RESULT = {"treloar": "pressure", "cup": "thickness", "loading": "rise", "plug": "force"}
SECONDS, LONG = 600, 20                                     # of CPU that a run may take; from which on it is done once


def python(code):
    """Return the interpreter of a code."""
    if not PACKAGES[code]:
        return sys.executable
    folder = ROOT / ".cache" / "peers" / code
    if not (folder / "complete").exists():
        subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True)
        subprocess.run([folder / "bin" / "python3", "-m", "pip", "install", "-q", *PACKAGES[code]], check=True)
        (folder / "complete").touch()
    return folder / "bin" / "python3"


def script(code, case):
    return ROOT / "benchmarks" / "peers" / f"{code}_{case}.py"


def run(code, case, size):
    """Return the report of one run, or None if it fails (printed)."""
    command = [python(code), script(code, case), *size.split("x")]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(command, env=os.environ | threads, capture_output=True, text=True,
                          preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS)))
    if done.returncode:
        words = done.stderr.strip().splitlines()[-1:] or [f"ended by signal {-done.returncode}"]
        print(f"{code}, {case} {size}: {words[0]}", file=sys.stderr)
        return None
    return json.loads(done.stdout.splitlines()[-1])


def measure(case, codes, sizes, repeat):
    """Return {(size, code): medians}, with the error against the code's own solution of the last size."""
    found: dict = {}
    failed = set()
    for size in sizes:
        runs: dict = {code: [] for code in codes}
        for _ in range(repeat):
            for code in codes:
                if code in failed or runs[code] and runs[code][0]["path_cpu"] > LONG:
                    continue
                if one := run(code, case, size):
                    runs[code].append(one)
                else:
                    failed.add(code)                        # what is larger will not be done either
        for code in set(codes) - failed:
            found[size, code] = {key: median(one[key] for one in runs[code]) for key in runs[code][0]}
    for code in codes:
        mine = [row for (_, other), row in found.items() if other == code]
        for row in mine:
            row["error"] = abs(row[RESULT[case]] / mine[-1][RESULT[case]] - 1)
    return found


def table(found, codes, sizes):
    """Yield the lines of a Markdown table with a row for each size and code.

    All times but the wall time are processor times; the ratio is that of the paths.
    """
    yield ("| elements | code | unknowns | iterations | set-up, s | path, s | wall, s | error | memory, MB |"
           " path over formingx |")
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for size in sizes:
        for code in codes:
            if row := found.get((size, code)):
                own = found.get((size, "formingx"))
                ratio = f"{row['path_cpu'] / own['path_cpu']:.2g}" if own else ""
                error = f"{row['error']:.1e}" if row["error"] else "-"
                yield (f"| {size.replace('x', ' x ')} | {code} | {row['unknowns']:.0f} | {row['iterations']:.0f} |"
                       f" {row['setup_cpu']:.2g} | {row['path_cpu']:.3g} | {row['setup_wall'] + row['path_wall']:.3g} |"
                       f" {error} | {row['memory']:.0f} | {ratio} |")


def at_equal_error(found, codes, errors=(1e-2, 1e-3, 1e-4, 1e-5)):
    """Yield the lines of a Markdown table: processor seconds of the path at errors between runs (log-log)."""
    yield "| error |" + "".join(f" {code}, s |" for code in codes)
    yield "|---|" + "---|" * len(codes)
    for error in errors:
        cells: list[str] = []
        for code in codes:
            rows = sorted((row["error"], row["path_cpu"]) for (_, other), row in found.items()
                          if other == code and row["error"])
            inside = len(rows) > 1 and rows[0][0] <= error <= rows[-1][0]
            cells.append(f" {np.exp(np.interp(np.log(error), *np.log(np.array(rows)).T)):.3g} |" if inside else " |")
        if any(cell != " |" for cell in cells):
            yield f"| {error:g} |" + "".join(cells)


def draw(results, file):
    """Draw error against processor time of the path, and processor time of an iteration against unknowns."""
    from formingx import figures
    figure, (left, right) = figures.figure(2)
    for code in PACKAGES:
        rows = [row for row in results.get("treloar", []) if row["code"] == code and row["error"]]
        left.loglog([row["path_cpu"] for row in rows], [row["error"] for row in rows], "o-", label=code)
        rows = [row for row in results.get("loading", []) if row["code"] == code]
        right.loglog([row["unknowns"] for row in rows], [row["path_cpu"] / row["iterations"] for row in rows], "o-")
    left.set(xlabel="CPU of the path, s", ylabel="error of the last pressure", title="Treloar's sheet")
    right.set(xlabel="unknowns", ylabel="CPU of an iteration, s", title="a disc under pressure")
    left.legend(frameon=False, loc="upper center")
    figure.savefig(file, dpi=150)


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--only", nargs="+", choices=SIZES, default=list(SIZES), help="problems to run")
    options.add_argument("--codes", nargs="+", choices=PACKAGES, default=list(PACKAGES))
    options.add_argument("--sizes", nargs="+", help="elements along the radius and through the thickness, as 40x2")
    options.add_argument("--repeat", type=int, default=3)
    options.add_argument("--out", type=Path, default=Path("results/peers"),
                         help="folder for results; those of other runs are kept")
    args = options.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    summary = args.out / "summary.json"
    results = json.loads(summary.read_text()) if summary.exists() else {}
    print(f"Load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for case in args.only:
        sizes = args.sizes or SIZES[case]
        codes = [code for code in args.codes if script(code, case).exists()]
        found = measure(case, codes, sizes, args.repeat)
        results[case] = [{"size": size, "code": code, **row} for (size, code), row in found.items()]
        print(f"\n{case}\n", *table(found, codes, sizes), "", *at_equal_error(found, codes), sep="\n", flush=True)
    print(f"\nLoad of the machine: {os.getloadavg()[0]:.1f}")
    summary.write_text(json.dumps(results, indent=2))
    draw(results, args.out / "peers.png")


if __name__ == "__main__":
    main()
