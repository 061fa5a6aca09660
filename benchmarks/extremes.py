"""Inflate sheets far from the ordinary: one table of outcome, deviation and cost.

Every row inflates a sheet (radius 1, thickness 1/15.24 unless said otherwise) to a pole stretch. It must end right, or
with an error that says why not. "deviation" is that of the pressure (or of the limit pressure) from the reference that
the row names. About 5 minutes (--quick: the subset that the tests run).
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
import numpy as np  # noqa: E402
from common import COMM, say  # noqa: E402
from scipy.sparse import csr_matrix  # noqa: E402

import formingx as fx  # noqa: E402
from formingx.exact.inflation import membrane_inflation, membrane_limit_point  # noqa: E402
from formingx.problem.problem import Problem  # noqa: E402
from formingx.results import files  # noqa: E402
from formingx.solve.arc_length import Curve  # noqa: E402
from formingx.solve.newton import Failure  # noqa: E402

RATIO = 15.24


def inflate(until=3.0, ratio=RATIO, elements=(40, 2), material=None, model=None, support=None, layers=None, unit=1.0,
            stress=1.0, max_steps=200):
    """Return the path of a sheet whose radius is 1 over `unit` and whose c10 is 1 over `stress`."""
    thickness = 1 / (ratio * unit)
    material = material or fx.NeoHookean(c10=1.0 / stress)
    materials = layers or {"sheet": material}
    mesh = fx.mesh.disc(radius=1 / unit, thickness={n: thickness / len(materials) for n in materials},
                        elements=elements)
    scene = fx.Scene(mesh=mesh, materials=materials, model=model, loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), support or fx.SimplySupported("rim", weight="stiffness")])
    return fx.trace(scene, until=fx.pole_stretch(until), max_steps=max_steps, progress=False)


def last(path):
    """Return the pressure in the last state."""
    return path.last.measures["pressure"]


def limit(path):
    """Return the limit pressure."""
    return path.limit_points[0].measures["pressure"]


def membrane(until, **options):
    """Return the pressure of the membrane model for the same sheet."""
    return last(inflate(until, model=fx.Membrane(), elements=(80, 1), **options))


def ogden(alpha):
    return fx.Ogden(mu=2.0 if alpha > 0 else -2.0, alpha=alpha)


def rows(quick):
    """Yield (group, name, options of inflate, value read, function of the reference, its name) of each row."""
    standard = {}

    def ordinary():
        return standard.setdefault("limit", limit(inflate(3.0)))

    for eps in (2e-2, 1e-6) if quick else (2e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10):
        yield "eps", f"eps {eps:g}", {"model": fx.MixedPressure(eps=eps)}, limit, ordinary, "eps 0"
    if not quick:
        for points in (3, 4, 7):
            for eps in (2e-2, 1e-3, 1e-4, 1e-6):
                yield ("displacement only", f"{points} points, eps {eps:g}, 10x1",
                       {"model": fx.DisplacementPenalty(eps=eps, points=points), "elements": (10, 1), "until": 2.5,
                        "max_steps": 400}, limit, ordinary, "the default, 40x2")
    for ratio in (2, 2000) if quick else (2, 5, 10, 20, 50, 200, 500, 1000, 2000):
        square = {"elements": (40, 14)} if ratio == 2 else {}          # a scene refuses 40 x 2, which lock
        for support in (fx.SimplySupported("rim"), fx.Clamped("rim")):
            yield ("thickness", f"r0/h0 {ratio}, {type(support).__name__}",
                   {"ratio": ratio, "support": support, "until": 8.5, **square}, limit,
                   lambda r=ratio: membrane_limit_point(radius=1, thickness=1 / r, c10=1)[1].pressure,
                   "membrane theory")
    for stretch in (10,) if quick else (10, 20, 50, 100):
        yield ("stretch", f"pole stretch {stretch}", {"until": stretch, "elements": (80, 2)}, last,
               lambda s=stretch: membrane_inflation(s, radius=1, thickness=1 / RATIO, c10=1).pressure,
               "membrane theory")
    for c10, c01 in ((0.0, 1.0),) if quick else ((1, 0), (1, 0.05), (1, 0.2), (1, 1), (1, 10), (0, 1)):
        material = fx.MooneyRivlin(c10=c10, c01=c01)
        yield ("I1 to I2", f"c10 {c10:g}, c01 {c01:g}", {"material": material, "until": 5.0}, last,
               lambda m=material: membrane(5.0, material=m), "membrane model")
    for alpha in (-3, 10) if quick else (-5, -3, -2, -1, 0.5, 1, 1.3, 2, 3, 5, 10):
        until = {0.5: 2.0, 1: 2.0}.get(alpha, 2.5)
        yield ("Ogden exponent", f"alpha {alpha:g}", {"material": ogden(alpha), "until": until}, last,
               lambda a=alpha, u=until: membrane(u, material=ogden(a)), "membrane model")
    for share in (0.99,) if quick else (0.9, 0.99, 0.999):
        gent = fx.Gent(mu=2.0, Jm=20.0)
        until = 1 + share * (gent.largest_stretch("equibiaxial") - 1)
        yield ("Gent's limit", f"Jm 20, {share:g} of the way", {"material": gent, "until": until}, last,
               lambda m=gent, u=until: membrane(u, material=m), "membrane model")
    for k in (1e-4, 1e4) if quick else (1e-4, 1e-2, 1e2, 1e4):
        layers = {"lower": fx.NeoHookean(c10=1.0), "upper": fx.NeoHookean(c10=k)}
        rim = fx.Clamped("rim") if k > 1 else None         # a hinge lets the pressure squeeze out a soft inner layer
        yield ("layers", f"upper layer {k:g} times as stiff", {"layers": layers, "until": 4.0, "support": rim}, last,
               lambda m=layers: membrane(4.0, layers=m), "membrane model")
    for n in ((1, 1), (100, 1)) if quick else ((1, 1), (2, 1), (4, 1), (10, 1), (100, 1), (1000, 1)):
        yield "mesh", f"{n[0]} x {n[1]} elements", {"elements": n}, limit, ordinary, "40x2"
    for name, unit, stress in (("m and Pa", 100.0, 1 / 98066.5), ("mm and GPa", 0.1, 1e9 / 98066.5)):
        yield ("units", name, {"unit": unit, "stress": stress},
               lambda path, s=stress: limit(path) * s, ordinary, "cm and kg/cm2")


def why():
    """Return the condition of the tangent and the radius of Newton's method, for each form of the penalty.

    Both are in the reference configuration. The radius is the longest first step, as deflection over the radius of the
    sheet, from which Newton converges.

    Returns:
        {name: {eps: {"condition", "negative_eigenvalues", "first_step"}}}.
    """
    table: dict = {}
    say(f"{'10x1 elements, at rest':44}{'condition':>12}{'negative eigenvalues':>22}{'first step':>12}")
    for name, make in (("displacement only, 3 points", lambda e: fx.DisplacementPenalty(eps=e, points=3)),
                       ("displacement only, 4 points", lambda e: fx.DisplacementPenalty(eps=e, points=4)),
                       ("pressure as an unknown", lambda e: fx.MixedPressure(eps=e))):
        for eps in (2e-2, 1e-3, 1e-4, 1e-6):
            mesh = fx.mesh.disc(radius=1.0, thickness=1 / RATIO, elements=(10, 1))
            problem = Problem(fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), model=make(eps),
                                       loads=[fx.Pressure("bottom")],
                                       supports=[fx.Symmetry("axis"), fx.Clamped("rim")]))
            x = problem.x.duplicate()
            x.set(0)
            indptr, columns, values = problem.tangent(x, 0.0).getValuesCSR()
            dense = csr_matrix((values, columns, indptr)).toarray()
            scale = 1 / np.sqrt(np.where(np.diag(dense) != 0, np.abs(np.diag(dense)), 1.0))
            scaled = dense * scale[:, None] * scale
            negative = int(np.sum(np.linalg.eigvalsh((scaled + scaled.T) / 2) < -1e-10))
            curve = Curve(problem, fx.Tolerances())
            start, step = curve.start(), 1.0
            while step > 1e-9:
                try:
                    curve.step(start, step)
                    break
                except Failure:
                    step /= 2
            condition = float(np.linalg.cond(scaled))
            table.setdefault(name, {})[f"{eps:g}"] = {"condition": condition, "negative_eigenvalues": negative,
                                                      "first_step": step}
            say(f"{name + f', eps {eps:g}':44}{condition:12.1e}{negative:22d}{step:12.1e}")
    return table


def run(group, name, options, read, reference, what):
    """Return one row: outcome, deviation, cost."""
    began = time.perf_counter()
    try:
        path = inflate(**options)
        deviation = read(path) / reference() - 1
        outcome = "right"
    except fx.ConvergenceError as error:
        path, deviation = error.path, None
        outcome = f"error at stretch {path.last.measures['pole_stretch']:.3g}: " + str(error).split(". ")[0]
    return {"group": group, "name": name, "outcome": outcome, "deviation": deviation, "from": what,
            "iterations": path.counts.iterations, "steps": path.counts.steps, "failures": path.counts.failures,
            "mass_error": abs(path.last.measures.get("mass_error", 0.0)), "seconds": time.perf_counter() - began}


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true", help="the subset that the tests run")
    options.add_argument("--out", type=Path, default=Path("results/extremes"), help="folder for results")
    options.add_argument("--only", help="one group of rows")
    args = options.parse_args()
    found = []
    say(f"{'':18}{'':34}{'deviation':>11}  {'from':18}{'steps':>6}{'fails':>6}{'iter':>6}{'mass':>9}{'s':>6}  outcome")
    for row in rows(args.quick):
        if args.only and row[0] != args.only:
            continue
        r = run(*row)
        found.append(r)
        deviation = "-" if r["deviation"] is None else f"{r['deviation']:.1e}"
        say(f"{r['group']:18}{r['name']:34}{deviation:>11}  {r['from']:18}{r['steps']:6d}{r['failures']:6d}"
            f"{r['iterations']:6d}{r['mass_error']:9.0e}{r['seconds']:6.1f}  {r['outcome']}")
    right = sum(r["outcome"] == "right" for r in found)
    say(f"{right} of {len(found)} rows end right; the others end with the error shown")
    penalty = [r for r in found if r["group"] == "displacement only"]
    of_penalty = sum(r["outcome"] == "right" for r in penalty)
    files.write_summary(args.out / "summary.json", {
        "rows": found, "count": len(found), "right": right, "count_displacement_only": len(penalty),
        "right_displacement_only": of_penalty, "count_default": len(found) - len(penalty),
        "right_default": right - of_penalty, "tangent_at_rest": {} if args.quick else why()}, COMM)


if __name__ == "__main__":
    main()
