"""Check the promise of `accuracy` from thick discs to thin ones, and the effect of slim triangles.

A hinged sheet of radius 1 is inflated to pole stretches of 1.02, 1.2, 2 and 3. Every mesh is compared at the same pole
heights with a reference: near-square elements, continuous pressures (P1). The error of the reference is estimated by
the default pressures (P1dg) on the same mesh. Errors are those of pressure and pole thickness, and of the meridional
stress of the top face one thickness inside the rim, but between r0/20 and r0/2. (Nearer to the rim, thin sheets bend
over a few thicknesses.)

Prints the inf-sup constants of a strip, the table of r0/h0, that of slim triangles, and where the face at the rim
creases; writes results/thickness/. About 40 minutes (--quick: three ratios without "fine", 2 minutes).
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
          10: ((140, 14), 1.0), 13: ((156, 12), 1.0), 15.24: ((160, 10), 1.0), 20: ((160, 8), 1.0),
          30: ((180, 6), 1.0), 50: ((200, 4), 0.3), 200: ((400, 2), 0.2), 2000: ((800, 2), 0.1)}
# where a hinge's rim face creases before 3 (`rim_faces` shows it): to these only, as no two meshes agree beyond
CREASED = {(1, "neo-Hookean"): (1.02, 1.1), (1, "Mooney"): (1.02, 1.1), (1.25, "Mooney"): (1.02, 1.2, 1.5)}
MATERIALS = {"neo-Hookean": 0.0, "Mooney": 0.2}        # c01 of c10 + c01 = 1
QUANTITIES = ("pressure", "pole_thickness", "rim_stress")
SLIM = ((20, 7), (40, 14), (40, 7), (40, 5), (40, 4), (40, 2), (80, 4), (80, 2))      # at r0/h0 = 2


TALL = (0.1, 0.5, 1, 2, 4, 8, 16, 32)                  # height over width of triangles in a strip


class Unrefused(fx.MixedPressure):
    """Elements that a scene does not refuse when they lock, to show by how much."""

    def check(self, scene):
        pass


def inflate(ratio, c01=0.0, space="P1dg", stretches=STRETCHES, heights=None, **mesh):
    """Return the path to pole stretches, or to pole heights, and its seconds.

    A path that does not arrive is returned as far as it goes. mesh: elements or accuracy, and grading.
    """
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1 / ratio, **mesh),
                     materials={"sheet": fx.MooneyRivlin(c10=1 - c01, c01=c01)}, loads=[fx.Pressure("bottom")],
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], model=Unrefused(space=space))
    targets = [fx.pole_stretch(s) for s in stretches] if heights is None else [fx.pole_height(z) for z in heights]
    began = time.perf_counter()
    try:
        path = fx.trace(scene, until=targets[-1], intermediate=targets[:-1], progress=False)
    except fx.ConvergenceError as failure:
        path = failure.path
        say(f"  {str(failure).split('. ')[0]} (r0/h0 {ratio:g}, {space}, {mesh})")
    return path, time.perf_counter() - began


def measures(path, ratio):
    """Return {quantity: values at the targets that were met}."""
    near_rim = [(1 - np.clip(1 / ratio, 0.05, 0.5), 1 / ratio)]
    met = [s for s in path.states if s.target]
    return {"heights": [s.measures["pole_height"] for s in met],
            "pressure": [s.measures["pressure"] for s in met],
            "pole_thickness": [path.profile(s).thickness[0] for s in met],
            "rim_stress": [float(path.stress(s).at_points(near_rim).on_face((0.0, 1.0)).meridional[0]) for s in met]}


def errors(found, reference):
    """Return {quantity: relative errors at the heights that were met}."""
    return {q: np.abs(np.array(found[q]) / reference[q][:len(found[q])] - 1) for q in QUANTITIES}


def row(name, error, seconds):
    shape, rim = [*error["pressure"], *error["pole_thickness"]], error["rim_stress"]
    say(f"{name:32}" + "".join(f"{max(e, default=np.nan):12.1e}" for e in (shape, rim[1:], rim[:1]))
        + f"{seconds:9.1f}")


def over_ratios(ratios, accuracies, materials):
    """Print and return the errors of each `accuracy` at every r0/h0."""
    results = {}
    for ratio in ratios:
        elements, grading = RATIOS[ratio]
        for material in materials:
            c01, stretches = MATERIALS[material], CREASED.get((ratio, material), STRETCHES)
            path, seconds = inflate(ratio, c01, "P1", stretches, elements=elements, grading=grading)
            reference = measures(path, ratio)
            mine = results[f"{ratio} {material}"] = {"reference": reference}
            say("", f"r0/h0 {ratio:g}, {material}: reference {elements[0]}x{elements[1]}, {seconds:.0f} s"
                + (f"; to stretch {stretches[-1]:g}: then the rim's face creases, on each mesh in another way"
                   if stretches is not STRETCHES else ""),
                f"{'':32}{'p, h pole':>12}{'rim >= 1.2':>12}{'rim 1.02':>12}{'s':>9}")
            for name in ("reference, P1dg", *accuracies):
                mesh = {"elements": elements, "grading": grading} if name.startswith("ref") else {"accuracy": name}
                path, seconds = inflate(ratio, c01, heights=reference["heights"], **mesh)
                error = errors(measures(path, ratio), reference)
                row(name, error, seconds)
                mine[name] = {q: error[q].tolist() for q in QUANTITIES} | {"seconds": seconds}
    return results


def slim_triangles():
    """Print and return errors of ever taller triangles at r0/h0 = 2: default pressures lock, continuous ones not."""
    reference, results = measures(inflate(2, space="P1", elements=RATIOS[2][0])[0], 2), {}
    say("", "slim triangles at r0/h0 = 2", f"{'':32}{'p, h pole':>12}{'rim >= 1.2':>12}{'rim 1.02':>12}{'s':>9}")
    for space in ("P1dg", "P1"):
        for along, through in SLIM:
            name = f"{space} {along}x{through}, {along / (2 * through):.3g} tall"
            path, seconds = inflate(2, space=space, heights=reference["heights"], elements=(along, through))
            error = errors(measures(path, 2), reference)
            row(name, error, seconds)
            results[name] = {q: e.tolist() for q, e in error.items()}
    return results


def rim_faces():
    """Print and return the smallest stretch along the face at the rim, on three meshes, which agree up to a crease."""
    stretches, results = (1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 2.0), {}
    say("", "least stretch along the rim's face, at pole stretches of",
        " " * 32 + "".join(f"{s:8g}" for s in stretches))
    for ratio, material in ((1, "neo-Hookean"), (1.25, "Mooney"), (1.25, "neo-Hookean")):
        for name, mesh in (("standard", {"accuracy": "standard"}), ("60x33", {"elements": (60, 33)}),
                           ("reference", {"elements": RATIOS[ratio][0], "space": "P1"})):
            path, _ = inflate(ratio, MATERIALS[material], stretches=stretches, **mesh)
            found = [least_along_rim(path.stress(s), 1 / ratio) for s in path.states if s.target]
            say(f"{ratio:<6g}{material:12}{name:14}" + "".join(f"{least:8.3f}" for least in found))
            results[f"{ratio} {material}, {name}"] = found
    return results


def least_along_rim(stress, h):
    F = stress.at_points([(1.0, z) for z in np.linspace(0, h, 401)]).deformation_gradient
    return float(np.hypot(F[:, 0, 1], F[:, 1, 1]).min())


def inf_sup(space, tall, along=16, through=2):
    """Return the inf-sup constant of P2 (P1dg: with bubbles) / `space` on a plane strip held at one end.

    It is the least root of B A^-1 B^T q = beta^2 M q, with A the H1 product, B the divergence, M the mass of the
    pressures.
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
        results["slim"], results["creases"] = slim_triangles(), rim_faces()
    files.write_summary(args.out / "summary.json", results, COMM)


if __name__ == "__main__":
    main()
