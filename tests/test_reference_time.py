"""The exact solutions in time, held against each other, against those without time, and against homogeneous tests."""

import functools
import math

import numpy as np
import pytest
from expected_in_time import C10, P1, balloon, relaxation, viscoelastic_tube

import formingx as fx
from formingx.exact import time as reference_time
from formingx.exact.inflation import thick_wall

MATERIAL = fx.Viscoelastic(fx.NeoHookean(c10=C10), P1)


def test_block_under_a_dead_force():
    """The stress of the creep stretches equals the dead load, and is zero after unloading."""
    body = reference_time.block("uniaxial", c10=C10, branches=P1)
    body.jump_to_load(0.2, (0, 2))
    first, t = body.s, np.linspace(0, 5, 201)[1:]
    pulled = np.exp([first, *body.creep(t)])
    body.jump_to_load(0.0, (-1, body.s))
    let_go = np.exp([body.s, *body.creep(5 + t)])
    stress = MATERIAL.stress("uniaxial", np.append(pulled, let_go), times=np.concatenate([[0], t, [5], 5 + t]))
    assert np.abs(stress[:201] - 0.2).max() < 2e-5 and np.abs(stress[201:]).max() < 2e-5
    assert np.all(np.diff(pulled) > 0) and np.all(np.diff(let_go) < 0)
    assert MATERIAL.stress("uniaxial", pulled[0]) == pytest.approx(0.2, rel=1e-12)
    assert body.creep([1000.0])[0] == pytest.approx(0, abs=1e-9)                    # nothing stays


@pytest.mark.parametrize("kind", ["tube", "sphere"])
def test_wall_deformed_fast_and_slowly(kind):
    """The load equals the elastic wall: with all moduli at once, with the equilibrium in the end; 20 points suffice."""
    n = {"tube": 2, "sphere": 3}[kind]
    size = {"inner_radius": 1.0, "outer_radius": 2.0}
    body = reference_time.wall(kind, **size, c10=C10, branches=P1, points=20)
    body.jump(2.0**n - 1)
    for p, c10 in ((body.load, 0.4), (body.relax([300.0])[0], 0.05)):
        assert p == pytest.approx(thick_wall(kind, 2.0, **size, c10=c10).pressure, rel=1e-9)
    bodies = [reference_time.wall(kind, **size, c10=C10, branches=P1, points=k) for k in (20, 40)]
    for body in bodies:
        body.jump(2.0**n - 1)
    assert bodies[0].relax([0.3, 2.0]) == pytest.approx(bodies[1].relax([0.3, 2.0]), rel=1e-10)
    for body in bodies:
        body.jump_to_load(0.0, (-0.5, body.s))
    assert bodies[0].creep([3.0, 9.0]) == pytest.approx(bodies[1].creep([3.0, 9.0]), rel=1e-9)


def test_a_released_wall_is_free_of_pressure_while_it_recovers():
    """An unloaded wall stays free of load while it recovers, and recovers completely."""
    body = reference_time.wall("tube", inner_radius=1, outer_radius=2, c10=C10, branches=P1)
    body.deform(lambda t: ((1 + t) ** 2 - 1, 2 * (1 + t)), [1.0])
    body.jump_to_load(0.0, (-0.5, body.s))
    assert body.load == pytest.approx(0, abs=1e-14)
    for t in (2.0, 5.0, 20.0):
        body.creep([t])
        assert body.load == pytest.approx(0, abs=1e-10)
    assert body.creep([2000.0])[0] == pytest.approx(0, abs=1e-8)


def test_balloon_is_a_biaxial_test():
    """p R0/H0 = 2 P/l^2, with P the nominal stress of the same stretches."""
    q, t = 2.6, np.linspace(0, 10, 401)
    l = np.cbrt(1 + q * t)
    body = reference_time.balloon(c10=C10, branches=P1)
    p = body.deform(lambda t: (math.log1p(q * t) / 3, q / (3 * (1 + q * t))), t[1:])
    assert p == pytest.approx(2 * MATERIAL.stress("equibiaxial", l, times=t)[1:] / l[1:] ** 2, rel=2e-4)


