"""The demos of heat as a user runs them: every key, and how far it is off."""

import json

import pytest
from conftest import run

TIMES = {"heating": {"convection": (5, 10, 20, 40, 80, 160), "two_sides": (5, 10, 20, 40, 80, 160),
                     "radiation_400_400": (10, 20, 40, 60, 80, 100), "radiation_450_350": (10, 20, 40, 60, 80, 100),
                     "absorbed": (10, 20, 40, 60, 80, 100)},
         "chilling": dict.fromkeys(("aluminium", "foam", "steel"), (0.05, 0.2, 1, 3, 10))}
PLACES = {"convection": ("mid", "quarter", "face", "mean"), "two_sides": ("0", "0.25", "0.5", "0.75", "1"),
          "radiation_400_400": ("top", "mid", "bottom"), "radiation_450_350": ("top", "mid", "bottom"),
          "absorbed": ("face", "mid"),
          **dict.fromkeys(("aluminium", "foam", "steel"), ("face", "mid", "top", "tool_face"))}


@pytest.mark.parametrize("options, allowed", [(("--quick",), 1e-4), pytest.param((), 2e-5, marks=pytest.mark.slow)])
@pytest.mark.parametrize("demo", ["heating", "chilling"])
def test_keys(demo, options, allowed, tmp_path):
    run(f"demos/{demo}.py", "--out", tmp_path, *options)
    found = json.loads((tmp_path / "summary.json").read_text())
    for case, times in TIMES[demo].items():
        for place in PLACES[case]:
            values = found[case][f"{place}_C_at_s"]
            assert list(values) == [f"{t:g}" for t in times] and all(isinstance(v, float) for v in values.values())
        assert found["largest_error_over_span"][case] < allowed
        assert (tmp_path / f"{case}.csv").stat().st_size > 2000
    assert len(list(tmp_path.glob("through_*.png"))) == 1
