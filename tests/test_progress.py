"""Progress messages of long runs."""

import logging
import re
import subprocess
import sys

import pytest
from conftest import ROOT

import formingx as fx
from formingx.solve import progress


def plug():
    ball = fx.Contact("top", fx.tools.sphere(radius=15.0, z=1.2), friction=0.3, penalty=2e4, separates=True,
                      direction=(0, -1))
    return fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(20, 1)), materials=fx.NeoHookean(c10=0.4),
                    supports=[fx.Symmetry("axis"), fx.Clamped("rim")], contacts=[ball])


@pytest.mark.parametrize("shown, level", [(True, logging.WARNING), (False, logging.INFO)])
def test_a_long_run_logs_its_progress(shown, level, monkeypatch, caplog):
    """Each line: how far, what limits the steps, and how long it will take; seen without asking if there is a bar."""
    monkeypatch.setattr(progress.Progress, "silence", 1e-3)    # a fast machine needs 0.06 s for the run
    with caplog.at_level(logging.INFO, "formingx"):
        fx.trace(plug(), until=fx.travel(15.0), progress=shown)
    lines = [r for r in caplog.records if "of the way in" in r.getMessage()]
    assert lines and all(r.levelno == level for r in lines)
    parts = [float(re.search(r"to travel = 15: (\S+) % of the way", r.getMessage())[1]) for r in lines]
    assert parts == sorted(parts) and 0 <= parts[0] < parts[-1] <= 100
    assert any("limited by gap closure" in r.getMessage() and " left" in r.getMessage() for r in lines)


def test_a_short_run_says_nothing(caplog):
    with caplog.at_level(logging.INFO, "formingx"):
        fx.trace(plug(), until=fx.travel(1.0), progress=False)
    assert not [r for r in caplog.records if "of the way in" in r.getMessage()]


IMPORT = """
import sys
class Stop:
    def find_spec(self, name, *_):
        if name == "formingx.runs":
            raise {error}
sys.meta_path.insert(0, Stop())
import formingx
"""


@pytest.mark.thorough
@pytest.mark.parametrize("error, lines", [("KeyboardInterrupt", 1), ("ValueError('x')", None)])
def test_ctrl_c_while_it_is_imported(error, lines):
    """One line, and the status of an interrupt; another error keeps its traceback."""
    ended = subprocess.run([sys.executable, "-c", IMPORT.format(error=error)], capture_output=True, text=True, cwd=ROOT)
    assert ended.returncode != 0
    if lines:
        assert ended.stderr.splitlines() == ["interrupted while formingx was imported"]
    else:
        assert "Traceback" in ended.stderr and ended.stderr.endswith("ValueError: x\n")


@pytest.mark.thorough
def test_importing_restores_the_exception_hook():
    script = "import sys, formingx; sys.exit(sys.excepthook is not sys.__excepthook__)"
    assert subprocess.run([sys.executable, "-c", script], cwd=ROOT).returncode == 0


def test_a_run_whose_steps_grow_is_not_given_up():
    """Of 501 states that gained less than 1e-3, the last half gained more: a slow ramp that began with short steps."""
    def stalled(values):
        targets = object.__new__(progress.RunTargets)
        targets.values, targets.until, targets.is_control, targets._best = values, fx.pressure(1.0), False, 0.0
        return targets.no_progress()
    assert stalled([1e-4 * k / 500 for k in range(501)]) and stalled([0.0] * 501)
    assert stalled([-1e-7 * k for k in range(501)])
    assert not stalled([1e-4 * 1.01 ** (k - 500) for k in range(501)])
    assert not stalled([2e-3 * k / 500 for k in range(501)])
