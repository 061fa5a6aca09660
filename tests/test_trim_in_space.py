"""Parts in three dimensions that are trimmed by an outline in the plane of x and y."""

import numpy as np
import pytest

import formingx as fx

HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]


@pytest.fixture(scope="module")
def path():
    sheet = fx.mesh.sheet(fx.mesh.circle(1.0, part="quarter"), size=0.1)
    scene = fx.Scene(mesh=sheet, thickness=0.01, materials=fx.NeoHookean(c10=1.0), supports=HELD,
                     loads=[fx.Pressure("bottom")])
    return fx.trace(scene, until=fx.displacement(0.05, at=(0, 0)), progress=False)


@pytest.mark.parametrize("outline, area", [
    (fx.mesh.rectangle(1.0, 0.8), 0.8), (fx.mesh.circle(0.6), np.pi * 0.36),
    ([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], 1.0), (fx.mesh.rectangle(1.0, 0.8, part="quarter"), 0.8)])
def test_area_inside_the_outline(path, outline, area):
    """The sheet is nearly flat, so the part has the area of the outline; its weight follows."""
    part, whole = path.part(trim=outline), path.part()
    assert part.area == pytest.approx(area, rel=0.02) and part.volume == pytest.approx(0.01 * area, rel=0.02)
    assert part.scrap == pytest.approx(1 - part.volume / whole.volume, rel=1e-9)


def test_outlines_that_are_refused(path):
    for trim, text in (([(0, 0), (1, 1)], "at least three corners"),
                       ([(5, 5), (6, 5), (6, 6)], "does not contain any node"), (3.0, "or an outline")):
        with pytest.raises(fx.InputError, match=text):
            path.part(trim=trim)
