"""The demo of a tray from CAD files: STEP, STL and flat triangles; and a ball of 80 triangles."""

import pytest
from test_demos import summary

KEYS = ["least_wall_mm/step", "least_wall_mm/stl", "least_wall_mm/flat", "least_at_mm/x", "least_at_mm/y", "weight_g",
        "draw_ratio", "states", "iterations", "disc/analytic/least_wall", "disc/stl80/least_wall",
        "disc/analytic/force", "disc/stl80/force"]


def at(found, key):
    for word in key.split("/"):
        found = found[word]
    return found


@pytest.mark.thorough
def test_quick(tmp_path):
    found = summary("cad_tray", tmp_path, "--quick")
    assert all(at(found, key) != 0 for key in KEYS)
    walls = found["least_wall_mm"]
    assert walls["stl"] == pytest.approx(walls["step"], rel=5e-3)
    disc = found["disc"]
    assert disc["stl80"]["least_wall"] == pytest.approx(disc["analytic"]["least_wall"], rel=1e-3)
    assert disc["stl80"]["force"] == pytest.approx(disc["analytic"]["force"], rel=1e-3)


@pytest.mark.slow
def test_full(tmp_path):
    found = summary("cad_tray", tmp_path)
    walls, meshes = found["least_wall_mm"], found["meshes_least_wall_mm"]
    assert walls["stl"] == pytest.approx(walls["step"], rel=0.015) and meshes[-1] == pytest.approx(meshes[-2], rel=0.03)
    disc = found["disc"]
    assert disc["stl80"]["least_wall"] == pytest.approx(disc["analytic"]["least_wall"], rel=3e-3)
    assert disc["stl80"]["force"] == pytest.approx(disc["analytic"]["force"], rel=1e-3)
