"""Run the quick tests and five scenes under each BLAS kernel of this processor, and list every difference.

    ./fx python3 benchmarks/kernels.py [KERNEL ...] [--out FOLDER]

OpenBLAS chooses a kernel by the processor; the environment variable OPENBLAS_CORETYPE forces one. Kernels round
differently. A test that passes under one kernel and fails under another, or a number of a scene that differs by more
than 1e-6, depends on round-off: a fault of the scene, of the code or of the test. Each kernel is compared with the one
that OpenBLAS chooses itself. Without KERNEL all that the processor has are run, one after the other; what ended is
stored.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import all_demos

ROOT = Path(__file__).parents[1]
NEEDED = {"Nehalem": {"sse4_2"}, "Sandybridge": {"avx"}, "Haswell": {"avx2", "fma"},
          "SkylakeX": {"avx512f", "avx512dq", "avx512bw", "avx512vl"}, "Cooperlake": {"avx512_bf16", "avx512f"}}
"""{kernel of OpenBLAS: instructions of the processor that it needs}."""
SCENES = ("treloar", "cup", "williams_plug", "viscoelastic_tube", "bottle_3_to_1")
RELATIVE = 1e-6


def available() -> list[str]:
    """Return the kernels that this processor has the instructions for."""
    found = re.search(r"^flags\s*:(.*)$", Path("/proc/cpuinfo").read_text(), re.M)
    flags = set(found.group(1).split()) if found else set()
    return [kernel for kernel, needed in NEEDED.items() if needed <= flags]


def environment(kernel: str) -> dict[str, str]:
    """Return the environment of a process under a kernel, "" for the one that OpenBLAS chooses."""
    plain = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    return plain | {"OPENBLAS_CORETYPE": kernel} if kernel else plain


def used(kernel: str) -> str:
    """Return the name of the kernel that OpenBLAS uses under an environment."""
    script = "import numpy; numpy.ones((2, 2)) @ numpy.ones((2, 2))"
    said = subprocess.run([sys.executable, "-c", script], env=environment(kernel) | {"OPENBLAS_VERBOSE": "2"},
                          capture_output=True, text=True, check=True)
    names = re.findall(r"Core: (\w+)", said.stdout + said.stderr)
    return names[0] if names else "unknown"


def outcomes(kernel: str) -> dict[str, str]:
    """Return {test: passed, failed, ...} of the quick tests under a kernel."""
    done = subprocess.run([sys.executable, "-m", "pytest", "-o", "addopts=", "-q", "-rA", "-m", "quick and not slow",
                           "-n", "auto", "--tb=no"], cwd=ROOT, env=environment(kernel), capture_output=True, text=True,
                          check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"pytest ended with {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return {test: word.lower() for word, test in re.findall(r"^(PASSED|FAILED|ERROR|XFAIL) (\S+)", done.stdout, re.M)}


def scene_numbers(kernel: str, out: Path) -> dict[str, dict[str, Any]]:
    """Return {scene: numbers of its summary} of the quick scenes under a kernel."""
    found = {}
    for name in SCENES:
        folder = out / (kernel or "default") / name
        subprocess.run([sys.executable, ROOT / "demos" / f"{name}.py", "--quick", "--out", folder], cwd=ROOT,
                       env=environment(kernel), capture_output=True, check=True)
        found[name] = all_demos.numbers(json.loads((folder / "summary.json").read_text()))
    return found


def measured(kernel: str, out: Path) -> dict[str, Any]:
    """Return what tests and scenes give under a kernel, from an earlier call if it is stored."""
    file = out / f"{kernel or 'default'}.json"
    if not file.exists():
        out.mkdir(parents=True, exist_ok=True)
        found = {"tests": outcomes(kernel), "scenes": scene_numbers(kernel, out)}
        file.write_text(json.dumps(found))
    return dict(json.loads(file.read_text()))


def differences(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Return a line for each test with another outcome, and each number of a scene that differs."""
    tests = {**old["tests"], **new["tests"]}
    found = [f"{test}: {old['tests'].get(test, 'absent')}, {new['tests'].get(test, 'absent')}" for test in tests
             if old["tests"].get(test) != new["tests"].get(test)]
    return found + [f"{scene} {key}: {a}, {b}" for scene in SCENES
                    for key, a, b in all_demos.differences(old["scenes"][scene], new["scenes"][scene], RELATIVE)]


def main() -> int:
    """Print the differences; 1 if there is one."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("kernels", nargs="*", metavar="KERNEL", help=f"of {', '.join(NEEDED)} (default: all)")
    options.add_argument("--out", type=Path, default=ROOT / "results" / "kernels", help="folder for the results")
    args = options.parse_args()
    if unknown := sorted({*args.kernels} - {*available()}):
        options.error(f"this processor has no {', '.join(unknown)}; it has {', '.join(available())}")
    default, bad = measured("", args.out), 0
    failed = [test for test, outcome in default["tests"].items() if outcome != "passed"]
    print(f"OpenBLAS chooses {used('')}: {len(default['tests'])} tests, {len(failed)} not passed", *failed, sep="\n  ")
    for kernel in args.kernels or available():
        found = differences(default, measured(kernel, args.out))
        print(f"{kernel} ({used(kernel)}): {len(found)} differences", *found, sep="\n  ", flush=True)
        bad += len(found)
    return int(bool(bad or failed))


if __name__ == "__main__":
    sys.exit(main())
