"""The contact law in C: the same values as the equations written out for one point after the other."""

import math

import numpy as np
import pytest

import formingx as fx
from formingx.physics.contact_law import STICKS, ContactHistory, Law, Motion

THETA, SLIP = 1e-2, 1e-3
TOOL = fx.tools.cup(radius=1.0, depth=1.0, mouth=0.1, fillet=0.2)


def ramp(d, pulls, bonded):
    """Equation (5.13) and its derivative; of contact that does not separate a straight line."""
    if pulls:
        return (d + THETA, 1.0) if bonded or d > -THETA else (0.0, 0.0)
    if d >= THETA:
        return d, 1.0
    return max(d + THETA, 0.0) ** 2 / (4 * THETA), max(d + THETA, 0.0) / (2 * THETA)


def by_hand(law, i, near, x, old, sense, expected):
    """(force, sense, distance kept, slip kept) of point i by eqs. (5.7) to (5.14), linearised at `expected`."""
    k, mu, d = np.broadcast_to(law.k, len(x))[i], np.broadcast_to(law.mu, len(x))[i], near.distance[i]
    n, t = near.normal[i], near.tangent[i]
    touched = old.distance[i] > -THETA
    bonded = law.adhesive and touched
    at = d if expected is None else expected.distance[i]
    F, slope = ramp(at, law.adhesive, bonded)
    N, T, sliding, kept = k * (F + slope * (d - at)), 0.0, 0.0, 0.0
    if law.has_friction:
        came = (old.position if touched else old.closure)[i]
        g = old.slip[i] + (0.0 if math.isnan(came[0]) else t @ (x[i] - came))
        predicted = g if expected is None else expected.slip[i]
        if mu >= STICKS:
            s = k * slope
            rising = k / (2 * THETA) if abs(at) < THETA and not law.adhesive else 0.0
        else:
            s, rising = mu * k * F / SLIP, mu * k * slope / SLIP
        T = s * g + rising * (d - at) * predicted
        slides = np.all(np.isfinite(law.mu)) and abs(s * predicted) > mu * k * F
        if slides and not (sense is not None and s * predicted * sense[i] < 0):
            sliding = math.copysign(1.0, s * predicted)
            T = sliding * mu * N
        kept = T / s * (1 + 1e-9 * abs(sliding)) if s > 0 else 0.0
    return N * n + T * t, sliding, max(d, 0.0) if bonded else d, kept


@pytest.mark.parametrize("mu", [0.0, 0.3, np.inf, "mixed", "each"])
@pytest.mark.parametrize("pulls", [False, True])
@pytest.mark.parametrize("predicted", [False, True])
def test_law_of_many_points_is_the_law_of_each(mu, pulls, predicted):
    rng, n = np.random.default_rng(3), 200
    x = rng.uniform(0, 1.2, (n, 2))
    near = TOOL.nearest(x)
    x = x - near.normal * (near.distance - THETA * rng.uniform(-1.5, 2, n))[:, None]
    mu = {"mixed": np.where(rng.random(n) < 0.5, 0.3, np.inf), "each": rng.uniform(0.1, 0.5, n)}.get(mu, mu)
    law = Law(TOOL, mu, rng.uniform(10, 100, n), THETA, SLIP, rng.uniform(0, THETA / 10, n), pulls)
    came = np.where(rng.random((n, 1)) < 0.2, np.nan, x + SLIP * rng.normal(size=(n, 2)))
    old = ContactHistory(x + SLIP * rng.normal(size=(n, 2)), THETA * rng.uniform(-2, 2, n), SLIP * rng.normal(size=n),
                         came)
    sense = rng.choice([-1.0, 0.0, 1.0], n) if predicted else None
    expected = Motion(x, THETA * rng.uniform(-2, 2, n), x, SLIP * rng.normal(size=n), x) if predicted else None
    found, near = law.tractions(x, old, sense, expected), law.nearest(x)
    force, sliding, distance, slip = zip(*(by_hand(law, i, near, x, old, sense, expected) for i in range(n)))
    np.testing.assert_allclose(found.force, force, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found.sense, sliding)
    np.testing.assert_allclose(found.history.distance, distance, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.history.slip, slip, rtol=0, atol=1e-15)


@pytest.mark.parametrize("mu", [0.0, 0.3, "each"])
def test_law_of_some_points_has_their_penalties_and_friction(mu):
    """Also after the law of all points was evaluated, and with other coefficients of friction."""
    rng, n, some = np.random.default_rng(5), 20, np.array([7, 2, 11])
    x = rng.uniform(0, 1.2, (n, 2))
    near = TOOL.nearest(x)
    x = x - near.normal * (near.distance - THETA * rng.uniform(-0.5, 2, n))[:, None]
    mu = rng.uniform(0.1, 0.5, n) if mu == "each" else mu
    law = Law(TOOL, mu, rng.uniform(10, 100, n), THETA, SLIP)
    old = ContactHistory(x - SLIP * rng.normal(size=(n, 2)), np.full(n, THETA), SLIP * rng.normal(size=n), x)
    part = ContactHistory(*(values[some] for values in old))
    for whole in (law, law.with_friction(0.2), law.with_friction(rng.uniform(0.1, 0.5, n))):
        force = whole.tractions(x, old).force
        np.testing.assert_allclose(whole.part(some).tractions(x[some], part).force, force[some], rtol=1e-12)
