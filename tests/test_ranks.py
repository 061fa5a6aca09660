"""The same numbers on 1, 2 and 3 ranks, and the same errors."""

import numpy as np
import pytest
from conftest import printed_by, run_json, run_script

SCRIPT = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from conftest import treloar
path = fx.trace(treloar((12, 2), {support}), until=fx.pole_stretch(3.0), intermediate=[fx.pole_stretch(1.5)],
                progress=False)
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


HINGED, CLAMPED = "fx.SimplySupported('rim')", "fx.Clamped('rim')"


@pytest.mark.thorough
@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("support", [HINGED, CLAMPED])
def test_ranks_agree(ranks, support):
    serial, other = (run_json(SCRIPT.format(support=support), n) for n in (1, ranks))
    assert other["counts"] == serial["counts"]
    assert other["numbers"] == pytest.approx(serial["numbers"], rel=1e-8)


@pytest.mark.quick
def test_errors_come_on_all_ranks():
    lines = run_script(BAD, ranks=2)
    for words in ("not there", "too little support"):
        assert lines.count(words) == 2


CONTACT = """
import sys, json
sys.path.insert(0, "tests")
from test_contact import cup, form
found = []
for friction in {frictions}:
    path = form(cup(friction), 8.0)
    found += [path.counts.steps, path.counts.iterations, float(path.profile().thickness_ratio.min())]
    found += [path.last.measures[k] for k in ("pole_height", "tool_force", "contact_length")]
if path.problem.comm.rank == 0:
    print(json.dumps(found))
"""


@pytest.mark.parametrize("ranks, frictions", [(2, [0.3]), *(pytest.param(*row, marks=pytest.mark.thorough) for row in (
    (2, ["none", "stick"]), (3, ["none", "stick", 0.3])))])
def test_ranks_agree_on_contact(ranks, frictions):
    serial, other = (run_json(CONTACT.format(frictions=frictions), n) for n in (1, ranks))
    assert other == pytest.approx(serial, rel=1e-8)


DRIVEN = """
import json
import formingx as fx
mesh = fx.mesh.disc(radius=1.0, thickness=3.0, elements=(4, 12))
scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), supports=[
    fx.Symmetry("axis"), fx.Symmetry("bottom", "z"), fx.PrescribedDisplacement("top", "z")])
path = fx.trace(scene, until=fx.travel(-0.5), progress=False)
found = [float(path[c][-1]) for c in ("travel", "support_force")]
if mesh.comm.rank == 0:
    print(json.dumps(found))
"""


def test_a_controlled_support_may_be_absent_on_a_rank():
    """The rank without a driven node waited for ever."""
    serial, parallel = (run_json(DRIVEN, ranks) for ranks in (1, 2))
    stretch = 1 - 0.5 / 3
    assert parallel == pytest.approx(serial, rel=1e-8)
    assert serial[1] == pytest.approx(np.pi * 2 * (stretch**-2 - stretch), rel=1e-6)


VERDICT = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from test_inadmissible_states import block, foot
pot = fx.tools.pot(mouth=4.0, base=3.5, depth=4.0, sheet=0.25, fillet=0.8, lip=0.4, plug=2.6, nose=0.8)
scene = fx.Scene(mesh=fx.mesh.disc(radius=5.0, thickness=0.25, elements=(14, 1)),
                 materials=fx.TransientNetwork(fx.NeoHookean(c10=0.5), [(1.0, 0.02)]),
                 supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")],
                 contacts=[fx.Contact("top", pot.mould, "stick", name="mould"),
                           fx.Contact("bottom", pot.plug, 0.3, direction=(0, 1), name="plug")])
path = fx.Process(scene).run([fx.Stage("plug", control="plug", until=fx.travel(1.5), speed=30.0),
                              fx.Stage("air", control="air", until=fx.pressure(0.2), duration=0.1)],
                             accuracy="draft", max_steps=300, progress=False)
last = path.last.measures
found = {"steps": path.counts.steps, "last": [last[c] for c in ("pole_height", "plug_force", "strain_energy")],
         "balance": float(path.work()["unbalanced"][-1]), "walls": path.profile().wall_ratio.tolist(), "said": []}
for bad, target in ((block(1.0), 0.95), (foot(), -0.85)):
    try:
        fx.trace(bad, until=fx.travel(target), progress=False)
    except fx.ConvergenceError as error:
        found["said"].append(str(error)[:200])
        found["last"] += [len(error.path), error.path["travel"][-1]]
if path.problem.comm.rank == 0:
    print(json.dumps(found))
"""


@pytest.mark.thorough
def test_ranks_agree_on_a_process_and_on_admissibility():
    """Plug, mould and relaxing material; runs that an inadmissible state ends."""
    one, two = (run_json(VERDICT, ranks) for ranks in (1, 2))
    assert len(one["said"]) == 2 and "did not follow the tool" in one["said"][0] and "inside out" in one["said"][1]
    assert two["said"] == one["said"] and two["steps"] == one["steps"]
    for key in ("last", "walls"):
        assert two[key] == pytest.approx(one[key], rel=1e-6)
    assert two["balance"] == pytest.approx(one["balance"], abs=1e-6 * abs(one["last"][2]))


LAYER = """
import formingx as fx, ufl
mesh = fx.mesh.disc(radius=1.0, thickness={"low": 1.0, "high": 8.0}, elements=(1, (1, 8)))
c10 = 1 + ufl.SpatialCoordinate(mesh.domain)[0] ** 2
scene = fx.Scene(mesh=mesh, materials={name: fx.NeoHookean(c10=c10) for name in mesh.layers},
                 supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")])
print(*(len(scene.sample(name).cells) for name in ("low", "high")))
"""


@pytest.mark.thorough
def test_a_rank_without_cells_of_a_layer():
    """It compiles constants over the mesh with the others, which waited for it for ever."""
    cells = [[int(n) for n in line.split()] for line in printed_by(LAYER, ranks=2, timeout=120)]
    assert [sum(counts) for counts in zip(*cells)] == [2, 16] and 0 in cells[0] + cells[1]


DESIGN = """
import json, sys
sys.path.insert(0, "tests")
import formingx as fx
from test_design import cup
run = fx.Design(cup, {"b": (0.0, -1, 1)}).run()
wall, by = run.derivative("wall")
if run.path.problem.comm.rank == 0:
    print(json.dumps([*wall, *by.ravel()]))
"""


@pytest.mark.thorough
def test_derivatives_of_designs():
    """Of a sheet that sticks, too: by differences of 1e-8, whose round-off is all that they differ by."""
    one, two = (run_json(DESIGN, ranks) for ranks in (1, 2))
    assert two == pytest.approx(one, abs=1e-7)
