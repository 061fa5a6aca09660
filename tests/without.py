"""Copies of the package without some of its extensions."""

import os
import shutil
import subprocess
import sys

from conftest import ROOT


def run_without(folder, names, *command):
    """Run a command of Python on a copy of the package that lacks extensions; return its standard output.

    Args:
        folder: where the copy is made. names: of the extensions. command: arguments of the interpreter.
    """
    shutil.copytree(ROOT / "formingx", folder / "formingx", ignore=shutil.ignore_patterns("__pycache__"))
    for name in names:
        shutil.rmtree(folder / "formingx" / "extensions" / name)
    done = subprocess.run([sys.executable, *map(str, command)], env=os.environ | {"PYTHONPATH": str(folder)},
                          cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout
