"""A flat sheet that conducts heat through its thickness, and its table of errors, for the demos of heat."""

import numpy as np
from common import save, say

import formingx as fx
from formingx.exact.heat import Slab
from formingx.figures import figure

TITLES = {"convection": "air, 200 °C", "two_sides": "air, 220 and 80 °C", "radiation_400_400": "heaters, 400 °C",
          "radiation_450_350": "heaters, 350 and 450 °C", "absorbed": "absorbed in the depth"}
SHEET = fx.ThermalProperties(conductivity=0.17, density=1050.0, heat_capacity=1800.0)      # W/(m K), kg/m3, J/(kg K)


def slab(thickness, elements):
    """Return the mesh of a narrow disc with an insulated rim: one column of elements, finer towards both faces; m."""
    mesh = fx.mesh.disc(radius=0.03 * thickness, thickness=thickness, elements=(1, elements))
    z = mesh.domain.geometry.x[:, 1]
    levels = thickness * (1 - np.cos(np.pi * np.arange(elements + 1) / elements)) / 2
    z[:] = np.interp(np.rint(2 * elements * z / thickness) / 2, np.arange(elements + 1), levels)
    return mesh


def same_slab(thickness):
    """Return the same sheet for the exact solutions."""
    return Slab(thickness, SHEET.conductivity, SHEET.density * SHEET.heat_capacity)


def at_times(names, times, values):
    """Return {"NAME_C_at_s": {time: value}} of values, shape (times, names)."""
    return {f"{name}_C_at_s": {f"{t:g}": float(v) for t, v in zip(times, column)}
            for name, column in zip(names, np.transpose(values))}


def cost(run):
    """Return a line about steps, estimated errors and heat balance."""
    return (f"{len(run.times) - 1} steps, estimated error of one at most {run.errors.max():.1e} C, heat balance of each"
            f" within {np.abs(run.balance).max():.0e}")


def print_errors(name, names, times, values, exact, span, run):
    """Print the table of a run and its errors; return the largest error over the span of temperatures."""
    off = (values - exact) / span
    say(f"{name}: {cost(run)}", f"  {'s':>6}" + "".join(f"{n:>12}" for n in names) + "    largest error / span")
    for t, row, e in zip(times, values, off):
        say(f"  {t:6g}" + "".join(f"{v:12.4f}" for v in row) + f"    {np.abs(e).max():.1e}")
    return float(np.abs(off).max())


def draw(runs, file, columns, between):
    """Draw the temperature through the thickness of every run, {title: run}, and the extremes over time.

    between(axes, title, run) adds to a plot.
    """
    drawing, axes = figure(columns, width=4.4, height=4.0, rows=-(-(len(runs) + 1) // columns))
    for a, (title, run) in zip(axes, runs.items()):
        run.plot_line_profile(scale=1e3, axes=a)
        a.set(title=_in_words(title), xlabel="above the bottom face, mm")
        for line in a.lines:
            line.set_label(line.get_label().removeprefix("t = "))
        between(a, title, run)
        a.legend(frameon=False, fontsize=9, ncols=6, loc="upper center", bbox_to_anchor=(0.5, -0.14), title="time, s",
                 title_fontsize=9, handlelength=1.0, columnspacing=1.0)
    for k, (title, run) in enumerate(runs.items()):
        extremes = [[run.coldest(t).temperature for t in run.times], [run.hottest(t).temperature for t in run.times]]
        axes[-1].plot(run.times, extremes[0], color=f"C{k}", label=_in_words(title))
        axes[-1].plot(run.times, extremes[1], color=f"C{k}", linestyle="--")
    axes[-1].set(title="coldest and hottest (dashed) point", xlabel="time, s", ylabel="temperature, °C")
    axes[-1].legend(frameon=False, fontsize=9, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.14))
    save(drawing, file)


def _in_words(title):
    """Return the name of a run as the title of a plot."""
    return TITLES.get(title, title)
