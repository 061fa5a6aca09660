"""Run random scenes for `fuzz.py`: each run ends in states that hold, or in an error message.

A state holds if its numbers are finite, its wall is positive, its face is on the right side of each tool, and the
energy balance of the run closes: `Path.work()["unbalanced"]` against the largest of its entries. Where the balance does
not close, which may be due to the integrals over long steps, it must close with steps of a fiftieth, with the same last
state.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import numpy as np

STATES = 120                                   # of a run; more than that is an end in words
ITERATIONS = 4000
UNBALANCED, INSIDE, SAME = 0.02, 0.05, 0.02    # of the largest energy; of the thickness; of the pole height


class Wrong(Exception):
    """A result that does not hold."""


def cases() -> dict[str, Callable[[random.Random], Any]]:
    """Return {kind and name: a run}."""
    return {"processes blown": _blown, "processes plugged": _plugged, "processes in time": _in_time,
            "processes moulded": _moulded, "processes cooled": _cooled}


def _scene(rng: random.Random, contact: Callable | None = None, relaxes: bool = False, pressed: bool = False,
           **more: Any) -> tuple:
    """Return the scene, radius and thickness of a sheet, with one layer or two, axisymmetric or in plane strain.

    pressed: True if air acts on it, too.
    """
    import formingx as fx
    radius = rng.uniform(10, 60)
    thickness = radius * 10 ** rng.uniform(-2.2, -0.8)
    elements = rng.randint(8, 20), rng.choice([1, 1, 2, [2, 1]])
    layers = {"lower": 0.4 * thickness, "upper": 0.6 * thickness} if rng.random() < 0.2 else {"sheet": thickness}
    mesh = fx.mesh.disc(radius=radius, thickness=layers, elements=elements)
    c10 = 10 ** rng.uniform(-2, 1)
    plane = fx.PlaneStrain() if rng.random() < 0.2 else None
    materials = {name: _material(rng, c10, relaxes, "temperature" in more) for name in layers}
    support = rng.choice([fx.Clamped, fx.SimplySupported])("rim")
    return fx.Scene(mesh=mesh, materials=materials, supports=[fx.Symmetry("axis"), support], kinematics=plane,
                    loads=[fx.Pressure("bottom", name="air")] if pressed or not contact else [],
                    contacts=[contact(radius, thickness)] if contact else [], **more), radius, thickness


def _material(rng: random.Random, c10: float, relaxes: bool, warm: bool) -> Any:
    """Return a material with a stiffness of about c10, at the highest temperature if it depends on temperature."""
    import formingx as fx
    if warm:
        return fx.NeoHookean(c10=fx.table({20: rng.uniform(1, 5) * c10, 100: 1.2 * c10, 200: c10}))
    material: Any = rng.choice([fx.NeoHookean(c10=c10), fx.MooneyRivlin(c10=c10, c01=0.2 * c10), fx.Yeoh(
        c10=c10, c20=0.0, c30=1e-3 * c10), fx.Gent(mu=2 * c10, Jm=60.0)])
    if relaxes:
        branches = [(c10 * 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-2, 2)) for _ in range(rng.randint(1, 2))]
        law = rng.choice([fx.Viscoelastic, fx.Viscoelastic, fx.TransientNetwork])
        material = law(fx.NeoHookean(c10=c10), branches=branches)
    return material


def _ball(rng: random.Random) -> Callable:
    """Return a function that makes the contact with a plug: a ball, or a flat plug with a rounded edge."""
    import formingx as fx

    def contact(radius, thickness):
        size = radius * rng.uniform(0.15, 0.6)
        shape = (fx.tools.sphere(radius=size, z=thickness) if rng.random() < 0.5 else fx.tools.male(
            radius=size, height=10 * radius, base=-10 * radius, fillet=size * rng.uniform(0.1, 0.9)).mirrored().moved(
                z=thickness))
        friction = rng.choice(["none", "stick", rng.uniform(0.05, 1.5)])
        return fx.Contact("top", shape, friction, separates=True, direction=(0, -1), name="plug")
    return contact


def _blown(rng: random.Random) -> None:
    import formingx as fx
    scene, _, _ = _scene(rng)
    until = fx.pole_stretch(rng.uniform(1.1, 4.0))
    _judge(lambda **options: fx.trace(scene, until=until, progress=False, **options))


def _plugged(rng: random.Random) -> None:
    import formingx as fx
    scene, radius, _ = _scene(rng, _ball(rng))
    stages = [fx.Stage("down", control="plug", until=fx.travel(radius * rng.uniform(0.1, 0.8)))]
    if rng.random() < 0.4:
        stages.append(fx.Stage("up", control="plug", until=fx.travel(0.0)))
    _judge(lambda **options: fx.Process(scene).run(stages, progress=False, **options))


def _in_time(rng: random.Random) -> None:
    """Run a sheet that relaxes, with a table of a plug or a flow, and judge it."""
    import formingx as fx
    if rng.random() < 0.5:
        scene, radius, _ = _scene(rng, _ball(rng), relaxes=True)
        table = _table(rng, radius * rng.uniform(0.1, 0.6))
        stages = [fx.Stage("follow", amplitudes={"plug": table})]
    else:
        scene, radius, _ = _scene(rng, relaxes=True)
        table = _table(rng, radius**3 * rng.uniform(0.2, 3.0))
        stages = [fx.Stage("flow", control="air", amplitudes={fx.enclosed_volume: table})]
    _judge(lambda **options: fx.Process(scene).run(stages, progress=False, accuracy="draft", **options))


def _cup(rng: random.Random) -> Callable:
    """Return a function that makes the contact with a cup, whose edges are as round as the elements resolve."""
    import formingx as fx

    def contact(radius, thickness):
        fillet = radius * rng.uniform(0.1, 0.3)
        cup = fx.tools.cup(radius=0.98 * radius, depth=radius * rng.uniform(0.2, 0.8), mouth=thickness,
                           draft=rng.uniform(0, 8), fillet=fillet, lip=0.1 * radius)
        return fx.Contact("top", cup, rng.choice(["none", "stick", rng.uniform(0.05, 1.5)]), name="mould")
    return contact


def _moulded(rng: random.Random) -> None:
    import formingx as fx
    scene, _, thickness = _scene(rng, _cup(rng), pressed=True)
    stiff = max(scene.shear_modulus(layer) for layer in scene.mesh.layers) * thickness / scene.extent[0]
    stages = [fx.Stage("blow", control="air", until=fx.pressure(stiff * rng.uniform(0.5, 6)))]
    _judge(lambda **options: fx.Process(scene).run(stages, progress=False, **options))


def _cooled(rng: random.Random) -> None:
    """Run a hot sheet in cold air, pushed by a plug or blown, and judge it."""
    import formingx as fx
    heat = fx.Cooling(fx.ThermalProperties(conductivity=1.0, density=1.0, heat_capacity=1.0),
                      [fx.Convection("top", h=10 ** rng.uniform(-2, 1), air=20.0)], unit="C", tolerance=0.1)
    contact = _ball(rng) if rng.random() < 0.5 else None
    scene, radius, _ = _scene(rng, contact, temperature=rng.uniform(100, 200), heat=heat)
    table = _table(rng, radius * rng.uniform(0.1, 0.5) if contact else radius**3 * rng.uniform(0.2, 1.0))
    follow = {"plug": table} if contact else {fx.enclosed_volume: table}
    stage = fx.Stage("form", amplitudes=follow, **({} if contact else {"control": "air"}))
    _judge(lambda **options: fx.Process(scene).run([stage], progress=False, accuracy="draft", **options))


def _table(rng: random.Random, most: float) -> list[tuple[float, float]]:
    """Return a table that goes up, sometimes stands still or goes partly back."""
    times = np.cumsum([10 ** rng.uniform(-2, 1) for _ in range(rng.randint(1, 4))])
    values = [most, rng.choice([most, 0.5 * most]), rng.uniform(0.3, 1) * most, most]
    return [(0.0, 0.0), *zip(times.tolist(), values)]


def _judge(run: Callable[..., Any]) -> None:
    """Raise `Wrong` if a state does not hold."""
    import formingx as fx
    path = run(max_steps=STATES)
    _look_at(path)
    left = _unbalanced(path)
    if left > UNBALANCED:
        finer = run(max_steps=20 * STATES, step=fx.StepControl(length=0.02, largest=0.02))
        here, there = (p.last.measures["pole_height"] for p in (path, finer))
        again = _unbalanced(finer)
        if again > UNBALANCED or abs(here - there) > SAME * np.abs(finer["pole_height"]).max():
            raise Wrong(f"the ledger is {left:.2g} of its largest entry off, {again:.2g} with short steps; pole heights"
                        f" {here:.5g}, {there:.5g}")


def _unbalanced(path: Any) -> float:
    """Return the unbalanced energy over the largest entry."""
    ledger = path.work()
    largest = max(float(np.abs(row).max()) for name, row in ledger.items() if name != "unbalanced")
    return float(np.abs(ledger["unbalanced"]).max()) / max(largest, 1e-300)


def _look_at(path: Any) -> None:
    for state in path.states:
        bad = [name for name, value in state.measures.items() if not np.isfinite(value)]
        if bad:
            raise Wrong(f"{bad} are not finite")
    if path.counts.iterations > ITERATIONS:
        raise Wrong(f"{path.counts.iterations} iterations")
    scene = path.problem.scene
    thickness = path.profile(path.states[0]).original_thickness.min()
    for state in path.states:
        profile = path.profile(state)
        with path.problem.state_context(state) as problem:
            travels = [contact.tool_displacement(state.control) for contact in problem.contacts]
        for contact, travel in zip(scene.contacts, travels):
            inside = float(contact.tool.signed_distance(profile.top - travel).max())
            if inside > INSIDE * thickness:
                raise Wrong(f"the top is {inside / thickness:.2g} thicknesses inside a tool")
        if profile.wall_ratio.min() <= 1e-3:
            raise Wrong(f"the wall is {profile.wall_ratio.min():.2g} of what it was")
