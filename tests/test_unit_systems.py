"""A run does not depend on its units but for round-off."""

import numpy as np
import pytest

import formingx as fx


def pushed(length, stress):
    """A clamped disc on a plug with a flat end, on which it sticks; units: in mm and MPa."""
    sheet = fx.mesh.disc(radius=31.0 * length, thickness=0.9 * length, elements=(16, 1))
    plug = fx.tools.cylinder(radius=15.0 * length, z=0.9 * length, fillet=3.0 * length)
    scene = fx.Scene(mesh=sheet, materials=fx.MooneyRivlin(c10=0.4 * stress, c01=0.05 * stress),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", plug, "stick", direction=(0, -1))])
    return fx.trace(scene, until=fx.travel(12.0 * length), progress=False)


def test_a_run_does_not_depend_on_its_units():
    """In units that differ by powers of two no number is rounded otherwise: the same states to the last digit."""
    path, same, metres = pushed(1.0, 1.0), pushed(2.0**-10, 2.0**20), pushed(1e-3, 1e6)
    assert [s.control for s in same.states] == [s.control for s in path.states]
    assert same.counts.iterations == path.counts.iterations and same.counts.failures == path.counts.failures
    assert all(np.array_equal(a.x, b.x) for a, b in zip(path.states, same.states))
    assert same["tool_force"][-1] == path["tool_force"][-1]                  # MPa mm^2: 2^20 2^-20
    assert metres["tool_force"][-1] == pytest.approx(path["tool_force"][-1], rel=1e-6)
