"""Transfer of history variables to another mesh of the body."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from test_contact import cup, form
from test_cooling import press, pressed

import formingx as fx
from formingx.forms.transfer import MovingLeastSquares, fitted_tensors, transfer_histories
from formingx.problem.problem import Problem


def test_quadratics_are_exact_and_other_functions_converge_with_order_three():
    rng, errors = np.random.default_rng(0), []
    target = rng.uniform((0.02, 0.02), (0.98, 0.28), (300, 2))
    for n in (20, 40, 80):
        R, Z = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 0.3, n // 3))
        source = np.column_stack([R.ravel(), Z.ravel()])
        source += rng.normal(0, 0.1 / n, source.shape)
        interpolation = MovingLeastSquares(MPI.COMM_SELF, source, target)

        def smooth(X):
            return np.sin(5 * X[:, 0]) * np.exp(X[:, 1])

        def quadratic(X):
            return 1 + X[:, 0] - 2 * X[:, 1] + 3 * X[:, 0] * X[:, 1] + X[:, 1] ** 2
        assert np.abs(interpolation.fitted(quadratic(source)) - quadratic(target)).max() < 1e-12
        errors.append(np.sqrt(np.mean((interpolation.fitted(smooth(source)) - smooth(target)) ** 2)))
        same = MovingLeastSquares(MPI.COMM_SELF, source, source)
        assert same.fitted(smooth(source)) == pytest.approx(smooth(source), rel=1e-12)
    assert np.all(np.log2(np.divide(errors[:-1], errors[1:])) > 2.5), errors


def test_strains_since_a_past_state_are_transferred_as_logarithms():
    """Of C = F^T exp(H) F, H a quadratic without trace, at any F of det 1: exact, so det C stays 1."""
    rng = np.random.default_rng(0)
    source, target = rng.uniform(-1, 1, (400, 2)), rng.uniform(-0.9, 0.9, (50, 2))

    def shapes(X):
        """(C, entries 11, 22, 12, 33; F)."""
        R, Z = X.T
        H, F = np.zeros((2, len(X), 3, 3))
        H[:, 0, 0], H[:, 1, 1] = 1.5 * R - Z**2, 0.5 + R * Z
        H[:, 0, 1] = H[:, 1, 0] = Z + R**2
        H[:, 2, 2] = -H[:, 0, 0] - H[:, 1, 1]
        F[:, 0, 0], F[:, 0, 1], F[:, 1, 1], F[:, 2, 2] = np.exp(R), Z, np.exp(np.sin(Z)), np.exp(-R - np.sin(Z))
        w, v = np.linalg.eigh(H)
        C = np.swapaxes(F, 1, 2) @ (v * np.exp(w)[:, None]) @ np.swapaxes(v, 1, 2) @ F
        return np.stack([C[:, 0, 0], C[:, 1, 1], C[:, 0, 1], C[:, 2, 2]], axis=1), F
    (values, there), (wanted, here) = shapes(source), shapes(target)
    found = fitted_tensors(MovingLeastSquares(MPI.COMM_SELF, source, target), values, there, here)
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9)
    assert (found[:, 0] * found[:, 1] - found[:, 2] ** 2) * found[:, 3] == pytest.approx(np.ones(50), rel=1e-9)


def blown(elements):
    """A relaxing sheet after 0.5 s under pressure."""
    sheet = fx.Viscoelastic(fx.NeoHookean(c10=0.2), [(1.0, 0.3)])
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=elements), materials=sheet,
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    blow = fx.Stage("blow", control=scene.loads[0], until=fx.pressure(0.08), duration=0.5)
    return fx.Process(scene).run([blow], progress=False, accuracy="draft", step=fx.StepControl(length=0.02))


def test_internal_variables_are_those_of_a_run_on_the_other_mesh():
    there, here = blown((10, 2)), blown((14, 3))
    a, b = there.problem, here.problem
    assert here.last.time == pytest.approx(there.last.time)
    for problem, path, other, most in ((b, here, there, 0.01), (a, there, here, 0.01), (a, there, there, 1e-12)):
        with problem.state_context(path.last):
            transfer_histories(other.problem, other.last, problem, path.last.x, path.last.control)
            found, = problem.history.variables
        wanted, = path.last.history_variables
        assert found.time == wanted.time
        for name, values in wanted.values.items():
            size = np.abs(values - np.mean(values, (0, 1))).max()
            assert np.sqrt(np.mean((found.values[name] - values) ** 2)) < most * size, name


def test_temperatures_of_body_and_tools_are_transferred():
    path, fine = press(pressed()), Problem(fx.Scene(**parts(pressed(), elements=(12, 2))))
    variables = path.last.history_variables
    T = variables[-1]._replace(temperature=quadratic_of(path.problem.history.parts[-1]._body.points))
    there = replace(path.last, history_variables=[*variables[:-1], T])
    transfer_histories(path.problem, there, fine, np.zeros(fine.x.getLocalSize()), 0.0)
    body, found = fine.history.parts[-1]._body, fine.history.variables[-1]
    assert found.temperature == pytest.approx(quadratic_of(body.points), rel=1e-9)
    assert np.array_equal(fine.temperature.T.x.array[: len(found.temperature)], found.temperature)
    excess, kept = found.tool_excess[0], variables[-1].tool_excess[0]
    over = 0.1 * np.ptp(kept)                               # fits go beyond a jump, where the touch ends, by a little
    assert kept.min() - over < excess.min() < excess.max() < kept.max() + over and len(excess) > len(kept)
    assert excess.max() == pytest.approx(kept.max(), rel=0.1)


def quadratic_of(X):
    return 100 + 20 * X[:, 0] ** 2 - 30 * X[:, 0] * X[:, 1] + X[:, 1]


def parts(scene, elements):
    """The same scene on another mesh."""
    return {"mesh": fx.mesh.disc(radius=1.0, thickness=0.05, elements=elements), "materials": scene.materials,
            "temperature": 150.0, "supports": scene.supports, "contacts": scene.contacts, "heat": scene.heat,
            "expansion": dict(scene.expansion)}


@pytest.mark.parametrize("points", ["nodes", 3])
def test_contact_state_is_restored_after_a_transfer(points):
    path = form(cup(0.3, elements=(12, 1), points=points), 10.0)
    here, kept = Problem(path.problem.scene), path.last.history_variables[0]
    transfer_histories(path.problem, path.last, here, path.last.x, path.last.control)
    found = here.history.variables[0]
    touched = kept.history.distance > -here.contacts[0].law.theta
    assert touched.sum() > 3 and np.abs(kept.history.slip).max() > 0
    assert found.history.position == pytest.approx(kept.history.position, rel=1e-9, abs=1e-12)
    assert found.history.slip == pytest.approx(kept.history.slip, rel=1e-9)
    assert found.history.distance[touched] == pytest.approx(kept.history.distance[touched], rel=1e-9)
    assert np.all(found.history.distance[~touched] < -here.contacts[0].law.theta)
    assert np.array_equal(found.newly_closed, kept.newly_closed)
    force = here.contacts[0].tractions(path.last.x, path.last.control).force
    with path.problem.state_context(path.last) as problem:
        there = problem.contacts[0].tractions(path.last.x, path.last.control).force
    assert force == pytest.approx(there, rel=1e-6, abs=1e-9 * np.abs(there).max())
