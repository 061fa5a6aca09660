"""Elements on edges of tools over which a body slides: the angle by which they turn, and its effect on forces."""

import numpy as np
import pytest

import formingx as fx
from formingx.results.evaluate import edges

RADIUS, FILLET = 2.5, 0.5


def pushed(elements, friction=0.2):
    """A sheet pushed 4 cm by a flat plug with a rounded edge."""
    plug = fx.tools.male(radius=RADIUS, height=30.0, base=-30.0, fillet=FILLET).mirrored().moved(z=0.5)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(elements, 1)),
                     materials=fx.MooneyRivlin(c10=0.4, c01=0.04),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", plug, friction, direction=(0, -1), name="plug")])
    return fx.trace(scene, until=fx.travel(4.0), progress=False)


@pytest.mark.parametrize("friction", [0.2, "none"])
def test_turn_is_that_of_the_arc_between_two_nodes(friction):
    path = pushed(16, friction)
    edge, face = edges.coarsest(path, path.last), path.contact("plug")
    centre = np.array([RADIUS - FILLET, 0.5 + FILLET - 4.0])
    r, z = (face.points - centre).T
    angles = np.degrees(np.clip(np.arctan2(r, -z), 0, np.pi / 2))       # where the nearest point of the plug is
    on = face.pressure > 0
    turns = np.diff(angles)[on[1:] | on[:-1]]
    assert edge.turn == pytest.approx(turns.max(), abs=0.01) and edge.tool == "plug"
    assert np.hypot(*(edge.point - centre)) == pytest.approx(FILLET, rel=0.1)


def test_sticking_sheets_have_no_edge_finding():
    path = pushed(16, "stick")
    assert edges.coarsest(path, path.last) is None


@pytest.mark.parametrize("points", ["nodes", 3])
def test_a_constrained_rim_has_no_edge_finding(points):
    """A rim held where the lip of a cup meets its wall rests on the lip; the next points hang beside the wall."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.3, elements=(20, 1)), loads=[fx.Pressure("bottom")],
                     materials=fx.MooneyRivlin(c10=50.0, c01=15.0), supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", fx.tools.cup(radius=10.0, depth=5.0, mouth=0.3, fillet=1.0),
                                          points=points)])
    path = fx.trace(scene, until=fx.pressure(6.0), progress=False)
    assert path.last.measures["tool_force"] > 0
    assert all(edges.coarsest(path, state) is None for state in path.states)


def test_runs_warn_of_elements_that_turn_too_much_over_an_edge(caplog):
    """Against 120 elements: 8 that turn by more than 40 degrees are more than 1 % off, 16 and 30 less than 0.3 %."""
    exact = plug_force(pushed(120))
    for elements, warns in ((8, True), (16, False), (30, False)):
        caplog.clear()
        path = pushed(elements)
        off = abs(plug_force(path) / exact - 1)
        assert ("the tool turns by" in caplog.text) == warns, elements
        assert off > 0.01 if warns else off < 3e-3, (elements, off)
        assert any("the tool turns by" in text for text in path_warnings(path)) == warns


def plug_force(path) -> float:
    return path["plug_force"][-1]


def path_warnings(path) -> list:
    from formingx.results.show import report_data
    return report_data.of_path(path).warnings()
