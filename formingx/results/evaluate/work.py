"""Work that is put into the body, by what puts it in."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...discrete.tooling import Tooling
from .contact_face import tool_forces


def work(path: Any) -> dict[str, np.ndarray]:
    """{what: work done on the body up to each state, shape (states,)}, stress length^3 (per depth: length^2).

    Of the pressure, over the enclosed volume, if there is one pressure; of each tool that moves, over its travel; and
    the energy that the body holds. By the trapezium rule from state to state: its error falls with the square of
    the steps.
    """
    found = {}
    pressures = [c for c in path.columns if c.endswith("pressure")]
    if len(pressures) == 1 and "enclosed_volume" in path.columns:
        found[pressures[0]] = _integral(path[pressures[0]], path["enclosed_volume"])
    tooling = Tooling.of_problem(path.problem)
    travels = [tooling.travels(s.setting, s.control) for s in path.states]
    forces = tool_forces(path)
    for k, (contact, name) in enumerate(zip(tooling.contacts, tooling.names, strict=True)):
        if contact.moves is not None and name not in found:
            travelled = [0.0]
            for row in travels:                              # a tool that takes no part goes nowhere
                travelled.append(travelled[-1] if (travel := row[k]) is None else travel)
            found[name] = _integral(forces[name], np.array(travelled[1:]) * np.hypot(*contact.moves))
    return found | {"strain_energy": path["strain_energy"] - path["strain_energy"][0]}


def _integral(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum((y[1:] + y[:-1]) / 2 * np.diff(x))])
