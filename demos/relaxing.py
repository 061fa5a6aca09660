"""Materials that relax, in MPa and s, and states by their time, for several demos."""

import formingx as fx

RUBBER = fx.NeoHookean(c10=0.05)
P0 = fx.Viscoelastic(RUBBER, branches=[(0.5, 1.0)])
P1 = fx.Viscoelastic(RUBBER, branches=[(0.3, 0.5), (0.4, 5.0)])


def times(begin, after) -> list:
    """Return targets at some times after a first one."""
    return [fx.process_time(begin + t) for t in after]


def at_time(path, stage, time):
    """Return the last state of a stage at a time that was a target, or at its end."""
    found = [s for s in path.states if s.stage == stage and abs(s.time - time) <= 1e-11 * max(time, 1.0)]
    if not found:
        raise LookupError(f"stage {stage!r} has no state at {time:g} s")
    return found[-1]


def cost(path) -> dict:
    """Return the counts of a run."""
    counts = path.counts
    return {"steps": counts.steps, "newton_iterations": counts.iterations, "cutbacks": counts.failures,
            "solve_seconds": counts.seconds}
