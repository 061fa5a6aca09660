"""Press blocks far from the ordinary: slender and flat, with friction, sandwiches, coarse and fine, with roll-over.

Mooney, I1 constant 1.0 MPa, I2 constant 0.1 MPa; half height 1.25 cm unless said; pressed to H/h = 1.5.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "demos"))
from plates import HALF_HEIGHT, RADIUS, block, force, press  # noqa: E402

import formingx as fx  # noqa: E402

CASES = {
    "R0/H": [{"radius": q * HALF_HEIGHT} for q in (0.1, 0.3, 1.0, 5.0, 20.0)],
    "friction": [{"friction": mu} for mu in ("none", 0.05, 0.3, 1, "stick")],
    "sandwich": [{"ratio": q} for q in (1e-2, 1.0, 1e2, 1e4)],
    "mesh": [{"elements": n} for n in ((1, 1), (2, 2), (8, 4), (16, 8), (32, 16))],
}


def run(friction="stick", radius=RADIUS, ratio=None, elements=None):
    """Return the path and how it ended."""
    elements = elements or ((8, 8) if radius < 2 * HALF_HEIGHT else (32, 4))
    soft, layers = fx.MooneyRivlin(c10=1.0, c01=0.1), HALF_HEIGHT
    materials = soft
    if ratio:
        layers = {"strip": HALF_HEIGHT / 4, "block": 3 * HALF_HEIGHT / 4}
        materials = {"strip": fx.MooneyRivlin(c10=ratio, c01=0.1 * ratio), "block": soft}
    scene = block(materials, friction, elements, roll_over=True, layers=layers, radius=radius)
    return press(scene, [HALF_HEIGHT / 3], max_steps=300, progress=False)


def main():
    print(f"{'case':24}{'H/h':>7}{'force, N':>12}{'depth/H':>9}{'states':>7}{'Newton':>7}{'cuts':>5}{'s':>6}  end")
    for name, cases in CASES.items():
        for case in cases:
            began = time.perf_counter()
            path, end = run(**case)
            counts, label = path.counts, f"{name} {next(iter(case.values()))}"
            ratio = HALF_HEIGHT / (HALF_HEIGHT - path.last.measures["travel"])
            print(f"{label[:23]:24}{ratio:7.3f}{force(path.last):12.4g}"
                  f"{path['penetration'].max() / HALF_HEIGHT:9.1e}{counts.steps:7d}{counts.iterations:7d}"
                  f"{counts.failures:5d}{time.perf_counter() - began:6.1f}  {end.splitlines()[0][:150]}", flush=True)


if __name__ == "__main__":
    main()
