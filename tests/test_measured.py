"""Demos that predict experiments: their keys, how well they fit, and the physics that ties their numbers together."""

import numpy as np
import pytest
from conftest import drawn
from test_demos import summary

STRAINS = ("0.25", "0.5", "1", "1.5", "2", "2.5")


def check_ldpe(found, largest):
    for rate in ("rate_0.03", "rate_0.3"):
        homogeneous, scene = (np.array([found[key][rate][e] for e in STRAINS]) for key in (
            "stress_Pa", "scene_stress_Pa"))
        assert list(found["stress_Pa"][rate]) == list(STRAINS) and scene == pytest.approx(homogeneous, rel=largest)
        alone = np.array([found["predicted"]["other_dampings_Pa"][rate]["separability alone"][e] for e in STRAINS])
        assert homogeneous == pytest.approx(alone, rel=0.04)           # whatever the form of the damping
        assert np.all(np.diff(np.log(homogeneous)) > 0.3)
    slow, fast = (np.array([found["stress_Pa"][r][e] for e in STRAINS]) for r in ("rate_0.03", "rate_0.3"))
    assert np.all((fast > 2 * slow) & (fast < 10 * slow))              # between a solid's and a Newtonian fluid's
    assert found["deviation_percent"]["at_the_fitted_rate_rms"]["Soskey-Winter"] < 2.6
    assert found["fitted"]["spectrum_deviation_percent"] < 1
    # steady shear, of a damping that was fitted to extension: Cox and Merz's rule
    shear = found["deviation_percent"]["steady_shear_from_complex_viscosity"]
    assert max(map(abs, shear.values())) < 10
    assert {"source", "limits", "quantity"} <= set(found) and found["fitted"]["undetermined"] == ["alpha"]


def test_ldpe_quick(tmp_path):
    check_ldpe(summary("measured_ldpe", tmp_path, "--quick"), 1e-3)
    assert drawn(tmp_path / "measured_ldpe.png")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["measured_ldpe.png", "summary.json"]


@pytest.mark.slow
def test_ldpe(tmp_path):
    found = summary("measured_ldpe", tmp_path)
    check_ldpe(found, 2e-4)
    fits = found["deviation_percent"]["at_the_fitted_rate_rms"]
    assert fits["Soskey-Winter"] < fits["Wagner"] < fits["PSM"] < 6
