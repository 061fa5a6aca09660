"""The demos of bottles in three dimensions, quick and in full, with their key numbers."""

import importlib
import json

import pytest
from conftest import ROOT, drawn
from test_demos import summary


@pytest.mark.thorough
def test_square_bottle_quick(tmp_path):
    found = summary("square_bottle", tmp_path, "--quick")
    bottle, strain = found["square_bottle"], found["square_bottle"]["plane_strain"]
    assert bottle["weight_g"] == pytest.approx(41.16, abs=0.1) and bottle["capacity_ml"] == pytest.approx(662, abs=3)
    assert bottle["middle_of_face_mm"]["mid_height"] == pytest.approx(strain["middle_of_face_mm"], rel=0.03)
    assert bottle["edge_mm"]["mid_height"] == pytest.approx(strain["edge_mm"], rel=0.04)
    assert bottle["least_wall_mm"] < strain["edge_mm"]


@pytest.mark.slow
def test_square_bottle(tmp_path):
    found = summary("square_bottle", tmp_path)
    bottle, strain = found["square_bottle"], found["square_bottle"]["plane_strain"]
    assert bottle["least_wall_mm"] == pytest.approx(0.348, rel=0.02)        # 120 x 36: the same; 168 x 48 equal: 0.352
    assert bottle["edge_mm"]["mid_height"] == pytest.approx(strain["edge_mm"], rel=0.02)
    assert bottle["middle_of_face_mm"]["mid_height"] == pytest.approx(strain["middle_of_face_mm"], rel=0.03)
    assert found["round"]["least_wall_over_solid"] == pytest.approx(1, abs=0.015)
    assert found["round"]["bands_largest_percent"] < 2
    assert found["inflation"]["limit_pressure_R_over_mu_H"] == pytest.approx(0.91071, rel=1e-3)
    assert found["inflation"]["limit_volume_over_first"] == pytest.approx(2.7368, rel=1e-3)
    assert drawn(tmp_path / "square_bottle_3d.png")


@pytest.mark.thorough
def test_walls_of_a_short_round_bottle_miss_those_of_a_solid_by_its_thickness(monkeypatch):
    """A membrane has no bending stiffness. Bands next to the neck differ most, in proportion to wall over radius."""
    monkeypatch.syspath_prepend(ROOT / "demos")
    demo = importlib.import_module("square_bottle")
    monkeypatch.setattr(demo, "RADIUS", 20.0)
    monkeypatch.setattr(demo, "ROUND_LENGTH", 60.0)
    monkeypatch.setattr(demo, "ROUND_MOULD", {
        "radius": 40.0, "height": 50.0, "neck": 22.0, "shoulder": 14.0, "neck_height": 8.0, "base": -72.0,
        "fillet": 10.0, "shoulder_fillet": 10.0})
    bands = []
    for wall in (0.5, 0.25):
        monkeypatch.setattr(demo, "THIN", wall)
        found = demo.round_bottle((53, 6), 80)
        bands.append(found["bands_largest_percent"])
        assert found["least_wall_over_solid"] == pytest.approx(1, abs=0.01)
    assert bands[1] / bands[0] == pytest.approx(0.5, abs=0.1) and bands[1] < 1.5


@pytest.mark.thorough
def test_closing_halves_quick(tmp_path):
    found = summary("closing_halves", tmp_path, "--quick")
    assert found["pinch_half_width_over_R"] == pytest.approx(1.55, abs=0.02)                # pi/2 without stretch
    assert found["bottle_share_of_weight"] == pytest.approx(180 / 210, rel=0.02)
    assert 0.15 < found["least_wall_ratio"] < 0.25


@pytest.mark.slow
def test_closing_halves(tmp_path):
    found = summary("closing_halves", tmp_path)
    assert found["pinch_half_width_over_R"] == pytest.approx(1.55, abs=0.02)
    assert found["bottle_share_of_weight"] == pytest.approx(180 / 210, rel=1e-3)
    assert drawn(tmp_path / "closing_halves.png")


@pytest.mark.thorough
def test_stretch_blow_quick(tmp_path):
    found = summary("stretch_blow", tmp_path, "--quick")
    assert found["weight_g"] == pytest.approx(25.86, abs=0.1)
    assert found["rod_force_largest_N"] == pytest.approx(616.5, rel=0.02)
    assert found["least_wall_mm"] > 1.5 * found["without_rod"]["least_wall_mm"]


@pytest.mark.slow
def test_stretch_blow(tmp_path):
    found = summary("stretch_blow", tmp_path)
    assert found["least_wall_mm"] > 1.5 * found["without_rod"]["least_wall_mm"]
    assert found["round"]["least_wall_over_solid"] == pytest.approx(1, abs=0.025)
    assert drawn(tmp_path / "stretch_blow.png")
    assert json.loads((tmp_path / "summary.json").read_text())["rod_force_largest_N"] > 500
