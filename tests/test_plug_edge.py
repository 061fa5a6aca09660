"""The stress peak under the edge of a plug: it converges with a fillet; without one a message denies it."""

import sys

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))
from plug_edge_convergence import CASES, peak, press  # noqa: E402


def peaks(case, refinements, travel=2.0):
    found = []
    for n in refinements:
        path, end = press(*CASES[case], n, travels=(travel,))
        assert end == "done"
        found.append(peak(path, travel))
    return found


def test_a_coarse_mesh_reports_an_unresolved_stress_peak():
    """Both have their largest stress on the lower face; only under the sharp edge may there be a larger one."""
    fillet, sharp = peaks("fillet", (1,))[0], peaks("sharp", (1,))[0]
    for found in (fillet, sharp):
        assert found.value == pytest.approx(0.515, rel=0.02) and found.point[1] == 0
    assert fillet.converged and not sharp.converged
    assert sharp.doubtful_point[1] > 0.5 and abs(sharp.doubtful_point[0] - 1.905) < 0.1
    assert "has not converged" in str(sharp) and "has not converged" not in str(fillet)


@pytest.mark.slow
def test_peaks_under_refinement():
    """MPa: 0.5203, 0.5150, 0.5135 with a fillet of h0/2 and mu = 0.3; 0.523, 0.614, 0.933 sharp, stuck.

    On meshes of sizes 1, 1/2, 1/3 the differences of an error of order 1 are as 3 to 1.
    """
    fillet, sharp = peaks("fillet", (1, 2, 3)), peaks("sharp, stick", (1, 2, 3))
    a, b, c = (p.value for p in fillet)
    assert all(p.converged for p in fillet) and abs(b - c) < abs(a - b) / 3 < 5e-3 * c
    assert fillet[2].error < fillet[1].error < fillet[0].error
    assert not any(p.converged for p in sharp)
    assert sharp[1].value > 1.1 * sharp[0].value and sharp[2].value > 1.3 * sharp[1].value
    assert max(p.doubtful_error for p in sharp[1:]) > sharp[0].doubtful_error
