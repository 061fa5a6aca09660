"""Quantities of a state with friction belong to the history of this state, also after later states."""

import numpy as np
import pytest
from test_process import air, end, plug, plugged, run

import formingx as fx
from formingx.contact import resultants

STAGES = [plug("down", 1.6), air("press", 0.02), plug("up", 1.0)]


@pytest.fixture(scope="module")
def path():
    return run(plugged(0.3, (20, 2)), *STAGES)


def test_columns_of_earlier_states(path):
    for state in path.states:
        for column in path.columns:
            assert path.value(column, state) == pytest.approx(state.measures[column], rel=1e-12, abs=1e-14), column


@pytest.mark.parametrize("target, stage", [(fx.travel(1.1, of="plug"), 0), (fx.pressure(0.011, of="air"), 1),
                                           (fx.travel(1.3, of="plug"), 2)], ids=["down", "press", "up"])
def test_a_found_state_is_that_of_a_run_that_steps_there(path, target, stage):
    """In every stage of a process: found in the finished path, and met by a run that goes on from the state before."""
    first = end(path, STAGES[stage - 1].name) if stage else None
    found = path.state_at(target, after=first)
    k = next(i for i, (a, b) in enumerate(zip(path.states, path.states[1:]))
             if a.stage == b.stage == STAGES[stage].name
             and (a.measures[target.name] - target.value) * (b.measures[target.name] - target.value) <= 0)
    last = STAGES[stage]
    stages = [*STAGES[:stage], fx.Stage(last.name, control=last.control, until=target, step=last.step)]
    begun = run(path.problem.scene, *stages, start=path.states[k]).last
    assert np.abs(found.x - begun.x).max() < 1e-9 * np.abs(begun.x).max()
    for column, value in begun.measures.items():
        assert found.measures[column] == pytest.approx(value, rel=1e-8, abs=1e-10), column


def test_files_and_fields_of_a_found_state(path, tmp_path):
    """VTK files, profile and stress at recorded and found states; the run's last state stays what it was."""
    before = dict(path.last.measures)
    found = path.state_at(fx.travel(1.1, of="plug"))
    for k, state in enumerate((found, end(path, "down"))):
        path.to_vtk(tmp_path / f"{k}.pvd", state)
        assert path.profile(state).thickness.min() > 0
        assert np.isfinite(path.stress(state).at_quadrature_points().cauchy).all()
    assert {c: path.value(c, path.last) for c in path.columns} == pytest.approx(before, rel=1e-12, abs=1e-14)


def test_a_curve_stays_between_its_states(path):
    force, = path.curve("tool_force", points=6)
    for state in path.states:
        assert np.abs(force - state.measures["tool_force"]).min() == 0
    assert force.max() == path["tool_force"].max() and force.min() == path["tool_force"].min()


def test_states_are_compared_by_identity(path):
    assert path.states.index(path.states[2]) == 2 and path.states[2] in path.states
    assert path.states[1] != path.states[2] and len(repr(path.last)) < 500


def test_a_column_of_ones_own(path):
    again = run(plugged(0.3, (10, 1)), plug("down", 0.5), record={
        "push": lambda problem: resultants.force(problem.contacts[0], problem.x.array_r, problem.control)[1],
        "under": fx.displacement(0.0, at=(0.0, 0.0))})
    assert again.columns[-2:] == ["push", "under"] and again["under"][-1] == pytest.approx(-0.5, abs=0.05)
    assert np.array_equal(again["push"], again["tool_force"]) and again["push"][-1] > 0
    with pytest.raises(fx.InputError, match="is no column yet"):
        run(plugged(), plug("down", 0.5), record={"tool_force": lambda problem: 1.0})
    with pytest.raises(fx.InputError, match="must be a number"):
        run(plugged(), plug("down", 0.5), record={"mine": lambda problem: "much"})
