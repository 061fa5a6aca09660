"""A finished state is never lost: round-off between stages, checks that fail, functions of the script that fail."""

import numpy as np
import pytest
from conftest import treloar

import formingx as fx
from formingx import findings
from formingx.extensions.remeshing.earlier_meshes import _OutlineProjection
from formingx.mesh.locate import locate
from formingx.problem.problem import Problem


def relaxing_disc(c10, both, duration):
    """A table brings the pressures on both faces to `both`; then one of them grows by 0.04 c10."""
    below, above = fx.Pressure("bottom", name="below"), fx.Pressure("top", name="above")
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=1.0, elements=(3, 1)), loads=[below, above],
                     materials=fx.Viscoelastic(fx.NeoHookean(c10=c10), [(1.0, 0.7), (0.5, 0.05)]),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")])
    together = [(0.0, 0.0), (0.3, both)]
    return fx.Process(scene).run([
        fx.Stage("together", amplitudes={below: together, above: together}),
        fx.Stage("blow", control=below, until=fx.pressure(both + 0.04 * c10), duration=duration)], progress=False)


def test_round_off_between_stages_in_time_dissipates_nothing():
    """Equal pressures on both faces do not deform the disc: the dissipated energy does not depend on them."""
    energies, steps = [], []
    for both in (0.07, 0.1, 0.3):
        path = relaxing_disc(0.065, both, 1.0)
        steps += [b.time - a.time for a, b in zip(path.states, path.states[1:]) if a.setting != b.setting]
        energies.append(path["dissipated_energy"][-1])
    assert 0 < max(map(abs, steps)) < 1e-12, "the case needs round-off between the stages"
    assert energies == pytest.approx(energies[:1] * 3, rel=1e-6) and energies[0] > 0


def test_points_beyond_corners_of_a_mesh_are_moved_onto_it():
    """On a new mesh of a remeshed run, points of the first mesh may lie beyond its outline, also beyond a corner."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(3, 2)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.Clamped("bottom")], loads=[fx.Pressure("top")])
    problem = Problem(scene)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False) + 0.1
    beyond = corners[:, None] + 0.03 * np.column_stack([np.cos(angles), np.sin(angles)])
    given = beyond.reshape(-1, 2)
    moved = _OutlineProjection(problem)(given)
    locate(problem.forms.domain, moved, 1.0)                # raises an error for a point outside
    onto = np.clip(given, 0, 1)
    outside = np.any(given != onto, axis=1)
    assert moved[outside] == pytest.approx(onto[outside], abs=1e-12)


def test_a_check_of_the_result_that_fails_is_a_finding(monkeypatch, caplog):
    def careless(path):
        raise ZeroDivisionError("float division by zero")
    monkeypatch.setitem(findings._registered, "end", [*findings._registered["end"], careless])
    path = fx.trace(treloar(), until=fx.pole_height(0.2), progress=False)
    found, = (finding for finding in path.findings() if finding.about == "careless")
    assert found.severity == "warning" and "ZeroDivisionError: float division by zero" in found.text
    assert path.last.target is not None and "careless" in caplog.text


def test_an_error_of_the_script_carries_the_path():
    """A column that fails after three states."""
    calls = []

    def column(problem):
        calls.append(1)
        return 1 / (len(calls) < 4)
    with pytest.raises(ZeroDivisionError) as caught:
        fx.trace(treloar(), until=fx.pole_height(0.5), record={"mine": column}, progress=False)
    path = caught.value.path
    assert len(path) == 3 and path["pole_height"][-1] > 0 and "error.path" in caught.value.__notes__[0]
