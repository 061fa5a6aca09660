"""A scene is a description: no run changes it."""

import types

import numpy as np
import pytest
import ufl
from dolfinx import fem
from test_cooling import pressed

import formingx as fx
from formingx.problem.problem import Problem


def contents(thing, seen=None):
    """Attributes of an object of the package as plain data; objects of other packages are returned unchanged."""
    seen = {} if seen is None else seen
    if id(thing) in seen:
        return f"seen {seen[id(thing)]}"
    if isinstance(thing, np.ndarray):
        return thing.dtype.str, thing.shape, thing.tobytes()
    if isinstance(thing, fem.Function):
        return thing.x.array.tobytes()
    if isinstance(thing, dict | types.MappingProxyType):
        return [(str(key), contents(value, seen)) for key, value in thing.items()]
    if isinstance(thing, list | tuple):
        return [contents(value, seen) for value in thing]
    if type(thing).__module__.startswith("formingx"):
        seen[id(thing)] = len(seen)
        return type(thing).__name__, contents(vars(thing), seen)
    return thing


@pytest.mark.thorough
def test_a_run_does_not_change_its_scene():
    """A process with friction by temperature, heat, relaxation and expansion leaves its scene unchanged."""
    scene = pressed()
    before, X = contents(scene), scene.mesh.domain.geometry.x.copy()
    path = fx.Process(scene).run([fx.Stage("push", control="plug", until=fx.travel(0.1), duration=0.2),
                                  fx.Stage("wait", duration=0.2)], progress=False, accuracy="draft")
    assert path.temperature([(0.0, 0.05)])[0] < 140 and path.last.measures["tool_force"] != 0
    assert contents(scene) == before and np.array_equal(scene.mesh.domain.geometry.x, X)
    assert np.all(scene.temperature.T.x.array == 150.0)


@pytest.mark.thorough
def test_two_simultaneous_runs_of_a_scene():
    """The temperature of a run belongs to its problem: a second run begins with the temperature of the scene."""
    scene = pressed()
    push = [fx.Stage("push", control="plug", until=fx.travel(0.06), duration=0.1)]
    first = fx.Process(scene).run(push, progress=False, accuracy="draft")
    T = first.problem.temperature.T.x.array.copy()
    second = fx.Process(scene).run(push, progress=False, accuracy="draft")
    assert np.array_equal(first.problem.temperature.T.x.array, T)
    assert [s.measures for s in second.states] == [s.measures for s in first.states]


@pytest.mark.thorough
def test_a_constant_of_the_mesh_keeps_the_mesh():
    """A scene divides a sheet anew for its tools, unless a material constant is a UFL expression of the mesh."""
    disc = fx.mesh.disc(radius=10.0, thickness=0.5)
    R = ufl.SpatialCoordinate(disc.domain)[0]
    rest = {"supports": [fx.Symmetry("axis"), fx.Clamped("rim")], "loads": [fx.Pressure("bottom")],
            "contacts": [fx.Contact("top", fx.tools.cup(radius=9.0, depth=4.0, fillet=1.0).moved(0.0, 0.6), 0.3)]}
    assert fx.Scene(mesh=disc, materials=fx.NeoHookean(c10=0.1), **rest).mesh is not disc
    kept = fx.Scene(mesh=disc, materials=fx.Viscoelastic(fx.NeoHookean(c10=0.1 + 0.001 * R), [(0.1, 1.0)]),
                    **rest)
    assert kept.mesh is disc and len(Problem(kept).forms.bodies) == 1
