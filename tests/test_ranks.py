"""The same numbers on 1, 2 and 3 ranks, and the same errors."""

import numpy as np
import pytest
from conftest import run, run_json

SCRIPT = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from conftest import treloar
path = fx.trace(treloar((12, 2), {support}), until=fx.pole_stretch(3.0), through=[fx.pole_stretch(1.5)], progress=False)
profile = path.profile()
numbers = [*path["pressure"], *path["pole_height"], *path["enclosed_volume"], *path["strain_energy"],
           *profile.thickness_ratio, *profile.arc_length, path.limit_points[0].measures["pole_stretch"]]
fixed = fx.solve(path.problem.scene, to=0.3, increments=6).last.measures["pole_height"]
if path.problem.comm.rank == 0:
    print(json.dumps({{"numbers": numbers + [fixed], "counts": [path.counts.steps, path.counts.iterations]}}))
"""

BAD = """
import formingx as fx
from mpi4py import MPI
try:
    mesh = fx.mesh.read("missing.msh")
except fx.InputError as error:
    print("rank", MPI.COMM_WORLD.rank, error, flush=True)
mesh = fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1))
try:
    fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), supports=[fx.Symmetry("axis")])
except fx.InputError as error:
    print("rank", MPI.COMM_WORLD.rank, error, flush=True)
"""


@pytest.mark.parametrize("support", ["fx.SimplySupported('rim')", "fx.Clamped('rim')"])
def test_ranks_agree(support):
    serial, *others = [run_json(SCRIPT.format(support=support), ranks) for ranks in (1, 2, 3)]
    for other in others:
        assert other["counts"] == serial["counts"]
        assert other["numbers"] == pytest.approx(serial["numbers"], rel=1e-8)


@pytest.mark.quick
def test_errors_come_on_all_ranks():
    lines = run("-c", BAD, ranks=2)
    for words in ("not there", "too little support"):
        assert lines.count(words) == 2


CONTACT = """
import sys, json
sys.path.insert(0, "tests")
from test_contact import cup, form
found = []
for friction in ("none", "stick", 0.3):
    path = form(cup(friction), 8.0)
    found += [path.counts.steps, path.counts.iterations, float(path.profile().thickness_ratio.min())]
    found += [path.last.measures[k] for k in ("pole_height", "tool_force", "contact_length")]
if path.problem.comm.rank == 0:
    print(json.dumps(found))
"""


def test_ranks_agree_on_contact():
    serial, *others = [run_json(CONTACT, ranks) for ranks in (1, 2, 3)]
    for other in others:
        assert other == pytest.approx(serial, rel=1e-8)


DRIVEN = """
import json
import formingx as fx
mesh = fx.mesh.disc(radius=1.0, thickness=3.0, elements=(4, 12))
scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), supports=[
    fx.Symmetry("axis"), fx.Symmetry("bottom", "z"), fx.Displaced("top", "z")])
path = fx.trace(scene, until=fx.travel(-0.5), progress=False)
found = [float(path[c][-1]) for c in ("travel", "support_force")]
if mesh.comm.rank == 0:
    print(json.dumps(found))
"""


def test_a_driven_support_of_which_a_rank_has_nothing():
    """The rank without a driven node waited for ever."""
    serial, parallel = (run_json(DRIVEN, ranks) for ranks in (1, 2))
    stretch = 1 - 0.5 / 3
    assert parallel == pytest.approx(serial, rel=1e-8)
    assert serial[1] == pytest.approx(np.pi * 2 * (stretch**-2 - stretch), rel=1e-6)
