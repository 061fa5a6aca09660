"""What the demos of heat share: a flat sheet that conducts through its thickness only, and its table of errors."""

import numpy as np
from common import save, say

import formingx as fx
from formingx.figures import figure
from formingx.heat.reference import Slab

SHEET = fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0)      # W/(m K), kg/m3, J/(kg K)


def slab(thickness, elements):
    """A narrow disc, its rim insulated: one column of elements, finer towards both faces; m."""
    mesh = fx.mesh.disc(radius=0.03 * thickness, thickness=thickness, elements=(1, elements))
    z = mesh.domain.geometry.x[:, 1]
    levels = thickness * (1 - np.cos(np.pi * np.arange(elements + 1) / elements)) / 2
    z[:] = np.interp(np.rint(2 * elements * z / thickness) / 2, np.arange(elements + 1), levels)
    return mesh


def same_slab(thickness):
    """The same sheet for the reference solutions."""
    return Slab(thickness, SHEET.conductivity, SHEET.density * SHEET.heat_capacity)


def at_times(names, times, values):
    """{"NAME_C_at_s": {time: value}} of values, shape (times, names)."""
    return {f"{name}_C_at_s": {f"{t:g}": float(v) for t, v in zip(times, column)}
            for name, column in zip(names, np.transpose(values))}


def cost(run):
    """Steps, estimated errors, heat balance, in words."""
    return (f"{len(run.times) - 1} steps, estimated error of one at most {run.errors.max():.1e} C, heat balance of each"
            f" within {np.abs(run.balance).max():.0e}")


def print_errors(name, names, times, values, exact, span, run):
    """The table of a run and how far it is off; returns the largest error over the span of temperatures."""
    off = (values - exact) / span
    say(f"{name}: {cost(run)}", f"  {'s':>6}" + "".join(f"{n:>12}" for n in names) + "    largest error / span")
    for t, row, e in zip(times, values, off):
        say(f"  {t:6g}" + "".join(f"{v:12.4f}" for v in row) + f"    {np.abs(e).max():.1e}")
    return float(np.abs(off).max())


def draw(runs, file, columns, between=None):
    """Temperature through the thickness of every run, {title: run}, one plot each; `between` adds to its axes."""
    drawing, axes = figure(columns, width=4.4, height=3.6, rows=-(-len(runs) // columns))
    for a, (title, run) in zip(np.atleast_1d(axes), runs.items()):
        run.plot_through(axes=a)
        a.set_title(title)
        if between:
            between(a, run)
        a.legend(frameon=False, fontsize=7)
    for a in np.atleast_1d(axes)[len(runs):]:
        a.remove()
    save(drawing, file)
