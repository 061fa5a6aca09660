"""Response to forces at a few unknowns: entries of the inverse give the same as full solutions."""

import numpy as np
import pytest
from petsc4py import PETSc
from scipy import sparse
from test_contact import cup, form

from formingx.solve import linear, local_contact
from formingx.solve.linear import DirectSolver

N, ROWS = 60, np.array([3, 4, 17, 18, 40])


@pytest.fixture
def solver():
    """Solver with the factors of an unsymmetric sparse matrix, and this matrix, shape (N, N)."""
    random = np.random.default_rng(1)
    dense = (sparse.random(N, N, 0.1, random_state=random) + 4 * sparse.eye(N)).toarray()
    rows = sparse.csr_matrix(dense)
    rows.sort_indices()
    matrix = PETSc.Mat().createAIJ((N, N), csr=(rows.indptr, rows.indices, rows.data))
    made = DirectSolver(matrix, symmetric=False)
    assert made.factorise()
    yield made, dense
    made.destroy()


def vector(values):
    """Return a PETSc vector with these values."""
    return PETSc.Vec().createWithArray(np.array(values, dtype=float))


def test_entries_of_the_inverse(solver):
    """Row i, column j of the entries is that of the inverse; the factors serve for solutions afterwards."""
    made, dense = solver
    inverse = np.linalg.inv(dense)
    assert made.inverse(ROWS) == pytest.approx(inverse[np.ix_(ROWS, ROWS)], rel=1e-10, abs=1e-14)
    rhs = np.random.default_rng(2).normal(size=(N, 3))
    assert made.solve_all(rhs) == pytest.approx(inverse @ rhs, rel=1e-10, abs=1e-13)
    out = vector(np.zeros(N))
    made.solve_transposed(vector(rhs[:, 0]), out)
    assert out.array_r == pytest.approx(inverse.T @ rhs[:, 0], rel=1e-10, abs=1e-13)


def test_sparse_right_hand_sides(solver, monkeypatch):
    """Right-hand sides that are zero in most rows have the same solutions as sparse and as dense ones."""
    made, dense = solver
    monkeypatch.setattr(linear, "CONDENSATION", linear.Condensation(min_rows=N // 4))
    random = np.random.default_rng(4)
    rhs = np.zeros((N, 3))
    rhs[ROWS[:4]] = random.normal(size=(4, 3))
    rhs[ROWS[0], 1] = 0.0
    rhs[:, 2] = 0.0                                         # the force on a constrained point
    sparse = made._sparse(rhs)
    assert sparse.getType() == "transpose" and made._sparse(random.normal(size=(N, 3))) is None is made._sparse(0 * rhs)
    sparse.destroy()
    for right in (rhs, random.normal(size=(N, 3)), rhs):
        assert made.solve_all(right) == pytest.approx(np.linalg.solve(dense, right), rel=1e-10, abs=1e-13)


def test_condensed_solutions_are_the_full_ones(solver, monkeypatch):
    """Motions, changes of the control and updates agree, for a constraint on all unknowns and a tool that moves."""
    made, _ = solver
    random = np.random.default_rng(3)
    E = np.zeros((N, 7))
    E[ROWS] = random.normal(size=(len(ROWS), 7))
    border = local_contact.BorderedTangent(vector(random.normal(size=N)), vector(random.normal(size=N)), 0.7)

    def moved(dx, step):
        return dx[ROWS] * 2 - np.multiply.outer(np.arange(len(ROWS)), step)
    full = local_contact.columns(made, E, border)
    monkeypatch.setattr(local_contact, "CONDENSATION", linear.Condensation(min_columns=7, min_rows=N))
    condensed = local_contact.columns(made, E, border)
    assert isinstance(full, local_contact.BorderedColumns) and isinstance(condensed, local_contact.CondensedColumns)
    forces = random.normal(size=(7, 2))
    assert condensed.steps == pytest.approx(full.steps, rel=1e-10)
    assert condensed.motions(moved) == pytest.approx(full.motions(moved), rel=1e-9, abs=1e-12)
    for a, b in zip(condensed.update(forces[:, 0]), full.update(forces[:, 0])):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-12)
    assert condensed.updates(forces) == pytest.approx(full.updates(forces), rel=1e-9, abs=1e-12)


def test_a_cup_with_condensed_solutions(monkeypatch):
    """A stuck cup has the same states, walls and iterations, whichever way the local contact problem is solved."""
    full = form(cup("stick", (30, 1)), 10.0)
    made = []
    condensed = local_contact.CondensedColumns.__init__
    monkeypatch.setattr(local_contact.CondensedColumns, "__init__", lambda *args: made.append(1) or condensed(*args))
    monkeypatch.setattr(local_contact, "CONDENSATION", linear.Condensation(min_columns=0, min_rows=0))
    found = form(cup("stick", (30, 1)), 10.0)
    assert made and found.counts.iterations == full.counts.iterations
    assert found.profile().thickness == pytest.approx(full.profile().thickness, rel=1e-8)
