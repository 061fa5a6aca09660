"""A run costs little more than its linear algebra."""

import sys

from conftest import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))
import limit  # noqa: E402


def test_a_run_costs_little_more_than_its_linear_algebra():
    limit.measure(limit.inflation, (10, 1))                 # imports and forms
    found = limit.measure(limit.inflation, (40, 2))
    assert 0.5 < found["ratio"] < 3 and found["iterations"] < 80


def test_a_tool_is_looked_at_once_for_the_same_points(monkeypatch):
    calls, nearest = [0], limit.fx.Tool.nearest

    def counted(self, x):
        calls[0] += 1
        return nearest(self, x)
    monkeypatch.setattr(limit.fx.Tool, "nearest", counted)
    scene, _ = limit.cup((20, 1))
    path = limit.fx.trace(scene, until=limit.fx.pressure(8.0), step=limit.fx.StepControl(target=8), progress=False)
    assert calls[0] < 2 * path.counts.iterations + 12 * len(path)
