"""What the demos `relaxation`, `viscoelastic_tube` and `balloon` should give: exact solutions, by the demos' keys.

P0: c10 = 0.05 MPa, a branch of 0.5 MPa and 1 s. P1: c10 = 0.05 MPa, branches (0.3 MPa, 0.5 s) and (0.4 MPa, 5 s).
`python3 tests/expected_in_time.py` prints them all.
"""

import json
import math

import numpy as np

import formingx as fx
from formingx.exact import time as reference_time

C10, P0, P1 = 0.05, [(0.5, 1.0)], [(0.3, 0.5), (0.4, 5.0)]


def relaxation():
    """sigma1 - sigma3 held and at constant Hencky rates, MPa; stretches under a dead force and after it."""
    found = {}
    held, going = (fx.Viscoelastic(fx.NeoHookean(c10=C10), branches) for branches in (P0, P1))
    for mode in ("uniaxial", "equibiaxial"):
        for stretch in (1.5, 2, 3, 5, 10):
            t = (0, 0.1, 0.25, 0.5, 1, 2, 5)
            for time, P in zip(t, held.relaxation(mode, stretch, t)):
                found[f"relaxation/{mode}/{stretch}/{time}"] = P * stretch
        for rate in (0.1, 1, 10):
            l = (1.1, 1.25, 1.5, 2, 3, 5)
            for stretch, P in zip(l, going.constant_rate(mode, rate, l)):
                found[f"rate/{mode}/{rate}/{stretch}"] = P * stretch
    body = reference_time.block("uniaxial", c10=C10, branches=P1)
    body.jump_to_load(0.2, (0, 2))
    found["creep/0"] = math.exp(body.s)
    found |= {f"creep/{t}": math.exp(s) for t, s in zip((0.5, 1, 2, 5), body.creep((0.5, 1, 2, 5)))}
    body.jump_to_load(0.0, (-1, body.s))
    found["recovery/0"] = math.exp(body.s)
    after = (0.5, 1, 2, 5, 10, 20, 50)
    return found | {f"recovery/{t}": math.exp(s) for t, s in zip(after, body.creep(5 + np.array(after)))}


def viscoelastic_tube():
    """Pressures, MPa, and inner radii of A = 1, B = 2, its inner radius driven to 2, held 2 s, let go."""
    return _wall("tube") | _wall("sphere")


def _wall(kind):
    n, found = {"tube": 2, "sphere": 3}[kind], {}
    for speed in (0.1, 1, 10):
        body = reference_time.wall(kind, inner_radius=1, outer_radius=2, c10=C10, branches=P1)
        radii = np.array([1.1, 1.25, 1.5, 1.75, 2])
        end = 1 / speed
        driven = body.deform(lambda t, v=speed: ((1 + v * t) ** n - 1, n * v * (1 + v * t) ** (n - 1)),
                            (radii - 1) / speed)
        held = [driven[-1], *body.relax(end + np.array([0.1, 0.5, 1, 2]))]
        body.jump_to_load(0.0, (-0.5, body.s))
        s = [body.s, *body.creep(end + 2 + np.array([0.5, 1, 2, 5, 10, 20, 50]))]
        for name, keys, values in (
                ("pressure_at_inner_radius", (1.1, 1.25, 1.5, 1.75, 2), driven), ("held", (0, 0.1, 0.5, 1, 2), held),
                ("inner_radius_after_release", (0, 0.5, 1, 2, 5, 10, 20, 50), (1 + np.array(s)) ** (1 / n))):
            prefix = "sphere/" * (kind == "sphere")
            found |= {f"{prefix}speed_{speed}/{name}/{key}": value for key, value in zip(keys, values)}
    return found


def balloon():
    """p R0/H0, MPa, of a thin sphere that is blown with a constant flow and held; times, s, at constant pressures."""
    found = {}
    for q in (2.6, 26, 260):
        body, stretches = reference_time.balloon(c10=C10, branches=P1), np.array([1.1, 1.25, 1.5, 2, 2.5, 3])
        blown = body.deform(lambda t, q=q: (math.log1p(q * t) / 3, q / (3 * (1 + q * t))), (stretches**3 - 1) / q)
        found |= {f"flow_{q}/p_R0_over_H0_at_stretch/{l}": p for l, p in zip((1.1, 1.25, 1.5, 2, 2.5, 3), blown)}
        held = (0.1, 0.5, 1, 2, 5, 20)
        found |= {f"flow_{q}/held/{t}": p for t, p in zip(held, body.relax(26 / q + np.array(held)))}
    for pressure in (0.1, 0.2, 0.4, 0.8):
        body, stretches = reference_time.balloon(c10=C10, branches=P1), np.array([1.1, 1.2, 1.3, 1.5])
        body.jump_to_load(pressure, (0, math.log(1.38)))
        last = 1.11 if pressure == 0.1 else 10.0                 # 0.1 MPa is carried for ever at a stretch of 1.155
        reached, snap = body.creep_times(np.log(stretches), math.log(last))
        found |= {f"pressure_{pressure}/time_at_stretch/{l}": t for l, t in zip((1.1, 1.2, 1.3, 1.5), reached)
                  if np.isfinite(t)}
        if snap is not None:
            found[f"pressure_{pressure}/snap_time_s"] = snap
    return found


def everything():
    """{demo: {key: value}}."""
    found = {"relaxation": relaxation(), "viscoelastic_tube": viscoelastic_tube(), "balloon": balloon()}
    return {demo: {key: float(value) for key, value in values.items()} for demo, values in found.items()}


if __name__ == "__main__":
    print(json.dumps(everything(), indent=1))
