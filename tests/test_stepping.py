"""Step control, alone and in a run."""

from dataclasses import replace

import pytest

import formingx as fx
from formingx import InputError, StepControl, Tolerances
from formingx.solve.arc_length import Curve
from formingx.solve.newton import fixed


def test_step_follows_target_over_actual():
    step = StepControl(length=1.0, target=4, growth=2.0)
    for iterations, length in ((4, 1.0), (8, 0.5), (100, 0.25), (1, 0.5), (2, 1.0)):
        step.accepted(iterations)
        assert step.length == pytest.approx(length)


def test_step_halves_down_to_its_floor_and_keeps_its_ceiling():
    step = StepControl(length=1.0, smallest=0.3, largest=1.5)
    assert step.failed() and step.length == 0.5
    assert not step.failed()
    step = StepControl(length=1.0, largest=1.5)
    step.accepted(1)
    assert step.length == 1.5
    assert StepControl(largest=0.005).length == 0.005           # the first step, too
    for wrong, word in (({"smallest": 0.2, "largest": 0.1}, "smallest = 0.2"), ({"growth": 0.9}, "growth = 0.9")):
        with pytest.raises(InputError, match=word):
            StepControl(**wrong)


@pytest.mark.parametrize("largest", [0.013, 0.004])
def test_no_step_is_longer_than_the_largest(largest):
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(6, 1)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Pressure("bottom")])
    path = fx.trace(scene, until=fx.pole_height(0.1), step=StepControl(largest=largest), progress=False)
    curve = path.record.curve
    assert max(curve.progress(a, b) for a, b in zip(path.states, path.states[1:])) <= largest * (1 + 1e-9)


def test_a_step_back_in_time_is_refused(monkeypatch):
    """A step in time that Newton's method ends behind its beginning, on a path that looks as if it went on, is none."""
    step, calls = Curve.step, []

    def behind(self, old, length, *given):
        calls.append(length)
        if len(calls) != 4:
            return step(self, old, length, *given)
        found = self.solve(old.x, old.control - 0.1 * length, fixed(old.control - 0.1 * length), "step", old)
        return replace(found, direction=old.direction, slope=old.slope)
    monkeypatch.setattr(Curve, "step", behind)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(6, 1)),
                     materials=fx.Viscoelastic(fx.NeoHookean(c10=1.0), [(1.0, 1.0)]),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="air")])
    path = fx.Process(scene).run([fx.Stage("blow", control="air", until=fx.pressure(0.05)),
                                  fx.Stage("hold", duration=0.5)], progress=False)
    assert len(calls) > 4 and "the path turns back here" in path.counts.limits
    assert min(b.time - a.time for a, b in zip(path.states, path.states[1:])) >= 0


def test_convergence_needs_residual_and_correction():
    def met(corrections, residual, before=1.0):
        residuals = [*[1.0] * (len(corrections) - 1), before, residual]
        return Tolerances(correction=1e-10, residual=1e-8).converged(corrections, residuals[-len(corrections) - 1:])

    assert met([1e-2, 1e-4, 1e-7], 1e-9)              # quadratic: the next would be 1e-13
    assert not met([1e-2, 1e-4, 1e-7], 1e-7)          # residual too large
    assert not met([1e-2, 1e-4], 1e-9)                # the next would be 1e-8
    assert not met([], 0.0)
    assert met([1e-4, 3e-8, 2e-8], 1e-7, before=2e-7)   # round-off: no longer shrinking
    assert not met([1e-4, 3e-8, 2e-8], 1e-7, before=4e-7)      # the residual still does: a point lets go
    assert not met([1e-4, 3e-5, 2e-5], 1e-9)          # stalled far from it
    assert met([1e-2, 1e-6, 1e-12], 0.9)              # a residual at round-off, of a stiff penalty


@pytest.mark.parametrize("chord", [False, True])
def test_convergence_after_an_iteration_without_residual_or_correction(chord):
    """Such as an unloaded body whose first guess is in equilibrium, and whose volume is then corrected."""
    tolerances = fx.Tolerances()
    assert not tolerances.converged([0.0, 1e-3], [0.0, 0.0, 1e-3], chord)
    assert not tolerances.converged([0.0, 1e-3], [1e-3, 0.0, 1e-3], chord)
    assert tolerances.converged([0.0, 1e-14], [0.0, 0.0, 1e-14], chord)
