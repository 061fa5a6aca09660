"""Push plugs far from the ordinary: slender and wide, sharp and round, sheets thick and thin, any friction.

r0 = 10 cm, clamped; Mooney, I1 constant 0.4 MPa, I2 constant 0.04 MPa; r0/h0 = 20, plug radius 2.5 cm, edge fillet
h0/2 unless said; travel to three plug radii. Withdrawn plugs are pushed, wait, and move back to 0. Every row ends in a
converged state or in an error that keeps the last good one; anything else is printed as a DEFECT.
"""

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
import plugs  # noqa: E402

import formingx as fx  # noqa: E402
from formingx.forms.elements import body  # noqa: E402

RADIUS, TRAVEL = 10.0, 3.0                                   # cm; over the plug's radius
LAWS = ("frictionless", 0.1, 0.3, 1.0, 3.0, 10.0, "stick", "held")


@dataclass(frozen=True)
class Plug:
    """A plug and its sheet.

    radius is over r0, fillet over h0 ("round": the plug's radius); r0/h0. law: one of `plugs.LAWS`, or a coefficient of
    friction. back: it waits at its travel and is withdrawn. cone: its end is a cone of 45 degrees, with nose and edge
    rounded by the fillet. refine: divisor of the size of all elements.
    """

    radius: float = 0.25
    fillet: float | str = 0.5
    slenderness: float = 20.0
    law: float | str = "held"
    back: bool = False
    cone: bool = False
    refine: int = 1

    @property
    def lengths(self) -> tuple[float, float, float]:
        """Return plug radius, fillet and thickness, cm."""
        radius, thickness = self.radius * RADIUS, RADIUS / self.slenderness
        return radius, radius if self.fillet == "round" else self.fillet * thickness, thickness

    @property
    def tool(self) -> fx.Tool:
        """Return the plug, on the sheet."""
        radius, fillet, thickness = self.lengths
        if not self.cone:
            return plugs.plug(radius, thickness, fillet)
        apex = thickness - (np.sqrt(2) - 1) * fillet
        return fx.Tool([(0, apex), (radius, apex + radius), (radius, apex + 6 * radius)], [fillet, fillet, 0])


CASES = {
    "plug radius/r0": [Plug(radius=q, law=law) for law in ("held", 0.3) for q in (0.05, 0.1, 0.25, 0.5, 0.75, 0.95)],
    "fillet/h0": [Plug(fillet=f, law=law) for law in ("held", 0.3) for f in (0.0, 0.5, "round")],
    "r0/h0": [Plug(slenderness=q, law=law) for law in ("held", 0.3) for q in (5.0, 10.0, 20.0, 50.0, 100.0, 300.0,
                                                                              500.0)],
    "friction": [Plug(law=law) for law in LAWS],
    "withdrawn": [Plug(law=law, back=True) for law in LAWS],
}


def mesh_for(plug):
    """Return the mesh for a plug.

    At the edge the fillet has three elements, or h0 two, none below h0/10; far away they are r0/30. At the rim, where a
    clamped sheet is creased, elements are a third of that: this alone changes the first forces by 1 %. Where the sheet
    may slide over the edge there are four to the fillet from 0.6 plug radii on. They reach the edge stretched, and
    nodes slide off it one by one: with 1.3 the force goes up and down by 6 %. A sheet thicker than half a plug radius
    has four elements through it, others two.
    """
    radius, fillet, thickness = plug.lengths
    slides, largest = plug.law not in ("held", "stick"), RADIUS / 30
    if slides:
        first, small = 0.0 if plug.cone else 0.6 * radius, min((fillet or thickness / 2) / 4, thickness / 2, largest)
        places = np.linspace(first, radius, 1 + int(np.ceil((radius - first) / (4 * small))))
    else:
        places = (0.0, radius) if plug.cone else (radius,)
        small = np.clip((fillet or thickness) / 3, 0.1 * thickness, min(thickness / 2, largest))
    at = {RADIUS: max(small / largest, 0.3)} | dict.fromkeys(places, small / largest)
    R, sizes = np.linspace(0, RADIUS, 4001), np.array(list(at.values()))
    away = np.abs(np.subtract.outer(R, list(at)))
    size = (sizes + (1 - sizes) * away / away.min(1).max()).min(1)
    along, through = int(np.ceil(np.trapezoid(1 / size, R) / largest)), 4 if thickness > radius / 2 else 2
    return fx.mesh.disc(radius=RADIUS, thickness=thickness, elements=(plug.refine * along, plug.refine * through),
                        concentrate=at)


