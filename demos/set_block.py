"""Draw a hot block to a stretch of 1.5, chill it in its grip and release it, against the exact balance.

A neo-Hookean block (c10 = 1, shear modulus mu = 2) is drawn in one or two directions, chilled from 150 C to 20 C, and
released. Between 85 and 75 C it solidifies (`Solidification`). The glass, of shear modulus G, is free of stress at the
drawn stretch L, the rubber at 1. Where both balance, mu (l^2 - l^-k) + G ((l/L)^2 - (l/L)^-k) = 0, with k = 1 in
uniaxial and 4 in equibiaxial extension. Units mm, s, MPa, C; heat in SI.
"""

import numpy as np
from common import parser, save, say, summarise
from scipy.optimize import brentq

import formingx as fx
from formingx import figures
from formingx.results import files

C10, DRAWN, HOT, COLD, SIZE = 1.0, 1.5, 150.0, 20.0, 1e-3
MODULI = (200, 2000)
MODES = {"uniaxial": ("top", "z", 1), "equibiaxial": ("rim", "r", 4)}            # what is drawn; k
HEAT = fx.ThermalProperties(conductivity=0.2, density=1000.0, heat_capacity=2000.0)


def form(mode, modulus):
    """Return the path: drawn at once, 20 s of cold air on both faces, released."""
    on, component, _ = MODES[mode]
    air = [fx.Convection(face, h=500.0, air=COLD) for face in ("top", "bottom")]
    scene = fx.Scene(mesh=fx.mesh.disc(radius=SIZE, thickness=SIZE, elements=(2, 2)), temperature=HOT,
                     materials=fx.Solidification(fx.NeoHookean(c10=C10), modulus=modulus, between=(75, 85)),
                     heat=fx.Cooling(HEAT, air, unit="C", tolerance=0.5),
                     supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z"),
                               fx.PrescribedDisplacement(on, component, name="grip")])
    return fx.Process(scene).run([fx.Stage("draw", control="grip", until=fx.travel((DRAWN - 1) * SIZE)),
                                  fx.Stage("chill", duration=20.0), fx.Stage("let go", inactive=["grip"])],
                                 progress=False)


def stretch(path, mode):
    """Return the mean stretch of the block in the drawn direction."""
    F = path.stress().at_quadrature_points().deformation_gradient
    return float(np.mean(F[:, 0, 0] if mode == "equibiaxial" else F[:, 1, 1]))


def exact(mode, modulus):
    """Return the stretch at which rubber and glass balance."""
    k = MODES[mode][2]
    return brentq(lambda l: 2 * C10 * (l**2 - l**-k) + modulus * ((l / DRAWN)**2 - (l / DRAWN)**-k), 1, DRAWN,
                  xtol=1e-14)


def main():
    args = parser("set_block", __doc__).parse_args()
    summary = {mode: {} for mode in MODES}
    figure, axes = figures.figure()
    at = np.geomspace(0.1, 1e4, 100)
    for mode in MODES:
        line, = axes.plot(at, [exact(mode, modulus) for modulus in at], label=f"{mode}, exact")
        for modulus in MODULI:
            path = form(mode, modulus)
            found = summary[mode][f"G_{modulus}"] = {"stretch": stretch(path, mode), "exact": exact(mode, modulus),
                                                     "steps": path.counts.steps}
            say(f"{mode}, G = {modulus}: {found['stretch']:.6f}, exact {found['exact']:.6f},"
                f" {found['steps']} steps")
            axes.plot(modulus, found["stretch"], "o", color=line.get_color(),
                      label=f"{mode}, computed" if modulus == MODULI[0] else None)
    axes.axhline(DRAWN, color="0.6", lw=0.8)
    axes.set(xlabel="shear modulus of the glass, MPa (rubber: 2 MPa)", xscale="log",
             ylabel="stretch after the release (drawn to 1.5)")
    axes.legend(frameon=False)
    save(figure, args.out / "set_block.png")
    summarise(args.out, summary | {"versions": files.versions()})


if __name__ == "__main__":
    main()
