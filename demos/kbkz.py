"""Run scenes of K-BKZ type: blocks of an LDPE melt at constant Hencky rates, and discs inflated by a flow of air.

Blocks: the melt of Laun, Rheol. Acta 17 (1978) 1 (LDPE at 150 C; Pa, s). It has no damping (Lodge), the damping of
Wagner in the letters of Luo and Tanner, or that of Papanastasiou, Scriven and Macosko (PSM). Each stress is compared
with the integral of a homogeneous test. Discs: membranes of R0/h0 = 100, hinged, of the illustrative melt of
docs/kbkz.md (MPa, s). The enclosed volume grows to 2 R0^3 in 1 s and is constant for 2 s.
"""

import numpy as np
from common import parser, save, say, summarise
from relaxing import at_time, times

import formingx as fx
from formingx import figures
from formingx.results import files

LDPE = [(129000, 1e-4), (94800, 1e-3), (58600, 0.01), (26700, 0.1), (9800, 1), (1890, 10), (180, 100), (1, 1000)]
MELTS = {"lodge": fx.KBKZ(LDPE), "wagner": fx.KBKZ(LDPE, fx.LuoTanner(n=0.14, beta=0.018)),
         "psm": fx.KBKZ(LDPE, fx.PSM(alpha=14.38, beta=0.018))}
RATES, STRETCHES = (0.1, 1.0), (1.5, 2, 3, 5)
PULLED = {"uniaxial": ("top", "z"), "equibiaxial": ("rim", "r")}

SHEET = [(0.10, 0.01), (0.06, 0.1), (0.03, 1.0), (0.012, 10.0), (0.004, 100.0)]
DAMPINGS = {"psm_10_0.05": fx.PSM(alpha=10.0, beta=0.05), "wagner_0.1_0.15": fx.Wagner(alpha=0.1, beta=0.15),
            "wagner_0.1_0.3": fx.Wagner(alpha=0.1, beta=0.3)}
TITLES = {"lodge": "Lodge, no damping", "wagner": "Wagner", "psm": "PSM",
          "psm_10_0.05": r"PSM, $\alpha$ = 10, $\beta$ = 0.05",
          "wagner_0.1_0.15": r"Wagner, $\alpha$ = 0.1, $\beta$ = 0.15",
          "wagner_0.1_0.3": r"Wagner, $\alpha$ = 0.1, $\beta$ = 0.3"}
MET, R_OVER_H, VOLUME = (0.5, 1.0, 3.0), 100.0, 2.0                               # s; R0/h0; of R0^3


def block(melt, mode):
    """Return the scene of a block of 1 x 1 whose top or rim is pulled."""
    face, direction = PULLED[mode]
    return fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1.0, elements=(1, 1)), materials=MELTS[melt],
                    supports=[fx.Symmetry("axis"), fx.Symmetry("bottom", normal="z"),
                              fx.PrescribedDisplacement(face, direction, name="pull")])


def pull(melt, mode, rate, accuracy):
    """Return the path at a constant Hencky rate, and {stretch: sigma1 - sigma3 in Pa}."""
    at = [np.log(stretch) / rate for stretch in STRETCHES]
    stage = fx.Stage("pull", control="pull", amplitudes={fx.travel: lambda t: np.expm1(rate * t)},
                     until=fx.process_time(at[-1]), intermediate=times(0.0, at[:-1]))
    path = fx.Process(block(melt, mode)).run([stage], accuracy=accuracy, progress=False)
    found = {}
    for stretch, t in zip(STRETCHES, at):
        sigma = path.stress(at_time(path, "pull", t)).at_quadrature_points().cauchy.mean(axis=0)
        found[f"{stretch:g}"] = float(sigma[1, 1] - sigma[0, 0] if mode == "uniaxial" else sigma[0, 0] - sigma[1, 1])
    return path, found


