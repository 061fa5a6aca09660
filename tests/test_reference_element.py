"""The forms against a hand-coded element (tests/reference): residual, tangent, and a whole inflation path."""

import numpy as np
import pytest
from reference import element
from reference.body import Body, follow, read

import formingx as fx
from formingx import _compat
from formingx.physics.kinematics import sum_of_powers
from formingx.problem.problem import Problem


def as_printed(F, m1, a1, m2, a2):
    """(4.3) with two terms; `Ogden` itself writes a negative exponent in another way, the same at constant volume."""
    return sum(m / a * (sum_of_powers(F, a) - 3) for m, a in ((m1, a1), (m2, a2)))


LAWS = {
    "mooney": (fx.MooneyRivlin(c10=1.7, c01=0.35), element.Mooney(1.7, 0.35)),
    "ogden": (fx.Ogden(mu=(1.4, 0.5, 0.02), alpha=(2.5, 1.3, 5.0)), element.Ogden((1.4, 0.5, 0.02), (2.5, 1.3, 5.0))),
    "ogden-negative": (fx.Hyperelastic(as_printed, of="F", m1=1.4, a1=2.5, m2=-0.3, a2=-2.0),
                       element.Ogden((1.4, -0.3), (2.5, -2.0))),
}


def pair(scene, law, folder):
    """(problem of formingx, hand-coded body, dofs): dofs[2 n + i] is formingx' number of component i of node n."""
    problem = Problem(scene)
    fx.mesh.write(scene.mesh, folder / "mesh.txt")
    nodes, triangles, boundaries = read(folder / "mesh.txt")
    keeping = scene.model
    penalty = element.Penalty(keeping.eps / problem.forms.stress)            # (3.4.1) has 1/eps, formingx mu/eps
    edges = np.vstack([boundaries[load.on] for load in scene.loads])
    body = Body(nodes, triangles, edges, law, penalty, keeping.points)
    dofs = np.empty(nodes.size, dtype=int)
    for i in (0, 1):
        sub = problem.forms.space.sub(0).sub(i)
        dofs[2 * np.asarray(_compat.cell_nodes(scene.mesh.domain)) + i] = sub.dofmap.list
    return problem, body, dofs


@pytest.mark.quick
@pytest.mark.parametrize("name, points", [("mooney", 3), ("mooney", 4), ("mooney", 7), ("ogden", 4),
                                          ("ogden-negative", 3)])
def test_residual_and_tangent(name, points, tmp_path):
    """On curved elements, stretched up to twice, sheared, under a pressure that follows: equal to 1e-10."""
    material, law = LAWS[name]
    mesh = fx.mesh.disc(radius=2.0, inner_radius=0.3, thickness=0.6, elements=(4, 2))
    rng = np.random.default_rng(5)
    X = mesh.domain.geometry.x
    X[:, :2] += 0.015 * rng.standard_normal((len(X), 2))
    scene = fx.Scene(mesh=mesh, materials=material, supports=[fx.PinnedNode(*X[0, :2])], loads=[fx.Pressure("bottom")],
                     model=fx.DisplacementPenalty(eps=0.05, points=points, stress_free=False))
    problem, body, dofs = pair(scene, law, tmp_path)
    R, Z = body.nodes.T
    u = np.stack([0.6 * R + 0.3 * Z + 0.1 * R * Z, 0.5 * (4 - R**2) - 0.45 * Z], 1)
    u += 0.02 * rng.standard_normal(u.shape)
    q, forms = 0.8, problem.forms
    hand, tangent, _ = body.residual(u, q)

    x, out = problem.x.duplicate(), problem.x.duplicate()
    values = np.zeros(u.size)
    values[dofs] = u.ravel() / forms.length
    x.setArray(values)
    control = q / forms.control_scale
    problem.residual(x, control, out)
    force = forms.stress * forms.volume / forms.length                       # the scales of formingx/solid.py
    free = np.setdiff1d(np.arange(u.size), np.flatnonzero(np.isin(dofs, problem.constrained)))
    assert len(free) == u.size - 2
    ours = force * out.array_r[dofs]
    assert np.abs(ours - hand)[free].max() < 1e-10 * np.abs(hand).max()
    ours = problem.tangent(x, control)[:, :][np.ix_(dofs, dofs)] * force / forms.length
    assert np.abs(ours - tangent)[np.ix_(free, free)].max() < 1e-10 * np.abs(tangent).max()
    problem.control_derivative(x, control, out)
    by_pressure = -body.residual(u, q)[2]
    assert np.abs(force / forms.control_scale * out.array_r[dofs] - by_pressure)[free].max() < 1e-10 * np.abs(
        by_pressure).max()


