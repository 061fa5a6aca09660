"""Energy that materials dissipate in a step."""

from ...measures.quantities import Quantity
from ...solve import predictor
from ...solve.record import Segment
from ...solve.state import State


def dissipated_energy(segment: Segment, states: list[State], power: Quantity) -> float:
    r"""Return the energy that materials dissipate between the last two of given states; collective.

    The dissipated power D is integrated over the process time t along the parabola through three values:

    .. math:: \int_{t_0}^{t_1} D \, dt

    The third value lies between both states. There the unknowns are interpolated, and the history variables are
    advanced from the first state. The path has successive states of one segment, at least two, with the column
    "dissipated_power", which `power` evaluates.
    """
    before, state = states[-2:]
    # with new step data only round-off is between the times: the body does not move
    if before.setting != state.setting or not before.time < state.time:
        return 0.0
    time = (before.time + state.time) / 2
    if state.setting["rate"][-1]:
        x, control = segment.curve.interpolate(before, state, 0.5)
    else:                                                    # time passes, independent of the control: no tangents
        past = [*predictor.recent_states(states[:-1], time, degree=2), state]
        weights = predictor.weights(past, time)
        x, control = weights @ [s.x for s in past], float(weights @ [s.control for s in past])
    with segment.problem.state_context(before) as problem:
        if not state.setting["rate"][-1]:
            problem.history.clock = time
        time = problem.forms.time_at(control)
        problem.x.array_w[:] = x
        problem.set_fields(x, control)
        for history in problem.history.materials:
            history.advance(x, control)
        half = power.value(problem.x, control)
    a, b = (s.measures["dissipated_power"] for s in (before, state))
    share = (time - before.time) / (state.time - before.time)
    if not 0 < share < 1:                                    # a step of round-off
        return (state.time - before.time) * (a + b) / 2
    # the parabola through the three powers, at times that need not be even
    return (state.time - before.time) * (
        a * (3 - 1 / share) + half / (share * (1 - share)) + b * (3 - 1 / (1 - share))) / 6
