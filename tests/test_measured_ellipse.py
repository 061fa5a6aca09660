"""A film blown over an elliptical hole, predicted from the rise of its middle."""

import json
import sys

import numpy as np
import pytest
from conftest import ROOT, drawn, run

sys.path.insert(0, str(ROOT / "demos"))
import measured_ellipse  # noqa: E402

from formingx.exact.inflation import membrane_inflation  # noqa: E402

PLACES = ["10_0", "20_0", "25_0", "0_20", "0_40", "0_50", "15_20", "15_30", "10_45", "20_20"]


def test_round_hole(monkeypatch):
    """Over a round hole the rise, the strains and the wall are those of the membrane of revolution."""
    exact = membrane_inflation(1.05, radius=30.0, thickness=0.1, c10=1.0)
    for name, value in {"HALF_LENGTH": 30.0, "RISE": exact.height, "PLACES": [(10, 0), (0, 20), (20, 0)]}.items():
        monkeypatch.setattr(measured_ellipse, name, value)
    path = measured_ellipse.blow(measured_ellipse.LAWS["neo_hookean"], 1.5)
    assert path.last.measures["pressure"] == pytest.approx(exact.pressure, rel=5e-3)
    for (x, y), found in zip(measured_ellipse.PLACES, measured_ellipse.predicted(path).values(), strict=True):
        R, r, z = np.asarray(exact.R), np.asarray(exact.r), np.asarray(exact.z)
        at = np.interp(max(x, y), r, R)
        hoop, ratio = max(x, y) / at, np.interp(at, R, exact.thickness_ratio)
        e1, e2 = (-np.log(hoop * ratio), np.log(hoop))[::1 if x else -1]
        assert found["e1"] == pytest.approx(e1, abs=2e-4) and found["e2"] == pytest.approx(e2, abs=2e-4)
        assert found["wall_ratio"] == pytest.approx(ratio, abs=3e-4)
        assert found["W_mm"] == pytest.approx(np.interp(at, R, z), abs=3e-3)


def check(found):
    """The keys, the order of the strains and of the rise, the constant volume, the weak influence of the law."""
    assert all(set(found[place]) == {"W_mm", "e1", "e2", "wall_ratio"} for place in PLACES)
    for line in (PLACES[:3], PLACES[3:6]):
        rises = [found["rise_mm"], *(found[place]["W_mm"] for place in line), 0.0]
        assert rises == sorted(rises, reverse=True)
    for place in PLACES:
        numbers = found[place]
        assert 0 < numbers["e2"] < numbers["e1"] < 0.1 and numbers["W_mm"] > 3.5
        assert np.log(numbers["wall_ratio"]) == pytest.approx(-numbers["e1"] - numbers["e2"], abs=1e-12)
    for law in ("mooney_0.3", "hencky"):
        assert max(found["change_by_law"][law][e] for e in ("e1", "e2")) < 2e-3
    assert found["change_by_law"]["power_0.6"]["e1"] > found["change_by_law"]["power_0.8"]["e1"]


@pytest.mark.thorough
def test_measured_ellipse_quick(tmp_path):
    run("demos/measured_ellipse.py", "--quick", "--out", tmp_path)
    found = json.loads((tmp_path / "summary.json").read_text())
    check(found)
    assert found["25_0"]["e1"] == pytest.approx(0.0892, abs=1e-3)
    assert drawn(tmp_path / "measured_ellipse.png")


@pytest.mark.slow
def test_measured_ellipse(tmp_path):
    """Rises within 2e-3 mm and strains within 1e-4 of those on triangles half as large."""
    run("demos/measured_ellipse.py", "--out", tmp_path)
    found = json.loads((tmp_path / "summary.json").read_text())
    check(found)
    change = found["change_by_last_refinement"]
    assert change["W_mm"] < 2e-3 and change["e1"] < 1e-4 and change["e2"] < 1e-4
    assert found["0_50"]["e1"] == pytest.approx(0.04617, abs=2e-4)
    assert found["15_30"]["W_mm"] == pytest.approx(6.3066, abs=2e-3)
