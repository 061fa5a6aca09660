"""Figures of tests and of the material that was fitted to them."""

from typing import Any

import numpy as np

from ...errors import InputError
from ...figures import figure
from .oscillation import OscillationTest
from .rows import rows_of

_XLABELS = {"time": "time ({})", "stretch": "stretch", "frequency": "angular frequency (1/{})"}
"""{quantity over which tests are drawn: label of the axis, with a place for the unit of time}, in the order of panels.
"""


def draw_fit(material: Any, data: Any, axes: Any, unit: str, unit_of_time: str) -> Any:
    """Draw measured and fitted stresses over the stretch, of relaxation tests over the time, moduli over the frequency.

    It returns the axes, one for each of these kinds of tests; another number of given axes is an InputError. Data are
    {test: columns} or a list of `TimedTest` and `OscillationTest`.
    """
    kinds = ["stretch"] if isinstance(data, dict) else [_kind(test) for test in data]
    present = [kind for kind in _XLABELS if kind in kinds]
    if axes is None:
        axes = figure(len(present))[1]
    panels = np.ravel(axes)
    if len(panels) != len(present):
        raise InputError(f"Fit.plot: axes: {len(panels)} given: these tests need {len(present)}, one for each of:"
                         f" relaxation tests (held stretch), other tests, oscillations")
    panel_of = dict(zip(present, panels))
    if isinstance(data, dict):
        _draw_elastic(material, data, panels[0])
    else:
        for i, (test, kind) in enumerate(zip(data, kinds), 1):
            draw = _draw_oscillation if kind == "frequency" else _draw_timed
            draw(material, test, i, panel_of[kind])
    for kind, panel in panel_of.items():
        label = "storage and loss modulus" if kind == "frequency" else "nominal stress"
        panel.set(xlabel=_XLABELS[kind].format(unit_of_time), ylabel=label + f" ({unit})" * bool(unit))
        panel.legend()
    return axes


def _kind(test: Any) -> str:
    """Return the quantity over which a test is drawn: "time", "stretch" or "frequency"."""
    if isinstance(test, OscillationTest):
        return "frequency"
    return "time" if np.ptp(test.stretches) == 0 else "stretch"


def _draw_elastic(material: Any, data: dict, panel: Any) -> None:
    """Draw {test: (stretches, stresses)}, (n,) each, "biaxial" two of each, with curves of the material on axes."""
    for mode, (l, *others, P) in data.items():
        if others:                                          # two stretches, two stresses
            _draw_biaxial(material, (l, *others, P), panel)
            continue
        points, = panel.plot(l, P, "o", ms=4, label=mode.replace("_", " "))
        fine = np.linspace(min(1, np.min(l)), np.max(l), 200)
        panel.plot(fine, material.stress(mode, fine), color=points.get_color())


def _draw_biaxial(material: Any, columns: Any, panel: Any) -> None:
    """Draw both stresses of biaxial columns over the first stretch, and those of the material as crosses."""
    l1, l2, *stresses = (np.asarray(x, float) for x in columns)
    computed = material.stress("biaxial", np.stack([l1, l2]))
    for k, (P, found) in enumerate(zip(stresses, computed), 1):
        points, = panel.plot(l1, P, "o", ms=4, label=f"biaxial, stress {k}")
        panel.plot(l1, np.where(np.isfinite(P), found, np.nan), "x", ms=5, color=points.get_color())


def _draw_timed(material: Any, test: Any, number: int, panel: Any) -> None:
    """Draw stresses of a test in time over the stretch, or the logarithmic time if this is constant, with a curve."""
    is_relaxation = _kind(test) == "time"
    t, l = np.asarray(test.times, float), np.asarray(test.stretches, float)
    x, label = (t - t[0], f"stretch {l[0]:g}") if is_relaxation else (l, _rate(t, l))
    points, = panel.plot(x, test.stress, "o", ms=4, label=f"{number} {test.mode.replace('_', ' ')}, {label}")
    panel.plot(x, material.stress(test.mode, l, times=t, between=test.between), color=points.get_color())
    if is_relaxation:
        panel.set_xscale("log")


def _draw_oscillation(material: Any, test: OscillationTest, number: int, panel: Any) -> None:
    """Draw storage and loss moduli of a test over the angular frequency, with curves of the material."""
    fine = np.geomspace(test.frequencies[0], test.frequencies[-1], 100)
    moduli = rows_of(OscillationTest(fine, fine, fine, test.mode)).values(material)
    symbols = ("G'", "G''") if test.mode == "shear" else ("E'", "E''")
    for values, marker, name, curve in zip((test.storage, test.loss), "os", symbols, np.split(moduli, 2)):
        points, = panel.loglog(test.frequencies, values, marker, ms=4, label=f"{number} {name}")
        panel.plot(fine, curve, color=points.get_color())


def _rate(times: np.ndarray, stretches: np.ndarray) -> str:
    """Return the mean Hencky rate of a test as text, for a legend; from its times and stretches, shape (n,) each."""
    return f"rate {abs(np.log(stretches[-1] / stretches[0])) / (times[-1] - times[0]):.3g}"
