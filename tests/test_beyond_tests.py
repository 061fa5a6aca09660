"""Warnings for deformations that the tests of a material do not cover, and the share of the body that has them."""

import numpy as np
import pytest

import formingx as fx
from formingx.extensions.fits.tested import MeasuredRange, nearest_test, principal_strains

RUBBER = fx.NeoHookean(c10=0.2)


def strain(mode, stretch):
    k = {"uniaxial": -0.5, "pure_shear": 0.0, "equibiaxial": 1.0}[mode]
    return principal_strains(np.array([[stretch], [stretch**k]]))


def outside(tested, mode, stretch):
    return bool(tested.outside(strain(mode, stretch))[0])


def test_a_uniaxial_test_covers_only_uniaxial_tension():
    tested = MeasuredRange.from_stretches({"uniaxial": np.linspace(1, 4, 9)})
    assert not outside(tested, "uniaxial", 3.9) and outside(tested, "uniaxial", 5.0)
    assert outside(tested, "pure_shear", 1.5) and outside(tested, "equibiaxial", 1.2)
    assert not outside(tested, "equibiaxial", 1.005) and tested.single_mode            # small strains are all alike
    assert tested.distance(strain("uniaxial", 8.0))[0] == pytest.approx(np.log(2) * np.hypot(1, 0.5))


def test_compression_is_equibiaxial_tension():
    """A block pressed to l is stretched l^(-1/2) in both other directions."""
    tested = MeasuredRange.from_stretches({"uniaxial": (0.25, 1.0)})
    assert not outside(tested, "equibiaxial", 1.9) and outside(tested, "equibiaxial", 2.5)
    assert outside(tested, "uniaxial", 1.5)
    assert nearest_test(*strain("uniaxial", 0.3)[0]) == "equibiaxial"


def test_modes_between_two_tested_modes_are_covered_up_to_their_strain():
    tested = MeasuredRange.from_stretches({"uniaxial": (1.0, 4.0), "equibiaxial": (1.0, 3.0)})
    assert not outside(tested, "pure_shear", 2.0) and outside(tested, "pure_shear", 4.5)
    assert tested.distance(strain("pure_shear", 2.0))[0] == 0 and not tested.single_mode
    biaxial = MeasuredRange.from_stretches({"biaxial": np.array([[2.0, 3.0], [1.5, 1.0]])})
    assert not biaxial.outside(principal_strains(np.array([[1.5], [2.0]])))[0]                  # whatever the order


def blown(material, stretch=2.0, **more):
    scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=0.5, elements=(8, 1)), materials=material,
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")], **more)
    return fx.trace(scene, until=fx.pole_stretch(stretch), progress=False)


@pytest.mark.parametrize("more", [{}, {"model": fx.Membrane()}], ids=["solid", "membrane"])
def test_warning_names_the_volume_share_beyond_the_tests(more):
    """The volume that is thinner than in the equibiaxial tests leaves them: its share by the profile of the wall."""
    from formingx.extensions.fits.beyond_tests import strains_beyond_tests
    covered = fx.with_tests(RUBBER, uniaxial=(1, 3), equibiaxial=(1, 2.6))
    assert list(strains_beyond_tests(blown(covered, **more))) == []
    short = fx.with_tests(RUBBER, uniaxial=(1, 4), equibiaxial=(1, 1.6))
    path = blown(short, **more)
    finding, = strains_beyond_tests(path)
    share = float(finding.text.split(" %")[0]) / 100
    profile = path.profile()
    R = np.linspace(0, 10, 400)
    wall = np.interp(R, profile.reference_radius, profile.thickness_ratio)
    thin = wall < 1.6**-2 * np.exp(-2 * 0.1 * np.log(1.6))                  # a tenth of the strain is allowed
    assert share == pytest.approx(np.sum(R * thin) / np.sum(R), abs=0.12) and 0.05 < share < 0.6
    assert finding.severity == "warning" and "equibiaxial tension, tested at stretches from 1 to 1.6" in finding.text


def test_a_run_warns_and_check_predicts_it(caplog):
    data = fx.treloar1944()
    card = fx.fit(fx.MooneyRivlin, {"uniaxial": data["uniaxial"]}).material
    path = blown(card)
    assert "100 % of it is deformed as in none of its tests" in caplog.text
    assert "they leave c01 open" in caplog.text and "which was not tested" in caplog.text
    report = str(fx.check(path.problem.scene, targets=[fx.pole_stretch(2.0)]))
    assert "do not determine c01" in report and "about 2-fold in all directions" in report
    caplog.clear()
    blown(fx.fit(fx.MooneyRivlin, data).material)
    assert "tests" not in caplog.text
    blown(RUBBER)
    assert "tests" not in caplog.text


@pytest.mark.thorough
def test_material_report_names_the_tested_range(tmp_path):
    data = fx.treloar1944()
    found = fx.fit(fx.Ogden, {"uniaxial": data["uniaxial"]})
    page = found.material.report(tmp_path / "card.html").read_text()
    assert "not determined by these tests" in page and ", ".join(found.undetermined) in page
    assert "uniaxial 1.02 to 7.6" in page and found.material.tested.undetermined == found.undetermined
    assert "tested" not in RUBBER.report(tmp_path / "card.html").read_text()


@pytest.mark.thorough
def test_warning_for_a_sheet_in_three_dimensions():
    from formingx.extensions.fits.beyond_tests import strains_beyond_tests
    scene = fx.Scene(mesh=fx.mesh.sheet(fx.mesh.circle(10.0, part="quarter"), size=4.0), thickness=0.2,
                     materials=fx.with_tests(RUBBER, uniaxial=(1, 3)), supports=[
                         fx.Clamped("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")],
                     loads=[fx.Pressure("bottom")])
    path = fx.trace(scene, until=fx.pressure(0.012), progress=False)
    finding, = strains_beyond_tests(path)
    assert "tension, which was not tested" in finding.text and "(R, Z)" not in finding.text
