"""Comparison with a measured wall: positions of its points, fits to it, and constants that it does not determine."""

import numpy as np
import pytest

import formingx as fx


def cap(thickness, height, scale=1.0):
    """A blown cap; at a given height its wall does not depend on the stiffness."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=thickness, elements=(8, 1)),
                     materials=fx.NeoHookean(c10=0.4 * scale), loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
    return scene, fx.pole_height(height)


RANGES = {"thickness": (0.5, 0.3, 0.8), "height": (6.0, 4.0, 9.0)}
TRUE = {"thickness": 0.55, "height": 7.0}


@pytest.fixture(scope="module")
def truth():
    return fx.Design(cap, RANGES).run(TRUE)


def noisy(truth, noise=0.0, seed=0):
    profile = truth.profile
    s = np.linspace(0.0, 0.98 * profile.arc_length[-1], 14)
    wall = np.interp(s, profile.arc_length, profile.wall_thickness)
    return fx.MeasuredWall(wall=wall * (1 + noise * np.random.default_rng(seed).standard_normal(14)), length=s)


def test_positions_by_length_point_and_reference_length_agree(truth):
    """By length, by (r, z) and by the place on the flat sheet: the same walls; a point that lies off is named."""
    profile, numbers = truth.profile, [0, 3.5, 8, 12.25]

    def there(values):
        return np.interp(numbers, np.arange(len(values)), values)
    wall, middle = there(profile.wall_thickness), np.column_stack([there(profile.middle[:, k]) for k in (0, 1)])
    for places in ({"length": there(profile.arc_length)}, {"points": middle},
                   {"reference_length": there(profile.reference_length)}):
        part = fx.MeasuredWall(wall=1.1 * wall, **places)
        found = part.compare(truth.path)
        assert found.computed == pytest.approx(wall, rel=1e-9) and part.of_path(truth.path) == pytest.approx(wall)
        assert found.deviation_percent == pytest.approx(-100 / 11)
        assert found.rms_percent == pytest.approx(100 / 11) and found.mean_percent == pytest.approx(-100 / 11)
    off = fx.MeasuredWall(wall=wall, points=middle + [0, 1.0]).compare(truth.path)
    assert "off the computed section" in str(off) and "off the computed section" not in str(found)
    left, right = off.plot()
    assert left.get_ylabel() == "wall" and right.get_ylabel() == "deviation, %"


def test_fitted_parameters_and_covariance_are_recovered(truth):
    """Without noise the true values; with noise these, within the intervals, and a covariance by hand."""
    design = fx.Design(cap, RANGES)
    first = design.run()
    exact = design.fit(wall=noisy(truth), start=first, min_change=1e-7)
    assert exact.values == pytest.approx(TRUE, rel=2e-3) and exact.best.volume > 1.05 * first.volume
    part = noisy(truth, 0.01, seed=4)
    answer = design.fit(wall=part, start=first)
    sure = answer.confidence
    for name, (low, high) in sure.intervals(0.99).items():
        assert low < TRUE[name] < high
        assert (high - low) / 2 == pytest.approx(3.054540 * sure.errors[name])      # t of 12 degrees of freedom, 99 %
    wall, by = answer.best.derivative(part.of_path)
    J, left = by / part.wall[:, None], wall / part.wall - 1
    assert sure.covariance == pytest.approx(left @ left / 12 * np.linalg.inv(J.T @ J), rel=1e-6)
    assert 0.004 < np.sqrt(left @ left / 12) < 0.02 and sure.undetermined == sure.indistinguishable == []
    slopes = answer.best.derivative("wall")[1]
    with_correlation = np.sqrt(np.diag(slopes @ sure.covariance @ slopes.T))
    assert answer.best.band(sure).deviation == pytest.approx(with_correlation, rel=1e-9)
    assert "deviation, rms" in str(answer) and "thickness" in str(sure)
    assert "measured" in [line.get_label() for line in answer.plot_wall().lines]


def test_undetermined_and_indistinguishable_parameters_are_named(truth):
    """Blown to a height, stiffness has no effect; two thicknesses that only their sum changes cannot be told apart."""
    part = noisy(truth, 0.01)
    sure = fx.Design(cap, RANGES | {"scale": (1.0, 0.5, 2.0)}).fit(wall=part, start=TRUE, max_runs=1).confidence
    assert sure.undetermined == ["scale"] and "does not determine scale" in str(sure)
    apart = fx.Design(lambda sheet, film, height: cap(sheet + film, height), {
        "sheet": (0.45, 0.1, 0.8), "film": (0.1, 0.05, 0.2), "height": (7.0, 4.0, 9.0)}).fit(
            wall=part, max_runs=1).confidence
    (a, b, correlation), = apart.indistinguishable
    assert {a, b} == {"sheet", "film"} and correlation == pytest.approx(-1, abs=1e-6)


def test_csv(tmp_path, truth):
    file = tmp_path / "part.csv"
    file.write_text("thickness [mm];r [mm];z [mm]\n0,3;0,1;6,5\n0,31;1,0;6,4\n")
    part = fx.MeasuredWall.from_csv(file)
    assert part.wall.tolist() == [0.3, 0.31] and part.points.tolist() == [[0.1, 6.5], [1.0, 6.4]]
    file.write_text("reference_length,wall\n0,0.3\n5,0.4\n")
    found = fx.MeasuredWall.from_csv(file).compare(truth.path)
    rows = found.to_csv(tmp_path / "off.csv").read_text().splitlines()
    assert rows[0].startswith("length,reference_length,measured,computed") and len(rows) == 3
    assert float(rows[2].split(",")[1]) == pytest.approx(5.0)


@pytest.mark.parametrize("text, words", [
    ("length,wall [mm]\n0,0.3\n1,-0.3\n", "wall.1. = -0.3: must be above 0"),
    ("length,width\n0,0.3\n1,0.3\n", "needs 'wall'"),
    ("length [cm],wall [mm]\n0,0.3\n1,0.3\n", "must be in one unit"),
    ("wall,r\n0.1,0.3\n0.1,0.3\n", "no places given"),
    ("wall,r,z,length\n0.1,0.3,1,1\n0.1,0.3,1,1\n", "length, points given"),
])
def test_bad_csv(tmp_path, text, words):
    (tmp_path / "part.csv").write_text(text)
    with pytest.raises(fx.InputError, match=words):
        fx.MeasuredWall.from_csv(tmp_path / "part.csv")


def test_bad_points_and_fits(truth):
    with pytest.raises(fx.InputError, match=r"length.1. = 99: the computed part goes from 0 to"):
        fx.MeasuredWall(wall=[1.0, 1.0], length=[0.0, 99.0]).compare(truth.path)
    with pytest.raises(fx.InputError, match="must be .m,. and .m, 2."):
        fx.MeasuredWall(wall=[1.0, 1.0], points=[0.0, 9.0])
    design, two = fx.Design(cap, RANGES), fx.MeasuredWall(wall=[0.3, 0.4], length=[0.0, 9.0])
    with pytest.raises(fx.InputError, match="2 measured walls for 2 parameters"):
        design.fit(wall=two, max_runs=1).confidence.intervals()
    with pytest.raises(fx.InputError, match="within is for a wanted wall"):
        design.fit(wall=two, within=(0, 5))
    with pytest.raises(fx.InputError, match="needs a fit to a MeasuredWall"):
        print(design.fit(wall=0.4, max_runs=1).confidence)