@pytest.mark.parametrize("name", LAWS)
def test_stiffness_by_hand_is_the_derivative(name):
    """The hand-coded stiffness against central differences of its own forces: the referee is sound."""
    nodes = np.array([[1.0, 0.0], [2.0, 0.1], [1.2, 1.0], [1.5, 0.0], [1.6, 0.6], [1.1, 0.5]])
    body = Body(nodes, np.arange(6)[None], np.array([[0, 3, 1]]), LAWS[name][1], element.Penalty(0.05), 4)
    u = 0.05 * np.random.default_rng(1).standard_normal(nodes.shape)
    _, K, _ = body.residual(u, 0.4)
    h = 1e-5
    for k in range(12):
        d = h * (np.arange(12) == k).reshape(6, 2)
        column = (body.residual(u + d, 0.4)[0] - body.residual(u - d, 0.4)[0]) / (2 * h)
        assert np.abs(column - K[:, k]).max() < 1e-6 * np.abs(K).max()


@pytest.mark.parametrize("material, law", [
    (fx.MooneyRivlin(c10=2.0, c01=0.05), element.Mooney(2.0, 0.05)),
    pytest.param(fx.Ogden(mu=(3.0, 1.0), alpha=(1.8, 1.4)), element.Ogden((3.0, 1.0), (1.8, 1.4)),
                 marks=pytest.mark.thorough)], ids=["mooney", "ogden"])
def test_path_through_the_pressure_maximum(material, law, tmp_path):
    """Inflated by both to the same pole heights, rim pinned at one node: pressures and displacements to 1e-7."""
    mesh = fx.mesh.disc(radius=1.25, thickness=0.082, elements=(10, 1))
    scene = fx.Scene(mesh=mesh, materials=material, supports=[fx.Symmetry("axis"), fx.PinnedNode(1.25, 0.041)],
                     loads=[fx.Pressure("bottom")],
                     model=fx.DisplacementPenalty(eps=0.1, points=3, stress_free=False))
    path = fx.trace(scene, until=fx.pole_stretch(4.0), progress=False)
    _, body, dofs = pair(scene, law, tmp_path)
    R, Z = body.nodes.T
    pin, pole = (np.argmin(np.hypot(R - radius, Z - 0.041)) for radius in (1.25, 0.0))
    held = np.concatenate([2 * np.flatnonzero(R == 0), [2 * pin, 2 * pin + 1]])
    row = np.zeros(2 * len(R))
    row[2 * pole + 1] = 1.0
    # every third state, to be quick; not the first: it is the mesh at rest, which this energy lets swell a little
    states = [s for k, s in enumerate(path.states) if k % 3 == 1 or s.kind == "limit point"]
    heights, ours = (np.array([s.measures[name] for s in states]) for name in ("pole_height", "pressure"))
    assert len(path.limit_points) == 1 and np.all(np.diff(heights) > 0)
    theirs = follow(body, held, row, heights)
    pressures = np.array([q for _, q in theirs])
    assert np.abs(ours - pressures).max() < 1e-7 * pressures.max()
    for state, (u, _) in zip(states, theirs, strict=True):
        assert np.abs(path.problem.forms.length * state.x[dofs] - u.ravel()).max() < 1e-7 * np.abs(u).max()
