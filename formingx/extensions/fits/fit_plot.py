"""Figures of tests and of the material that was fitted to them."""

from typing import Any

import numpy as np

from ...errors import InputError
from ...figures import figure


def draw_fit(material: Any, data: Any, axes: Any, unit: str, unit_of_time: str) -> Any:
    """Draw measured and fitted nominal stresses over the stretch, for relaxation tests over the time.

    It returns the axes, a pair for both kinds of tests; single ones for both are an InputError. Data are {test:
    columns} or a list of `TimedTest`.
    """
    constant = [] if isinstance(data, dict) else [np.ptp(test.stretches) == 0 for test in data]
    count = 1 + (any(constant) and not all(constant))
    if axes is None:
        axes = figure(count)[1]
    panels = np.ravel(axes)
    if len(panels) != count:
        raise InputError(f"Fit.plot: axes: {len(panels)} given: these tests need {count}, one for relaxation tests"
                         f" (held stretch), one for the others")
    if isinstance(data, dict):
        _draw_elastic(material, data, panels[0])
    else:
        _draw_timed(material, data, constant, panels)
    label = "nominal stress" + f" ({unit})" * bool(unit)
    for i, panel in enumerate(panels):
        in_time = any(constant) and i == 0
        panel.set(xlabel=f"time ({unit_of_time})" if in_time else "stretch", ylabel=label)
        panel.legend()
    return axes


def _draw_elastic(material: Any, data: dict, panel: Any) -> None:
    """Draw {test: (stretches, stresses)}, (n,) each, with curves of the material on axes.

    "biaxial" has two stretches and two stresses.
    """
    for mode, (l, *others, P) in data.items():
        if others:                                          # two stretches, two stresses
            _draw_biaxial(material, (l, *others, P), panel)
            continue
        points, = panel.plot(l, P, "o", ms=4, label=mode.replace("_", " "))
        fine = np.linspace(min(1, np.min(l)), np.max(l), 200)
        panel.plot(fine, material.stress(mode, fine), color=points.get_color())


def _draw_biaxial(material: Any, columns: Any, panel: Any) -> None:
    """Draw stresses of a biaxial test over its first stretch, and the stresses of the material as crosses.

    Columns are two stretches and two nominal stresses, (n,) each.
    """
    l1, l2, *stresses = (np.asarray(x, float) for x in columns)
    computed = material.stress("biaxial", np.stack([l1, l2]))
    for k, (P, found) in enumerate(zip(stresses, computed), 1):
        points, = panel.plot(l1, P, "o", ms=4, label=f"biaxial, stress {k}")
        panel.plot(l1, np.where(np.isfinite(P), found, np.nan), "x", ms=5, color=points.get_color())


def _draw_timed(material: Any, tests: Any, constant: list[bool], panels: Any) -> None:
    """Draw stresses of tests in time, with curves of the material.

    Tests at `constant` stretch go over the logarithmic time on the first of the panels, the others over stretch on the
    last.
    """
    for i, (test, is_relaxation) in enumerate(zip(tests, constant), 1):
        panel = panels[0] if is_relaxation else panels[-1]
        t, l = np.asarray(test.times, float), np.asarray(test.stretches, float)
        x, label = (t - t[0], f"stretch {l[0]:g}") if is_relaxation else (l, _rate(t, l))
        points, = panel.plot(x, test.stress, "o", ms=4, label=f"{i} {test.mode.replace('_', ' ')}, {label}")
        panel.plot(x, material.stress(test.mode, l, times=t, between=test.between), color=points.get_color())
        if is_relaxation:
            panel.set_xscale("log")


def _rate(times: np.ndarray, stretches: np.ndarray) -> str:
    """Return the mean Hencky rate of a test as text, for a legend; from its times and stretches, shape (n,) each."""
    return f"rate {abs(np.log(stretches[-1] / stretches[0])) / (times[-1] - times[0]):.3g}"
