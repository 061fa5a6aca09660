"""The quick rows of benchmarks/extremes.py: each run ends as expected, near its reference."""

import sys

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))
import extremes  # noqa: E402

import formingx as fx  # noqa: E402
from formingx.exact.inflation import membrane_limit_point  # noqa: E402

# What the reference leaves out (bending, a clamped rim, one element) sets how near a row can come.
NEAR = {"eps": 2e-4, "stretch": 2e-4, "I1 to I2": 2e-4, "Ogden exponent": 5e-4, "Gent's limit": 5e-2, "layers": 2e-2,
        "mesh": 4e-2, "units": 1e-9, "r0/h0 2, SimplySupported": 3e-2, "r0/h0 2, Clamped": 0.3,
        "r0/h0 2000, SimplySupported": 1e-6, "r0/h0 2000, Clamped": 1e-2}


@pytest.mark.thorough
@pytest.mark.parametrize("row", list(extremes.rows(quick=True)), ids=lambda row: row[1])
def test_extreme(row):
    found = extremes.run(*row)
    assert found["outcome"] == "right"
    assert abs(found["deviation"]) < NEAR.get(found["name"], NEAR.get(found["group"]))
    assert found["mass_error"] < 1e-9 or "eps" in found["group"]


@pytest.mark.parametrize("ratio, accuracy", [(2e4, "standard"), (1e5, "draft"), (1e5, "standard"), (1e5, "fine"),
                                             (1e6, "standard")])
def test_sheets_so_thin_that_bending_is_round_off(ratio, accuracy):
    """Each is a membrane: r0/h0 from 2e4 to 1e6 start, and pass the limit pressure of membrane theory."""
    sheet = {"radius": 1.0, "thickness": 1 / ratio}
    scene = fx.Scene(mesh=fx.mesh.disc(**sheet, accuracy=accuracy), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    limit, = fx.trace(scene, until=fx.pole_stretch(3.0), progress=False).limit_points
    assert limit.measures["pressure"] == pytest.approx(membrane_limit_point(**sheet, c10=1.0)[1].pressure, rel=1e-5)


@pytest.mark.parametrize("material", [fx.MooneyRivlin(c10=1.0, c01=0.1), fx.Gent(mu=2.0, Jm=60.0),
                                      fx.Ogden(mu=[1.0, 0.1], alpha=[1.6, 4.0])], ids=lambda m: type(m).__name__)
def test_thin_sheets_start_though_their_stresses_cancel_in_round_off(material):
    """Pressure over thickness at a pole stretch, from r0/h0 = 400 to 2e5: their stresses at rest are no exact zeros."""
    found = []
    for thickness in (1 / 400, 5e-6):
        scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=thickness, elements=(20, 1)), materials=material,
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
        found.append(fx.trace(scene, until=fx.pole_stretch(1.5), progress=False)["pressure"][-1] / thickness)
    assert found[1] == pytest.approx(found[0], rel=2e-6)


@pytest.mark.thorough
def test_a_film_that_slides_over_a_lip_starts_towards_its_target():
    """At r0/h0 = 1e5 round-off turns the first tangent; the pressure grows all the same, as that of a thicker film."""
    pressures = []
    for thickness in (1e-2, 1e-4):
        cup = fx.tools.cup(radius=8.5, depth=4.5, mouth=thickness, fillet=2.5, lip=1.2, draft=6.0)
        scene = fx.Scene(mesh=fx.mesh.disc(radius=10.0, thickness=thickness, elements=(24, 1)),
                         materials=fx.NeoHookean(c10=0.5), supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                         loads=[fx.Pressure("bottom")], contacts=[fx.Contact("top", cup, 0.3)])
        path = fx.trace(scene, until=fx.pole_height(2.0), progress=False)
        assert path["pressure"][1] > 0
        pressures.append(path["pressure"][-1] / thickness)
    assert pressures[1] == pytest.approx(pressures[0], rel=5e-3)
