"""Points that enter a tool in the last step, in three dimensions, are in contact when a target is accepted."""

import numpy as np
import pytest

import formingx as fx
from formingx.results.evaluate.admissibility import AdmissibilityCheck

THICKNESS = 1.0


def draw(size, friction="stick", **more):
    """A scene in which a box, or another tool, is pushed into the sheet of a tray of 160 x 100 mm."""
    plug = fx.tools.box(half=(52, 27), depth=30, corner=15, fillet=8, draft=5, mouth=30.5, plug=True)
    contact = fx.Contact("top", more.pop("tool", plug), friction, direction=(0, 0, -1), name="plug")
    sheet = fx.mesh.sheet(fx.mesh.rectangle(160, 100, corner=20), size=size)
    return fx.Scene(mesh=sheet, thickness=THICKNESS, materials=fx.NeoHookean(c10=0.1), contacts=[contact],
                    supports=[fx.SimplySupported("rim")], model=fx.Membrane(wrinkles=0.01), **more)


@pytest.fixture(scope="module")
def drawn():
    """A box drawn to 20, past a travel and a force."""
    return fx.trace(draw(16.0), until=fx.travel(20.0), intermediate=[fx.travel(5.0), fx.force(2.0)], progress=False)


def serious(path):
    """The texts of serious findings."""
    return [found.text for found in path.findings() if found.severity == "serious"]


@pytest.mark.parametrize("more", [{}, {"friction": "none"}, {"tool": fx.tools.revolved(fx.tools.sphere(
    radius=35.0, z=0.5))}])
def test_no_point_penetrates_a_tool_at_a_target(drawn, more):
    """Targets are met exactly, of a box one of the force, too; between them points do come late."""
    targets = [fx.travel(5.0), *([] if more else [fx.force(2.0)]), fx.travel(20.0)]
    path = fx.trace(draw(16.0, **more), until=targets[-1], intermediate=targets[:-1],
                    progress=False) if more else drawn
    for target in targets:
        met = path.target_state(target).measures
        if target.name == "travel":
            assert met["travel"] == pytest.approx(target.value, rel=1e-8)
        else:                   # a penalty force has the round-off of positions: tolerances of 1e-12 leave 3e-8
            assert abs(met["tool_force"]) == pytest.approx(target.value, rel=1e-7)
        assert met["penetration"] < 2e-3 * THICKNESS
    assert path["penetration"].max() > 0.05 * THICKNESS and serious(path) == []


def test_a_stage_ends_without_late_contact():
    """A step to its end would leave a point 0.5 deep in the plug; the next stage begins with nothing in it either."""
    scene = draw(16.0)
    path = fx.Process(scene).run([fx.Stage("plug", control="plug", until=fx.travel(12.0), speed=60.0),
                                  fx.Stage("hold", duration=0.1)], progress=False)
    for name in ("plug", "hold"):
        end = [state for state in path.states if state.stage == name][-1]
        assert end.measures["penetration"] < 2e-3 * THICKNESS


def test_deep_penetration_is_reported(drawn):
    """A penetration of 0.2 at the last state is a serious finding; one of 5 makes the state inadmissible."""
    path, check = drawn, AdmissibilityCheck(drawn.problem)
    state, found, up = path.last, path.last.x.copy(), np.arange(2, len(path.last.x), 3)
    assert serious(path) == [] and list(check.reasons(state)) == []
    state.x[up] = found[up] + 0.2 / path.problem.forms.length
    (words,) = serious(path)
    assert "point is 0.2 deep in the tool of 'plug' at (x, y, z) = (" in words
    state.x[up] = found[up] + 5.0 / path.problem.forms.length
    assert "deep in the tool of 'plug'" in next(check.reasons(state))
    state.x[up] = found[up]
