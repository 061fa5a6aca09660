"""Checks of a body that cools."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import InputError
from ...findings import Finding, register
from ...materials.constants import OfTemperature
from ...materials.solidification import Solidification
from ...values.temperature import FunctionOfTemperature
from .cooling import CoolingHistory

_FROZEN = ", where the material does not relax any more: give Sets or a modulus that rises, if it turns into glass"
_RISES = 2.0               # modulus of the coldest over the modulus of the hottest body


@register("scene")
def springs_back(body: Any) -> Iterator[Finding]:
    """A modulus that rises as a stretched body cools pulls it back: it says nothing of what has set.

    (A film that was drawn into a mould, its table of stiffness on the equilibrium energy, came off it again and went
    back to a third of its height.)
    """
    scene = body.scene
    if scene.heat is None:
        return
    low, high = scene.heat.extremes(scene)
    for layer, material in scene.materials.items() if np.isfinite([low, high]).all() else ():
        if isinstance(material, Solidification):                      # what it adds as it cools is free of stress
            continue
        relaxed = getattr(material, "equilibrium", material)
        for name, value in {} if relaxed is None else relaxed.constants().items():
            if not isinstance(value, OfTemperature):
                continue
            try:
                cold, hot = value.clamped(np.array([low, high]))
            except InputError:                              # it says so itself, if it comes to that
                continue
            if cold > _RISES * hot > 0:
                yield Finding("warning", f"layer {layer!r}",
                              f"{name}, of the relaxed material, is {cold / hot:.3g} times as large at {low:.4g}"
                              f" degrees as at {high:.4g}: as the stretched part cools, it pulls back with that much"
                              f" more force, instead of setting in its shape. For a material that sets see fx.Sets and"
                              f" docs/heat.md")


@register("start")
def beyond_limits(body: Any) -> Iterator[Finding]:
    """Temperatures to which tools, air and heaters may bring the body, at which a constant is not known."""
    if body.scene.heat is not None:
        low, high = body.scene.heat.extremes(body.scene)
        yield from _beyond(body.scene, low, high, "the tools and the air may bring it")


@register("end")
def were_beyond_limits(path: Any) -> Iterator[Finding]:
    """Temperatures that the body had at which a constant is not known, unless its run began with saying so."""
    said = {finding.about for finding in path.record.findings}
    states = path.segments[-1].states
    for k, history in enumerate(path.problem.histories):
        if isinstance(history, CoolingHistory):
            mine = [f(state.memory[k].temperature) for state in states if len(state.memory[k].temperature)
                    for f in (np.min, np.max)]
            ends = [value for part in path.problem.comm.allgather(mine) for value in part]
            found = _beyond(path.problem.scene, min(ends), max(ends), "the run brought it")
            yield from (finding for finding in found if finding.about not in said)


def _beyond(scene: Any, low: float, high: float, who: str) -> Iterator[Finding]:
    """Constants of materials, friction and expansion that are not known all the way from low to high."""
    laws = [(f"materials[{layer!r}]", name, value) for layer, material in scene.materials.items()
            for name, value in material.constants().items()]
    laws += [(repr(contact), "friction", contact.mu) for contact in scene.contacts]
    laws += [(f"expansion of {layer!r}", "volume", law.specific_volume) for layer, law in scene.expansion.items()]
    told = set()
    for about, name, law in laws:
        if not isinstance(law, FunctionOfTemperature):
            continue
        span = 1e-9 * (high - low) if np.isfinite(high - low) else 0.0
        for beyond, limit, words in ((low, law.limits[0], "below"), (high, law.limits[1], "above")):
            outside = beyond < limit - span if words == "below" else beyond > limit + span
            if np.isfinite(beyond) and outside and (about, words, limit) not in told:
                told.add((about, words, limit))
                yield Finding("warning", about,
                              f"{name} = {law!r} is known {'down' if words == 'below' else 'up'} to {limit:.4g}"
                              f" degrees, and {who} to {beyond:.4g}: {words} {limit:.4g} it is taken as it is there"
                              f"{_FROZEN if words == 'below' and 'WLF' in repr(law) else ''}. Give values to there")


@register("end")
def temperature_errors(path: Any) -> Iterator[Finding]:
    """Errors of the temperature in space, of states of the last mesh; collective."""
    for history in path.problem.histories:
        if isinstance(history, CoolingHistory):
            yield from history.findings(path.segments[-1].states)
