import gc
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from mpi4py import MPI
from on_ranks import ENVIRONMENT, Ranks, execute

import formingx as fx

ROOT = Path(__file__).parents[1]


def pytest_collection_finish():
    """What was imported stays: leave it out of every collection of garbage."""
    gc.freeze()


@pytest.fixture(autouse=True)
def collect_garbage():
    """PETSc objects are freed collectively: free them between tests, not whenever Python likes.

    What is alive then (caches, what a file's tests share) is not looked at after each further test: that took 0.16 s.
    """
    yield
    gc.collect()
    gc.freeze()
    MPI.COMM_WORLD.Barrier()


@pytest.fixture(autouse=True, scope="module")
def collect_garbage_of_file():
    """What a file's tests shared is collected when they are done."""
    yield
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def treloar(elements=(10, 1), support=None, length=1.0, stress=1.0, comm=MPI.COMM_WORLD, **scene):
    """Treloar's sheet in units of `length` cm and `stress` kg/cm2."""
    mesh = fx.mesh.disc(radius=1.25 / length, thickness=0.082 / length, elements=elements, comm=comm)
    return fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=2.0 / stress), loads=[fx.Pressure("bottom")],
                    supports=[fx.Symmetry("axis"), support or fx.SimplySupported("rim")], **scene)


def drawn(file):
    """True if a picture shows something: coloured curves or faces, in several colours, on a plain ground.

    Axes, grids and words alone are grey.
    """
    pixels = np.round(255 * imread(file)[..., :3]).astype(int)
    coloured = pixels[np.ptp(pixels, axis=-1) > 50]
    return min(pixels.shape[:2]) > 200 and 0.001 < len(coloured) / pixels[..., 0].size < 0.9 and len(
        np.unique(coloured // 16, axis=0)) > 1


def run(*command, ranks=None, timeout=600):
    """Run a Python command of the checkout as a user does; returns what it printed."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks else []
    done = subprocess.run([*launcher, sys.executable, *map(str, command)], cwd=ROOT, capture_output=True, text=True,
                          timeout=timeout, env=ENVIRONMENT if ranks else None)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


_ranks = {}
"""The processes that run, by their number."""


def printed_by(script, *arguments, ranks=1, timeout=600):
    """What a Python script prints, a text for each of so many ranks; on one it runs in this process."""
    arguments = [str(a) for a in arguments]
    if ranks == 1:
        return [execute(script, arguments)]
    if ranks not in _ranks or not _ranks[ranks].alive:
        _ranks[ranks] = Ranks(ranks)
    return _ranks[ranks].run(script, arguments, timeout)


def run_script(script, *arguments, ranks=1):
    """What a Python script prints on all ranks."""
    return "".join(printed_by(script, *arguments, ranks=ranks))


def run_json(script, ranks):
    """The JSON that a Python script prints on rank 0."""
    return json.loads(printed_by(script, ranks=ranks)[0].strip().splitlines()[-1])


def pytest_sessionfinish():
    """End what runs on several ranks."""
    for ranks in _ranks.values():
        ranks.end()
