"""MPI communicators of runs that are no longer used are freed: MPICH has 2046 for a process."""

import subprocess
import sys

import numpy as np
import pytest
from mpi4py import MPI

import formingx as fx


def free_number():
    """Lowest free number of a communicator: it grows with the number of those that are in use."""
    comm = MPI.COMM_SELF.Dup()
    number = comm.py2f() & 0xFFFF
    comm.Free()
    return number


def disc(thickness=0.1, **stiffness):
    """A sheet whose modulus is a parameter at each of some radii."""
    values = list(stiffness.values()) or [1.0, 1.0]
    radii = np.linspace(0, 1, len(values))
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=thickness, elements=(6, 1)),
                     materials=fx.NeoHookean(c10=lambda R, Z: np.interp(R, radii, values)),
                     loads=[fx.Pressure("bottom")], supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    return scene, fx.pole_height(0.3)


@pytest.mark.thorough
def test_a_loop_of_runs_frees_its_communicators():
    used = []
    for _ in range(120):
        scene, until = disc()
        fx.trace(scene, until=until, progress=False)
        used.append(free_number())
    assert max(used[60:]) < max(used[:60]) + 30 and max(used) < 1500


@pytest.mark.slow
def test_a_design_of_twenty_parameters_and_runs_ends():
    design = fx.Design(disc, {f"c{k}": (1.0 + 0.5 * (k % 2), 0.2, 5.0) for k in range(20)})
    for run in range(20):
        found = design.run({f"c{k}": 1.0 + 0.02 * run * (k % 3) for k in range(20)})
        assert found.derivative("wall")[1].shape[1] == 20
        found.forget_perturbed_runs()
    assert free_number() < 2000
    assert len(design.fit(even=True, max_runs=20).runs) > 1 and free_number() < 2000


@pytest.mark.slow
def test_a_study_of_three_hundred_runs_in_this_process_ends():
    from concurrent.futures import ThreadPoolExecutor
    with ThreadPoolExecutor(1) as here:
        study = fx.study(run, {"thickness": [0.05 + 1e-4 * k for k in range(300)]}, {"height": "pole_height"},
                         executor=here)
    assert len(study.successful) == 300 and free_number() < 2000


def run(thickness):
    """A run of the study."""
    scene, until = disc(thickness)
    return fx.trace(scene, until=until, progress=False)


FREED_BY_AN_ERROR = """
import gc
from mpi4py import MPI
import formingx as fx
def body():
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1)), materials=fx.NeoHookean(c10=0.5),
                     loads=[fx.Pressure("bottom")], supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    path = fx.trace(scene, until=fx.pole_height(0.2), progress=False)
    path.profile().thickness_ratio_at(0.5)
    path.save("run")
    fx.trace(scene, until=fx.pole_height(0.25), start=fx.load("run", scene), progress=False)
    domain = scene.mesh.domain
    del scene, path
    gc.collect()
    return domain
try:
    [body(), body(), 1 / 0]
except ZeroDivisionError:
    pass
MPI.COMM_WORLD.Dup().allgather(1)
print("ended")
"""


def test_an_error_that_frees_communicators_leaves_no_lock_behind(tmp_path):
    """No Python object was passed on the copies that DOLFINx holds: mpi4py 4.0.3 would lock the next one for ever."""
    done = subprocess.run([sys.executable, "-c", FREED_BY_AN_ERROR], cwd=tmp_path, capture_output=True, text=True,
                          timeout=60, check=False)
    assert done.stdout.strip().endswith("ended"), done.stderr[-2000:]