def blow(damping, elements, accuracy):
    """Return the path of a disc."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=1 / R_OVER_H, elements=(elements, 1)),
                     materials=fx.KBKZ(SHEET, DAMPINGS[damping]), model=fx.Membrane(),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")],
                     loads=[fx.Pressure("bottom", name="air")])
    return fx.Process(scene).run([
        fx.Stage("blow", control="air", amplitudes={fx.enclosed_volume: [(0.0, 0.0), (1.0, VOLUME)]},
                 intermediate=times(0.0, MET[:1])),
        fx.Stage("hold", control="air", constant=fx.enclosed_volume(VOLUME), duration=MET[-1] - 1)],
        accuracy=accuracy, progress=False)


def numbers(path):
    """Return p R0/h0 (MPa) and the thickness ratio at the pole at the times MET."""
    states = [at_time(path, "hold" if t > 1 else "blow", t) for t in MET]
    return {"p_R0_over_h0": {f"{t:g}": R_OVER_H * s.measures["pressure"] for t, s in zip(MET, states)},
            "pole_thickness_ratio": {f"{t:g}": s.measures["pole_stretch"] ** -2 for t, s in zip(MET, states)}}


def main():
    options = parser("kbkz", __doc__)
    options.add_argument("--accuracy", type=float, help="relative error in time (None: 1e-3, with --quick 2e-3)")
    args = options.parse_args()
    accuracy = args.accuracy or (2e-3 if args.quick else 1e-3)
    summary: dict = {"largest_error_of_blocks": {}, "disc": {}}
    figure, axes = figures.figure(3, width=3.9)
    for k, (melt, law) in enumerate(MELTS.items()):
        off = []
        for ax, mode in zip(axes, PULLED):
            for rate in RATES if not args.quick else RATES[1:]:
                path, found = pull(melt, mode, rate, accuracy)
                summary.setdefault(melt, {}).setdefault(mode, {})[f"rate_{rate:g}"] = found
                exact = law.constant_rate(mode, rate, STRETCHES) * STRETCHES
                off.append(float(np.abs(np.array(list(found.values())) / exact - 1).max()))
                fine = np.linspace(1.01, STRETCHES[-1], 60)
                ax.plot(fine, law.constant_rate(mode, rate, fine) * fine / 1e3, color=f"C{k}", lw=1,
                        ls="-" if rate == RATES[-1] else "--")
                ax.plot(STRETCHES, np.array(list(found.values())) / 1e3, "o", color=f"C{k}", ms=4,
                        label=TITLES[melt] if rate == RATES[-1] else None)
            ax.set(xlabel="stretch", ylabel="$\\sigma_1-\\sigma_3$, kPa", title=f"{mode} (rate 1/s; dashed 0.1/s)")
        summary["largest_error_of_blocks"][melt] = max(off)
        say(f"{melt}: blocks within {100 * max(off):.3f} % of the integrals")
    for damping in DAMPINGS:
        path = blow(damping, 10 if args.quick else 40, accuracy)
        found = summary["disc"][damping] = numbers(path)
        say(f"disc, {damping}: p R0/h0 " + ", ".join(f"{v:.5f}" for v in found["p_R0_over_h0"].values())
            + " MPa, pole " + ", ".join(f"{v:.4f}" for v in found["pole_thickness_ratio"].values())
            + f" at {', '.join(found['p_R0_over_h0'])} s; {path.counts.steps} steps")
        axes[2].plot(path["process_time"], R_OVER_H * path["pressure"], label=TITLES[damping])
    axes[0].legend(frameon=False)
    axes[2].set(xlabel="time, s", ylabel="p R$_0$/h$_0$, MPa", title="inflated discs",
                ylim=(0, 1.3 * axes[2].get_ylim()[1]))
    axes[2].legend(frameon=False)
    save(figure, args.out / "kbkz.png")
    summarise(args.out, summary | {"accuracy": accuracy, "versions": files.versions()})


if __name__ == "__main__":
    main()
