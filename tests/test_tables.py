"""Tables and shift factors: values, slopes, UFL against NumPy, errors."""

import numpy as np
import pytest
import ufl
from dolfinx import mesh
from mpi4py import MPI

import formingx as fx
from formingx import _compat
from formingx.values.table import table
from formingx.values.temperature import WLF, Arrhenius

MODULUS = {130: 2.0, 150: 0.6, 160: 0.6, 170: 0.2}


def at_points(expression, low, high, n=61):
    """An expression of x, which runs from low to high over the mesh, and its derivative, at n points."""
    line = mesh.create_interval(MPI.COMM_SELF, 1, [low, high])
    s = np.linspace(0, 1, n)
    x = ufl.variable(ufl.SpatialCoordinate(line)[0])
    f = expression(x)
    both = _compat.compile_expression(ufl.as_vector([f, ufl.diff(f, x)]), s[:, None])
    values = both.eval(line, np.array([0], dtype=np.int32)).reshape(n, 2)
    return low + (high - low) * s, values[:, 0], values[:, 1]


def test_table_goes_through_its_points_and_is_monotone_between_them():
    curve = table(MODULUS)
    assert curve(list(MODULUS)) == pytest.approx(list(MODULUS.values()), rel=1e-14)
    x = np.linspace(130, 170, 4001)
    assert np.all(np.diff(curve(x)) <= 1e-15)
    assert np.ptp(curve(np.linspace(150, 160, 50))) < 1e-15
    straight = table({0: 1.0, 2: 5.0})
    assert straight([0.5, 1.0]) == pytest.approx([2.0, 3.0], rel=1e-14)
    assert float(straight(1.5)) == pytest.approx(4.0)


def test_table_as_an_expression_is_the_same_curve_and_its_slope():
    curve = table(MODULUS)
    x, value, slope = at_points(curve, 130, 170)
    assert value == pytest.approx(curve(x), rel=1e-12, abs=1e-13)
    h = 1e-4
    inner = np.min(np.abs(np.subtract.outer(x, curve.x)), axis=1) > 2 * h        # the slope has kinks at the points
    quotient = (curve(x[inner] + h) - curve(x[inner] - h)) / (2 * h)
    assert slope[inner] == pytest.approx(quotient, abs=1e-7)
    x, value, slope = at_points(curve, 100, 129)                                 # straight beyond the ends
    assert np.ptp(slope) < 1e-12 and value == pytest.approx(2.0 + slope[0] * (x - 130), rel=1e-12)


def test_wlf():
    shift = WLF(17.44, 51.6, 100.0)                          # the "universal" constants, at the glass temperature
    assert shift(100.0) == pytest.approx(1.0, rel=1e-14) and shift(shift.limits[0]) == pytest.approx(1e30, rel=1e-9)
    assert shift(110.0) == pytest.approx(10 ** (-17.44 * 10 / 61.6), rel=1e-13)
    # the same law from another reference: c1' c2' = c1 c2, c2' = c2 + T' - T (Ferry 1980, eq. 11-27)
    other = WLF(17.44 * 51.6 / 91.6, 91.6, 140.0)
    assert other([110.0, 170.0]) == pytest.approx(shift([110.0, 170.0]) / shift(140.0), rel=1e-12)
    x, value, _ = at_points(shift, 80, 180)
    assert value == pytest.approx(shift(x), rel=1e-12)
    with pytest.raises(fx.InputError, match="must be above reference - c2, 48.4"):
        shift([100.0, 48.4])


def test_arrhenius():
    celsius, kelvin = Arrhenius(80e3, 150.0, unit="C"), Arrhenius(80e3, 423.15, unit="K")
    assert celsius(150.0) == pytest.approx(1.0, rel=1e-14)
    assert celsius(170.0) == pytest.approx(np.exp(80e3 / 8.31446261815324 * (1 / 443.15 - 1 / 423.15)), rel=1e-13)
    assert kelvin(443.15) == pytest.approx(celsius(170.0), rel=1e-12)
    x, value, _ = at_points(kelvin, 350, 500)
    assert value == pytest.approx(kelvin(x), rel=1e-12)
    with pytest.raises(fx.InputError, match="absolute zero"):
        celsius(-274.0)
    with pytest.raises(fx.InputError, match="absolute zero"):
        Arrhenius(80e3, -10.0, unit="K")


@pytest.mark.parametrize("make", [lambda: WLF(-1, 50, 100), lambda: WLF(17, 0, 100), lambda: Arrhenius(0, 1, unit="K"),
                                  lambda: Arrhenius(8e4, 150, unit="F"), lambda: WLF(17, 50, "hot")])
def test_constants_that_are_refused(make):
    with pytest.raises(fx.InputError):
        make()


@pytest.mark.parametrize("function, start, until", [
    (lambda t: 3 * np.sin(t) ** 2, 0.0, 5.0), (lambda t: -np.exp(-5 * t), 1.0, 2.0), (lambda t: 7.0, 0.0, 1.0),
    (lambda t: 1e-9 * t**3, -1.0, 1.0)])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_amplitude(function, start, until, tolerance):
    """Nowhere off by more than the tolerance, ends exact, and the points are as many as its curvature asks for."""
    t, f = np.array(fx.amplitude(function, until, start, tolerance=tolerance)).T
    fine = np.linspace(start, until, 10001)
    exact = np.broadcast_to(function(fine), fine.shape)
    assert (t[0], t[-1]) == (start, until) and np.all(np.diff(t) > 0) and len(t) < 9 + 8 / np.sqrt(tolerance)
    assert np.abs(np.interp(fine, t, f) - exact).max() <= 1.3 * tolerance * max(np.ptp(exact), 1e-300)


@pytest.mark.parametrize("function, words", [
    (lambda t: t > 0.3, "not smooth near t = 0.3"), (lambda t: np.where(t > 0.5, np.nan, t), "not a finite number"),
    (None, "fails")])
def test_wrong_amplitudes_are_refused(function, words):
    with pytest.raises(fx.InputError, match=words):
        fx.amplitude(function, 1.0)
    with pytest.raises(fx.InputError, match="after start"):
        fx.amplitude(np.sin, 1.0, 1.0)
