"""Data and fitted material in one picture."""

from typing import Any

import numpy as np

from ...errors import InputError
from ...figures import figure


def plotted(material: Any, data: Any, axes: Any, unit: str, unit_of_time: str) -> Any:
    """Draw data and fitted material; see `Fit.plot`.

    Args:
        material: the material.
        data: the tests.
        axes: matplotlib axes, or None.
        unit: unit of stress, for the label.
        unit_of_time: unit of time, for the label.

    Returns:
        The matplotlib axes.

    Raises:
        InputError: relaxation tests and other tests on one axes.
    """
    held = [] if isinstance(data, dict) else [np.ptp(test.stretches) == 0 for test in data]
    count = 1 + (any(held) and not all(held))
    if axes is None:
        axes = figure(count)[1]
    panels = np.ravel(axes)
    if len(panels) != count:
        raise InputError(f"Fit.plot: axes: {len(panels)} given: these tests need {count}, one for relaxation tests"
                         f" (held stretch), one for the others")
    if isinstance(data, dict):
        _stretched(material, data, panels[0])
    else:
        _timed(material, data, held, panels)
    label = "nominal stress" + f" ({unit})" * bool(unit)
    for i, panel in enumerate(panels):
        in_time = any(held) and i == 0
        panel.set(xlabel=f"time ({unit_of_time})" if in_time else "stretch", ylabel=label)
        panel.legend()
    return axes


def _stretched(material: Any, data: dict, panel: Any) -> None:
    """Draw tests without time, and the curves of the material."""
    for mode, (l, *others, P) in data.items():
        if others:                                          # two stretches, two stresses
            _biaxial(material, (l, *others, P), panel)
            continue
        points, = panel.plot(l, P, "o", ms=4, label=mode.replace("_", " "))
        fine = np.linspace(min(1, np.min(l)), np.max(l), 200)
        panel.plot(fine, material.stress(mode, fine), color=points.get_color())


def _biaxial(material: Any, columns: Any, panel: Any) -> None:
    """Draw both stresses over the first stretch, and the stresses of the material as crosses."""
    l1, l2, *stresses = (np.asarray(x, float) for x in columns)
    computed = material.stress("biaxial", np.stack([l1, l2]))
    for k, (P, found) in enumerate(zip(stresses, computed), 1):
        points, = panel.plot(l1, P, "o", ms=4, label=f"biaxial, stress {k}")
        panel.plot(l1, np.where(np.isfinite(P), found, np.nan), "x", ms=5, color=points.get_color())


def _timed(material: Any, tests: Any, held: list[bool], panels: Any) -> None:
    """Draw tests at constant stretch on the first panel, against a logarithmic time; the others on the last."""
    for i, (test, still) in enumerate(zip(tests, held), 1):
        panel = panels[0] if still else panels[-1]
        t, l = np.asarray(test.times, float), np.asarray(test.stretches, float)
        x, label = (t - t[0], f"stretch {l[0]:g}") if still else (l, _rate(t, l))
        points, = panel.plot(x, test.stress, "o", ms=4, label=f"{i} {test.mode.replace('_', ' ')}, {label}")
        panel.plot(x, material.stress(test.mode, l, times=t, between=test.between), color=points.get_color())
        if still:
            panel.set_xscale("log")


def _rate(times: np.ndarray, stretches: np.ndarray) -> str:
    """Return the mean Hencky rate, for a legend."""
    return f"rate {abs(np.log(stretches[-1] / stretches[0])) / (times[-1] - times[0]):.3g}"