def test_balloon_is_a_thin_sphere():
    """The balloon agrees with a thick sphere of R0/H0 = 100 to 1e-3 or better."""
    thin = reference_time.balloon(c10=C10, branches=P1)
    thick = reference_time.wall("sphere", inner_radius=99.5, outer_radius=100.5, c10=C10, branches=P1)
    q, t = 26.0, np.array([0.05, 0.2, 0.5, 1.0])
    p = thin.deform(lambda t: (math.log1p(q * t) / 3, q / (3 * (1 + q * t))), t)
    assert 100 * thick.deform(lambda t: (100.0**3 * q * t, 100.0**3 * q), t) == pytest.approx(p, rel=2e-4)


def test_snap_is_the_end_of_creep():
    """Creep integrated in time reaches the same stretches at the same times, up to the limit point."""
    targets = np.log([1.2, 1.3])
    body = reference_time.balloon(c10=C10, branches=P1)
    body.jump_to_load(0.8, (0, math.log(1.38)))
    times, snap = body.creep_times(targets, 2.0)
    assert times[-1] < snap
    again = reference_time.balloon(c10=C10, branches=P1)
    again.jump_to_load(0.8, (0, math.log(1.38)))
    assert again.creep(times) == pytest.approx(targets, rel=1e-9)
    before = again.creep([snap - 1e-4, snap - 1e-6])
    assert before[1] - before[0] < 0.05 and again.load == pytest.approx(0.8, rel=1e-6)
    stays = reference_time.balloon(c10=C10, branches=P1)
    stays.jump_to_load(0.1, (0, math.log(1.38)))
    last = math.exp(stays.creep([2000.0])[0])
    assert 0.2 * (1 / last - last**-7) == pytest.approx(0.1, rel=1e-8)              # the equilibrium balloon


@functools.cache
def expected(numbers):
    return numbers()


# of these solutions, for other programs to hold themselves against
@pytest.mark.parametrize("numbers, key, value", [
    (relaxation, "relaxation/uniaxial/3/0.5", 1.806308655),
    (relaxation, "relaxation/equibiaxial/10/0.1", 21.53774675),
    (relaxation, "rate/uniaxial/1/3", 3.650903074),
    (relaxation, "rate/equibiaxial/10/2", 3.040153098),
    (relaxation, "creep/5", 1.28914019),
    (relaxation, "recovery/10", 1.077581884),
    (viscoelastic_tube, "speed_1/pressure_at_inner_radius/1.5", 0.2814482335),
    (viscoelastic_tube, "speed_10/held/0.1", 0.3882327445),
    (viscoelastic_tube, "speed_0.1/inner_radius_after_release/0", 1.701503549),
    (viscoelastic_tube, "sphere/speed_1/inner_radius_after_release/10", 1.231805078),
    (balloon, "flow_2.6/p_R0_over_H0_at_stretch/1.5", 0.7257331119),
    (balloon, "flow_26/held/1", 0.2085758123),
    (balloon, "pressure_0.2/snap_time_s", 64.95442437),
    (balloon, "pressure_0.8/snap_time_s", 0.6223191115),
])
def test_reference_values_in_time(numbers, key, value):
    assert expected(numbers)[key] == pytest.approx(value, rel=1e-8)


def test_reference_summary_is_complete_and_finite():
    """As many numbers as the studies need, all finite."""
    for numbers, count in ((relaxation, 2 * 5 * 7 + 2 * 3 * 6 + 5 + 8),
                           (viscoelastic_tube, 6 * 18), (balloon, 3 * 12 + 12 + 3)):
        found = expected(numbers)
        assert np.all(np.isfinite(list(found.values()))), found
        assert len(found) == count
