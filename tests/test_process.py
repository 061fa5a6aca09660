"""Processes in stages: exact targets, no memory without friction, derivatives after a change, forces, bad input."""

import csv

import numpy as np
import pytest

import formingx as fx

RIM = 10.0


def plug_scene(grip=False):
    """A clamped sheet, a round plug above it, a pressure on its top and, if asked, a rim that can be moved."""
    vacuum = fx.Pressure("top", name="vacuum")
    plug = fx.Contact("top", fx.tools.sphere(radius=3, z=0.5), "none", moves=(0, -1), name="plug")
    rim = [fx.Displaced("rim", "r", name="grip")] if grip else []
    scene = fx.Scene(mesh=fx.mesh.disc(radius=RIM, thickness=0.5, elements=(16, 1)), materials=fx.NeoHookean(c10=1.0),
                     loads=[vacuum], supports=[fx.Symmetry("axis"), fx.Clamped("rim"), *rim], contacts=[plug])
    return scene, plug, vacuum, rim


def run(scene, *stages):
    return fx.Process(scene).run([fx.Stage(*stage) for stage in stages], step=fx.StepControl(target=8), progress=False)


@pytest.fixture(scope="module")
def there_and_back():
    scene, plug, vacuum, _ = plug_scene()
    return run(scene, ("vacuum", vacuum, fx.pressure(0.03)), ("plug", plug, fx.travel(2.5)),
               ("plug out", plug, fx.travel(0.0)), ("release", vacuum, fx.pressure(0.0)))


def last_of(path, stage):
    return [state for state in path.states if state.stage == stage][-1]


def test_targets_are_hit_exactly_and_rest_is_found_again(there_and_back, tmp_path):
    path = there_and_back
    for stage, pressure, travel in (("vacuum", 0.03, 0), ("plug", 0.03, 2.5), ("plug out", 0.03, 0), ("release", 0, 0)):
        found = last_of(path, stage).measures
        assert found["vacuum_pressure"] == pytest.approx(pressure, abs=1e-14)
        assert found["plug_travel"] == pytest.approx(travel, abs=1e-12)
    assert np.abs(last_of(path, "plug out").x - last_of(path, "vacuum").x).max() < 1e-8
    assert np.abs(path.last.x).max() < 1e-8
    for column in ("vacuum_pressure", "plug_travel"):       # read again at the end: a control means what it meant
        again = [path.value(path._recorded[column], state) for state in path.states]
        np.testing.assert_allclose(again, path[column], atol=1e-14)
    path.to_csv(tmp_path / "path.csv")
    with open(tmp_path / "path.csv") as file:
        rows = list(csv.DictReader(file))
    assert [row["stage"] for row in rows] == [state.stage for state in path.states]


def test_order_does_not_matter_without_friction(there_and_back):
    scene, plug, vacuum, _ = plug_scene()
    other = run(scene, ("plug", plug, fx.travel(2.5)), ("vacuum", vacuum, fx.pressure(0.03)))
    assert np.abs(other.last.x - last_of(there_and_back, "plug").x).max() < 1e-8


def test_plug_force_is_that_of_the_supports():
    scene, plug, vacuum, _ = plug_scene()
    path = run(scene, ("vacuum", vacuum, fx.pressure(0.01)), ("plug", plug, fx.travel(2.5)))
    problem, state = path.problem, path.last
    x = problem.x.duplicate()
    x.setArray(state.x)
    problem.set_state(x, state.control)
    values = problem.assemble(problem._residual)
    dofs = np.intersect1d(problem.forms.space.sub(0).sub(1).collapse()[1], problem._held)
    forms = problem.forms
    support = values[dofs].sum() * forms.stress * forms.volume / forms.length
    pressed = 0.01 * np.pi * RIM**2                         # of a follower pressure inside a clamped rim, along -Z
    force = state.measures["tool_force"]
    assert force > 0.1
    assert support - pressed == pytest.approx(force, rel=1e-6)


@pytest.mark.parametrize("stage", ["vacuum", "plug", "grip"])
def test_derivative_by_control_after_a_change(stage):
    scene, plug, vacuum, rim = plug_scene(grip=True)
    path = run(scene, ("vacuum", vacuum, fx.pressure(0.001)), ("plug", plug, fx.travel(1.0)),
               ("grip", rim[0], fx.travel(0.1)))
    problem, state, h = path.problem, path.last, 1e-7
    thing = {"vacuum": vacuum, "plug": plug, "grip": rim[0]}[stage]
    x, plus, minus, exact = (problem.x.duplicate() for _ in range(4))
    x.setArray(state.x)
    control = problem.drive(thing, state.control)
    problem.residual(x, control, exact)
    assert exact.norm() < 1e-7 * problem.force_scale        # the same state
    shift = problem.motion(1.0) - problem.motion(0.0)       # held unknowns follow the control in x as well
    for side, out in ((h, plus), (-h, minus)):
        x.setArray(state.x + side * shift)
        problem.residual(x, control + side, out)
    x.setArray(state.x)
    problem.control_derivative(x, control, exact)
    exact.array[problem._held] = 0
    assert np.abs(exact.array).max() > 0
    np.testing.assert_allclose((plus.array - minus.array) / (2 * h), exact.array, atol=1e-5 * np.abs(exact.array).max())


def test_a_tool_left_out_gives_no_force():
    scene, plug, vacuum, _ = plug_scene()
    stages = [fx.Stage("up", vacuum, fx.pressure(-0.02), without=without) for without in ([plug], [])]
    path, stopped = (fx.Process(scene).run([stage], progress=False) for stage in stages)
    free = fx.Scene(mesh=scene.mesh, materials=scene.materials, loads=scene.loads, supports=scene.supports)
    alone = fx.trace(free, until=fx.pressure(-0.02), progress=False)
    assert path.last.measures["tool_force"] == 0 and stopped.last.measures["tool_force"] > 0.1
    assert path.last.measures["pole_height"] == pytest.approx(alone["pole_height"][-1], rel=1e-8)



def test_errors():
    scene, plug, vacuum, _ = plug_scene()
    for stage, message in [(fx.Stage("a", plug), "needs a target"),
                           (fx.Stage("a", fx.Pressure("top"), fx.pressure(1)), "something of the scene"),
                           (fx.Stage("a", plug, fx.pressure(1.0)), "which has a travel"),
                           (fx.Stage("a", plug, fx.travel(1.0), without=[vacuum]), "a contact of the scene"),
                           (fx.Stage("", plug, fx.travel(1.0)), "name")]:
        with pytest.raises(fx.InputError, match=message):
            fx.Process(scene).run([stage])
    with pytest.raises(fx.InputError, match="at least one Stage"):
        fx.Process(scene).run([])
    with pytest.raises(fx.InputError, match="all driven"):
        fx.trace(scene, until=fx.travel(1.0))
    with pytest.raises(fx.InputError, match="two of them are called"):
        fx.Scene(mesh=scene.mesh, materials=scene.materials, loads=[vacuum, fx.Pressure("bottom", name="vacuum")],
                 supports=scene.supports)
