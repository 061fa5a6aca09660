"""What `accuracy` keeps of its promise from thick discs to thin ones, and why triangles must not be slim across them.

A hinged sheet of radius 1 is inflated to pole stretches of 1.02, 1.2, 2 and 3; every mesh is compared at the same pole
heights with a reference: near-square elements, continuous pressures (P1); its own error is taken from the default
pressures (P1dg) on the same mesh. Errors are those of pressure and pole thickness, and of the meridional stress of the
top face one thickness inside the rim, but between r0/20 and r0/2 (nearer than that to the rim thin sheets bend over a
few thicknesses).

Prints the table of r0/h0, then that of slim triangles with the inf-sup constants of a strip; writes
results/thickness/. About 25 minutes (--quick: three ratios without "fine", 2 minutes).
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
import basix.ufl  # noqa: E402
import numpy as np  # noqa: E402
import scipy.linalg  # noqa: E402
import ufl  # noqa: E402
from common import COMM, say  # noqa: E402
from dolfinx import fem  # noqa: E402
from dolfinx.fem import petsc  # noqa: E402

import formingx as fx  # noqa: E402
from formingx.results import files  # noqa: E402

STRETCHES = (1.02, 1.2, 2.0, 3.0)
# r0/h0: elements of the reference, and the size of its last element at the rim over that of the first
RATIOS = {1: ((60, 60), 1.0), 1.25: ((60, 48), 1.0), 2: ((80, 40), 1.0), 3: ((90, 30), 1.0), 5: ((120, 24), 1.0),
          10: ((140, 14), 1.0), 15.24: ((160, 10), 1.0), 50: ((200, 4), 0.3), 200: ((400, 2), 0.2),
          2000: ((800, 2), 0.1)}
CREASED = {1: (1.02, 1.1)}       # a hinge's rim face creases at 1.2 in so thick a disc: no mesh converges beyond
MATERIALS = {"neo-Hookean": 0.0, "Mooney": 0.2}        # c01 of c10 + c01 = 1
QUANTITIES = ("pressure", "pole_thickness", "rim_stress")
SLIM = ((20, 7), (40, 14), (40, 7), (40, 5), (40, 4), (40, 2), (80, 4), (80, 2))      # at r0/h0 = 2


TALL = (0.1, 0.5, 1, 2, 4, 8, 16, 32)                  # height over width of triangles in a strip


class Unrefused(fx.MixedPressure):
    """Also on meshes that a scene refuses, as it locks in them: to show how much."""

    def check(self, scene):
        pass


def inflate(ratio, c01=0.0, space="P1dg", heights=None, **mesh):
    """({quantity: values at the stretches, or at pole heights}, seconds); `mesh`: elements or accuracy, grading."""
    h = 1 / ratio
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=h, **mesh),
                     materials={"sheet": fx.MooneyRivlin(c10=1 - c01, c01=c01)}, loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], model=Unrefused(space=space))
    targets = [fx.pole_stretch(s) for s in CREASED.get(ratio, STRETCHES)] if heights is None \
        else [fx.pole_height(z) for z in heights]
    began = time.perf_counter()
    path = fx.trace(scene, until=targets[-1], through=targets[:-1], progress=False)
    seconds = time.perf_counter() - began
    near_rim = [(1 - np.clip(h, 0.05, 0.5), h)]
    met = [s for s in path.states if s.met]
    return {"heights": [s.measures["pole_height"] for s in met],
            "pressure": [s.measures["pressure"] for s in met],
            "pole_thickness": [path.profile(s).thickness[0] for s in met],
            "rim_stress": [float(path.stress(s).at(near_rim).on_face((0.0, 1.0)).meridional[0]) for s in met]}, seconds


def errors(found, reference):
    """{quantity: relative errors at the heights}."""
    return {q: np.abs(np.array(found[q]) / reference[q] - 1) for q in QUANTITIES}


def row(name, error, seconds):
    shape, rim = max(error["pressure"].max(), error["pole_thickness"].max()), error["rim_stress"]
    say(f"{name:32}{shape:12.1e}{rim[1:].max():12.1e}{rim[0]:12.1e}{seconds:9.1f}")


def over_ratios(ratios, accuracies, materials):
    """The promises of `accuracy` at every r0/h0."""
    results = {}
    for ratio in ratios:
        elements, grading = RATIOS[ratio]
        for material in materials:
            c01 = MATERIALS[material]
            reference, seconds = inflate(ratio, c01, "P1", elements=elements, grading=grading)
            mine = results[f"{ratio} {material}"] = {"reference": reference}
            say("", f"r0/h0 {ratio}, {material}: reference {elements[0]}x{elements[1]}, {seconds:.0f} s",
                f"{'':32}{'p, h pole':>12}{'rim >= 1.2':>12}{'rim 1.02':>12}{'s':>9}")
            for name in ("reference, P1dg", *accuracies):
                mesh = {"elements": elements, "grading": grading} if name.startswith("ref") else {"accuracy": name}
                found, seconds = inflate(ratio, c01, heights=reference["heights"], **mesh)
                error = errors(found, reference)
                row(name, error, seconds)
                mine[name] = {q: error[q].tolist() for q in QUANTITIES} | {"seconds": seconds}
    return results


def slim_triangles():
    """Taller and taller triangles at r0/h0 = 2: the default pressures lock, continuous ones do not."""
    reference, _ = inflate(2, space="P1", elements=RATIOS[2][0])
    results = {}
    say("", "slim triangles at r0/h0 = 2", f"{'':32}{'p, h pole':>12}{'rim >= 1.2':>12}{'rim 1.02':>12}{'s':>9}")
    for space in ("P1dg", "P1"):
        for along, through in SLIM:
            name = f"{space} {along}x{through}, {along / (2 * through):.3g} tall"
            try:
                found, seconds = inflate(2, space=space, heights=reference["heights"], elements=(along, through))
            except fx.ConvergenceError as failure:
                say(f"{name:32}  {str(failure).split('.')[0]}")
                continue
            row(name, errors(found, reference), seconds)
            results[name] = {q: e.tolist() for q, e in errors(found, reference).items()}
    return results


def inf_sup(space, tall, along=16, through=2):
    """The inf-sup constant of P2 (P1dg: and bubbles) / `space` on a plane strip held at one end.

    The least root of B A^-1 B^T q = beta^2 M q, with A the H1 product, B the divergence, M the mass of the pressures.
    """
    mesh = fx.mesh.disc(radius=along / tall / through, thickness=1.0, elements=(along, through))
    domain, pressure = mesh.domain, fx.MixedPressure(space=space).pressure
    element = basix.ufl.element("Lagrange", "triangle", 2)
    if pressure.bubble:
        element = basix.ufl.enriched_element([element, basix.ufl.element("Bubble", "triangle", 3)])
    V = fem.functionspace(domain, basix.ufl.blocked_element(element, shape=(2,)))
    Q = fem.functionspace(domain, (pressure.family, pressure.degree))
    u, v, p, q = ufl.TrialFunction(V), ufl.TestFunction(V), ufl.TrialFunction(Q), ufl.TestFunction(Q)

    def dense(form):
        matrix = petsc.assemble_matrix(fem.form(form * ufl.dx))
        matrix.assemble()
        matrix.convert("dense")
        return matrix.getDenseArray().copy()
    held = [fem.locate_dofs_topological(V.sub(i), 1, mesh.facets_of("axis")) for i in (0, 1)]
    free = np.setdiff1d(np.arange(2 * V.dofmap.index_map.size_local), np.concatenate(held))
    A, B = dense(ufl.inner(ufl.grad(u), ufl.grad(v)))[np.ix_(free, free)], dense(q * ufl.div(u))[:, free]
    return float(np.sqrt(scipy.linalg.eigh(B @ scipy.linalg.solve(A, B.T, assume_a="pos"), dense(p * q),
                                           eigvals_only=True)[0]))


def inf_sup_constants():
    say("", "inf-sup constant of a strip, triangles this much taller than wide:",
        f"{'':8}" + "".join(f"{tall:>9g}" for tall in TALL))
    results = {space: [inf_sup(space, tall) for tall in TALL] for space in ("P1dg", "P1", "P0")}
    for space, values in results.items():
        say(f"{space:8}" + "".join(f"{beta:9.3f}" for beta in values))
    return results


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true", help="three ratios, without fine meshes")
    options.add_argument("--ratios", type=float, nargs="+", choices=list(RATIOS), help="only these r0/h0")
    options.add_argument("--materials", nargs="+", choices=list(MATERIALS), default=list(MATERIALS))
    options.add_argument("--out", type=Path, default=Path("results/thickness"), help="folder for results")
    args = options.parse_args()
    accuracies = ["draft", "standard", "fine"][:2 if args.quick else None]
    results = {"inf_sup": inf_sup_constants(),
               "ratios": over_ratios(args.ratios or (list(RATIOS)[2:7:2] if args.quick else RATIOS), accuracies,
                                     args.materials)}
    if not args.quick and not args.ratios:
        results["slim"] = slim_triangles()
    files.write_summary(args.out / "summary.json", results, COMM)


if __name__ == "__main__":
    main()
