"""Outlines of new elements that cross themselves: gmsh did not end on them."""

import pytest

import formingx as fx


def pressed(**remesh):
    """A block whose rim rolls over onto the plate, at half its height."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.9549, elements=(5, 6)),
                     materials=fx.MooneyRivlin(c10=0.4, c01=0.1),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", "z")],
                     contacts=[fx.Contact(face, fx.tools.plane(1.9549), 0.08812, direction=(0, -1), name="press")
                               for face in ("top", "rim")])
    return fx.trace(scene, until=fx.travel(1.0799), progress=False, remesh=fx.Remesh(**remesh))


def test_an_outline_that_crosses_itself_ends_the_run_with_a_reason():
    with pytest.raises(fx.ConvergenceError, match=r"outline of the body crosses itself .*Remesh\(corner=") as error:
        pressed(size=0.15)
    assert error.value.path["travel"][-1] > 0.9


def test_smaller_corners_mesh_the_same_body():
    path = pressed(size=0.15, corner=0.03)
    assert any(state.kind == "remesh" for state in path.states)
    assert path["travel"][-1] == pytest.approx(1.0799)
