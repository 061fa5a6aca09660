"""Press a block between plates without friction, and compare with the exact solution (Song 1993, section 7.3.1).

Neo-Hookean, I1 constant 0.10 MPa; R0 = 1.32 cm, H = 1.25 cm, pressed to h = 0.3288 cm. Eqs. (7.6), (7.7), table 7.1.
"""

import numpy as np
from common import parser, save, say, summarise
from plates import HALF_HEIGHT, NEWTON, RADIUS, block, force, press

import formingx as fx
from formingx import figures
from formingx.results import files

I1_CONSTANT, PRESSED = 0.10, 0.3288                          # MPa, cm


def exact_force(h):
    """Return the force (N) of eq. (7.6) at a half height h (cm)."""
    l2 = HALF_HEIGHT / h                                     # radial stretch squared
    return NEWTON * 2 * np.pi * RADIUS**2 * (l2**2 - 1 / l2) * I1_CONSTANT


def exact_stress(h):
    """Return the second Piola-Kirchhoff stress S^zz (MPa) of eq. (7.7) at a half height h (cm)."""
    return -2 * ((HALF_HEIGHT / h) ** 3 - 1) * I1_CONSTANT


def main():
    args = parser("compression_homogeneous", __doc__).parse_args()
    elements = (2, 2)                                        # eight triangles, as the thesis
    scene = block(fx.NeoHookean(c10=I1_CONSTANT), "none", elements, penalty=2e7, ramp=1e-8)      # to see 1e-4 of (7.7)
    path, end = press(scene, [HALF_HEIGHT - PRESSED])
    state = path.last
    stress = path.stress().at_quadrature_points().second_piola[:, 1, 1]
    profile = path.profile()
    radius = float(profile.top[-1, 0])
    l2 = HALF_HEIGHT / PRESSED
    summary = {
        "force_N": force(state), "exact_force_N": exact_force(PRESSED), "outer_radius_cm": radius,
        "exact_outer_radius_cm": RADIUS * np.sqrt(l2), "volume_error": abs(state.measures["mass_error"]),
        "stress_Szz_MPa": float(stress.mean()), "exact_stress_Szz_MPa": exact_stress(PRESSED),
        "stress_error": float(np.abs(stress / exact_stress(PRESSED) - 1).max()),
        "max_penetration_cm": path["penetration"].max(), "steps": path.counts.steps,
        "newton_iterations": path.counts.iterations, "ended": end, "versions": files.versions(),
    }
    say(f"force {summary['force_N']:.3f} N, exact {summary['exact_force_N']:.3f} N; outer radius {radius:.5f} cm, exact"
        f" {summary['exact_outer_radius_cm']:.5f} cm; volume error {summary['volume_error']:.1e} (thesis: 3.6e-3);"
        f" stress off by {summary['stress_error']:.1e} of (7.7);"
        f" {path.counts.steps} states")
    figure, axes = figures.figure()
    h = HALF_HEIGHT - path["travel"]
    fine = np.linspace(HALF_HEIGHT, PRESSED, 200)
    axes.plot(HALF_HEIGHT / fine, exact_force(fine), "k", label="exact, eq. (7.6)")
    axes.plot(HALF_HEIGHT / h, NEWTON * path["tool_force"], "o", color="C0", label="computed, 8 triangles")
    axes.set(xlabel="compression ratio H / h", ylabel="force, N")
    axes.legend(frameon=False)
    save(figure, args.out / "force.png")
    path.to_csv(args.out / "path.csv")
    summarise(args.out, summary)


if __name__ == "__main__":
    main()
