"""The promises of `accuracy`: errors of pressure, pole thickness and rim stress against a refined mesh."""

import sys

import pytest
from conftest import ROOT

import formingx as fx

sys.path.insert(0, str(ROOT / "benchmarks"))
import trade  # noqa: E402

PROMISED = {"draft": 0.01, "standard": 0.002, "fine": 0.0003}
# P2+/P1dg, 160x8 elements: benchmarks/trade.py prints them
REFERENCE = {
    "treloar": {"pressure": 0.4932712, "pole_thickness": 0.003704015, "rim_stress": 7.132619},
    "thick_plate": {"pressure": 31.39293, "pole_thickness": 0.1770536, "rim_stress": 418.1394},
    "two_layer": {"pressure": 0.2384897, "pole_thickness": 0.5824696, "rim_stress": 3.408601},
}


@pytest.mark.parametrize("scene", trade.SCENES)
@pytest.mark.parametrize("accuracy", [pytest.param("draft"), pytest.param("standard"),
                                      pytest.param("fine", marks=pytest.mark.slow)])
def test_promised_error_is_kept(scene, accuracy):
    along, through = fx.mesh.ACCURACY[accuracy]
    found = trade.one(scene, {"model": "P2+/P1dg", "along": along, "through": through})
    for quantity in trade.QUANTITIES:
        assert found[quantity] == pytest.approx(REFERENCE[scene][quantity], rel=PROMISED[accuracy]), quantity
