"""The quick subset of the extremes: every row ends right, and near its reference."""

import sys

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))
import extremes  # noqa: E402

# What the reference leaves out (bending, a clamped rim, one element) sets how near a row can come.
NEAR = {"eps": 2e-4, "stretch": 2e-4, "I1 to I2": 2e-4, "Ogden exponent": 5e-4, "Gent's limit": 5e-2, "layers": 2e-2,
        "mesh": 4e-2, "units": 1e-9, "r0/h0 2, SimplySupported": 3e-2, "r0/h0 2, Clamped": 0.3,
        "r0/h0 2000, SimplySupported": 1e-6, "r0/h0 2000, Clamped": 1e-2}


@pytest.mark.parametrize("row", list(extremes.rows(quick=True)), ids=lambda row: row[1])
def test_extreme(row):
    found = extremes.run(*row)
    assert found["outcome"] == "right"
    assert abs(found["deviation"]) < NEAR.get(found["name"], NEAR.get(found["group"]))
    assert found["mass_error"] < 1e-9 or "eps" in found["group"]
