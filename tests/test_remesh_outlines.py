"""Outlines of new elements that cross themselves: gmsh did not end on them."""

import numpy as np
import pytest
from mpi4py import MPI

import formingx as fx
from formingx.extensions.remeshing import outline_mesh


def pressed(**remesh):
    """A block whose rim rolls over onto the plate, at half its height."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.9549, elements=(5, 6)),
                     materials=fx.MooneyRivlin(c10=0.4, c01=0.1),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", "z")],
                     contacts=[fx.Contact(face, fx.tools.plane(1.9549), 0.08812, direction=(0, -1), name="press")
                               for face in ("top", "rim")])
    return fx.trace(scene, until=fx.travel(1.0799), progress=False, remesh=fx.Remesh(**remesh))


def crescent(size):
    """A thin curved strip of radius 1 with long new elements; a name ends within its outer face only."""
    def arc(radius, angles):
        at = radius * np.column_stack([np.cos(angles), np.sin(angles)])
        return np.stack([at[:-2:2], at[2::2], at[1:-1:2]], axis=1)
    angles = np.linspace(0, np.pi / 2, 33)
    outer, inner = arc(1.01, angles), arc(1.0, angles[::-1])

    def joint(a, b):
        return np.array([[a, b, (a + b) / 2]])
    edges = np.concatenate([outer, joint(outer[-1, 1], inner[0, 0]), inner, joint(inner[-1, 1], outer[0, 0])])
    names = [*[frozenset({"left"})] * 5, *[frozenset({"right"})] * 11, frozenset({"end"}), *[frozenset({"in"})] * 16,
             frozenset({"start"})]
    return outline_mesh.mesh_of_outline(edges, names, np.zeros((0, 2)), size, size, "all", False, MPI.COMM_SELF)


def test_long_elements_of_a_thin_curved_strip_cross():
    with pytest.raises(fx.InputError, match=r"outline of the body crosses itself .*Remesh\(corner=\)"):
        crescent(0.8)
    mesh = crescent(0.05)
    assert {name: len(mesh.facets_of(name)) for name in ("left", "right", "end")} == {"left": 10, "right": 22, "end": 1}


def test_an_outline_that_crosses_itself_ends_the_run_with_a_reason(monkeypatch):
    monkeypatch.setattr(outline_mesh, "crossing_point", lambda points, edges: points[0])
    said = r"^travel = 1.0799 was not reached: remesh: .* outline of the body crosses itself .*Remesh\(corner="
    with pytest.raises(fx.ConvergenceError, match=said) as error:
        pressed(size=0.15)
    assert str(error.value).endswith("it is kept in the error's `path`.")
    assert error.value.path["travel"][-1] > 0.1


@pytest.mark.thorough
def test_smaller_corners_mesh_the_same_body():
    path = pressed(size=0.15, corner=0.03)
    assert any(state.kind == "remesh" for state in path.states)
    assert path["travel"][-1] == pytest.approx(1.0799)
