"""Show Newton's method just before and just after first contact, in the cup of demos/cup.py (Song 1993, fig. 5.7)."""

import cup
from common import parser, save, say, summarise
from moulding import first_touch, name_of

from formingx import figures

MEASURES = {"correction": r"$\|\Delta x\|/\|x\|$  (3.5.1)", "work": "work, over its first  (3.5.2)",
            "residual": "residual, over support forces"}


def errors(state):
    """Return {quantity: its values, one per iteration}; the converged state has a residual alone."""
    return {name: [value for value in (getattr(i, name) for i in state.history) if value > 0] for name in MEASURES}


def main():
    options = parser("contact_convergence", __doc__, elements=40)
    options.add_argument("--friction", default="stick", help="stick, none or a coefficient")
    args = options.parse_args()
    friction = args.friction if args.friction in ("stick", "none") else float(args.friction)
    path, _ = cup.form(friction, (20, 1) if args.quick else (args.elements, 2), (8.0,))
    touch = first_touch(path)
    after = next(i for i, state in enumerate(path.states) if state is touch)
    shown = {"before contact": path.states[after - 1], "first touch": path.states[after],
             "contact grows": path.states[after + 3]}
    figure, axes = figures.figure(len(shown), width=4.4)
    summary = {}
    for panel, (name, state) in zip(axes, shown.items()):
        summary[name.replace(" ", "_")] = found = errors(state)
        for measure, label in MEASURES.items():
            panel.semilogy(range(1, len(found[measure]) + 1), found[measure], "o-", label=label)
        panel.set(title=f"{name}, {state.measures['pressure']:.4g} psi", xlabel="iteration", ylim=(1e-17, 10))
        panel.xaxis.get_major_locator().set_params(integer=True)
        say(f"{name}: {state.measures['pressure']:.5g} psi, corrections "
            + " ".join(f"{c:.1e}" for c in found["correction"]))
    axes[0].legend(frameon=False)
    save(figure, args.out / "convergence.png")
    summarise(args.out, {"friction": name_of(friction), **summary})


if __name__ == "__main__":
    main()
