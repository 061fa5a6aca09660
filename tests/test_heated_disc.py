"""The disc whose modulus varies with R: membrane theory, and the demo as a user runs it."""

import json

import numpy as np
import pytest
from conftest import drawn, run

from formingx.exact.inflation import membrane_inflation

STRETCHES, PLACES = ["1.25", "1.5", "2", "3"], ["0", "0.25", "0.5", "0.75", "0.9", "1"]


def test_theory_of_an_even_membrane_is_the_same_both_ways():
    """With c10 a function the pressure is shot for, with c10 a number it follows; in a user's units."""
    sizes = {"radius": 2.0, "thickness": 0.3, "c01": 0.17}
    a = membrane_inflation(2.0, c10=1.7, **sizes)
    b = membrane_inflation(2.0, c10=lambda R: 1.7, **sizes)
    assert (b.pressure, b.height) == pytest.approx((a.pressure, a.height), rel=1e-7)
    assert np.interp(1.0, b.R, b.thickness_ratio) == pytest.approx(np.interp(1.0, a.R, a.thickness_ratio), rel=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("options, allowed", [
    (("--quick",), {"membrane": (2e-4, 1e-3, 1e-3), "solid": (1e-3, 5e-3, 1e-2)}),
    pytest.param((), {"membrane": (1e-5, 1e-4, 1e-4), "solid": (2e-4, 1e-3, 5e-3)}, marks=pytest.mark.slow),
], ids=["quick", "full"])
def test_demo_summary_agrees_with_membrane_theory(options, allowed, tmp_path):
    """Off membrane theory at most so much in pressure and height, in thickness, and in thickness at the hinge."""
    run("demos/heated_disc.py", "--out", tmp_path, *options)
    found = json.loads((tmp_path / "summary.json").read_text())
    for model, (p, thickness, hinge) in allowed.items():
        for case in ("cool_rim", "step", "hot_rim"):
            assert list(found[model][case]) == STRETCHES
            for stretch in STRETCHES:
                a, b = found[model][case][stretch], found["membrane_theory"][case][stretch]
                for key in ("p_R0_over_C0_h0", "w_over_R0"):
                    assert a[key] == pytest.approx(b[key], rel=p)
                a, b = a["thickness_ratio_at_R"], b["thickness_ratio_at_R"]
                assert list(a) == PLACES
                for R in PLACES:
                    assert a[R] == pytest.approx(b[R], rel=hinge if R == "1" else thickness)
    assert drawn(tmp_path / "heated_disc.png")