def run(plug, max_steps=None, intermediate=(), **options):
    """Return (path or None, "arrived" or why not, elements). intermediate: travels on the way, over the radius."""
    radius = plug.lengths[0]
    friction, separates = plugs.LAWS.get(plug.law, (plug.law, True))
    mesh = mesh_for(plug)
    elements = mesh.domain.topology.index_map(2).size_global
    scene = fx.Scene(mesh=mesh, materials=fx.MooneyRivlin(c10=0.4, c01=0.04),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", plug.tool, friction, separates=separates, direction=(0, -1),
                                          name="plug", **options)])
    travel = TRAVEL * radius
    # a plug goes one way
    stages = [fx.Stage("push", control="plug", until=fx.travel(travel), at_limit_point="snap_through",
                       intermediate=[fx.travel(t * radius) for t in intermediate])]
    if plug.back:
        stages += [fx.Stage("hold", amplitudes={"plug": [(0, travel), (1, travel)]}),
                   fx.Stage("withdraw", control="plug", until=fx.travel(0.0))]
    try:
        return fx.Process(scene).run(stages, step=fx.StepControl(target=6), max_steps=max_steps,
                                     progress=False), "arrived", elements
    except fx.ConvergenceError as error:
        return error.path, ended(error), elements
    except fx.InputError as error:
        return None, f"refused: {error}", elements


def ended(error) -> str:
    """Return reason, cause and advice of an error, in one line."""
    found = error.diagnosis
    if found is None:
        return str(error)
    causes, advice = "; ".join(found.causes), "; ".join(found.advice)
    return f"{found.reason}. " + f"Cause: {causes}. " * bool(causes) + f"Try {advice}." * bool(advice)


def smallest_J(path, state) -> float:
    """Return the smallest det F in a state."""
    with path.problem.state_context(state) as problem:
        return float(body(problem, problem.x, state.control).J.min())


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--groups", nargs="+", choices=CASES, default=list(CASES), help="rows to run")
    options.add_argument("--laws", nargs="+", help="only these: held, stick, frictionless or coefficients")
    options.add_argument("--max-steps", type=int, help="states of a stage before it gives up")
    args = options.parse_args()
    print(f"{'case':36}{'elements':>9}{'travel/rp':>10}{'pole, cm':>10}{'force, N':>10}{'depth/h0':>10}{'least J':>9}"
          f"{'states':>8}{'Newton':>8}{'cuts':>6}{'s':>7}  end", flush=True)
    for group in args.groups:
        for plug in CASES[group]:
            if args.laws and plugs.name_of(plug.law).removeprefix("coulomb_") not in args.laws:
                continue
            value = {"plug radius/r0": plug.radius, "fillet/h0": plug.fillet, "r0/h0": plug.slenderness}.get(group)
            label = f"{group}{'' if value is None else f' {value}'}, {plugs.name_of(plug.law)}"
            began = time.perf_counter()
            try:
                path, end, elements = run(plug, args.max_steps)
                seconds = time.perf_counter() - began
                print(f"{label:36}{row(path, plug, elements)}{seconds:7.1f}  {end}", flush=True)
            except Exception as error:                       # what a row must not end in
                print(f"{label:36}  DEFECT: {type(error).__name__}: {error}", flush=True)


def row(path, plug, elements) -> str:
    """Return the numbers of one row."""
    if path is None or not path.states:
        return f"{elements:9d}" + 70 * " "
    radius, _, thickness = plug.lengths
    m, c = path.last.measures, path.counts
    assert np.isfinite(list(m.values())).all()
    return (f"{elements:9d}{path['travel'].max() / radius:10.3f}{m['pole_height']:10.2g}{plugs.force(path.last):10.4g}"
            f"{path['penetration'].max() / thickness:10.1e}{smallest_J(path, path.last):9.4f}{c.steps:8d}"
            f"{c.iterations:8d}{c.failures:6d}")


if __name__ == "__main__":
    main()
