"""Tools that are made of several parts: one contact, distances, filling and forces by part."""

import re

import numpy as np
import pytest

import formingx as fx
from formingx.contact.tooling import tool_of
from formingx.results.files.description import plain

HELD = [fx.SimplySupported("rim"), fx.Symmetry("x0", "x"), fx.Symmetry("y0", "y")]
BOX = fx.tools.box(half=(1.0, 1.4), depth=0.6, corner=0.4, fillet=0.3, lip=0.1)
RIB = fx.tools.extruded(fx.Tool([(0.3, -0.7), (0.1, -0.3), (-0.1, -0.3), (-0.3, -0.7)], [0.0, 0.08, 0.08, 0.0]), "x")


def form(friction):
    sheet = fx.mesh.sheet(fx.mesh.rectangle(2.0, 2.8, corner=0.4, part="quarter"), size=0.13)
    tool = fx.tools.union(BOX, RIB, names=["box", "rib"])
    scene = fx.Scene(mesh=sheet, thickness=0.02, materials=fx.NeoHookean(c10=1.0), supports=HELD,
                     loads=[fx.Pressure("top")], model=fx.Membrane(wrinkles=0.01),
                     contacts=[fx.Contact("bottom", tool, friction, name="mould")])
    return fx.trace(scene, until=fx.pressure(0.3), progress=False), tool


def test_distance_to_parts_is_the_nearest(tmp_path):
    tool, x = fx.tools.union(BOX, RIB.moved(z=0.1)).moved(x=0.2), np.random.default_rng(2).uniform(-1, 1, (500, 3))
    apart = [BOX.moved(x=0.2), RIB.moved(x=0.2, z=0.1)]
    each = [part.distances(x) for part in apart]
    found = tool.distances(x)
    np.testing.assert_allclose(found.distance, np.maximum(each[0].distance, each[1].distance), atol=1e-14)
    nearest = np.argmax([part.distance for part in each], axis=0)
    np.testing.assert_array_equal(tool.nearest_parts(x), nearest)
    np.testing.assert_allclose(found.normal, np.where(nearest[:, None] == 0, each[0].normal, each[1].normal))
    assert len(set(nearest)) == 2 and tool.names == ["part 1", "part 2"]
    for each in (tool, fx.tools.union(BOX, RIB, fillet=0.2)):
        np.testing.assert_allclose(tool_of(plain(each)).signed_distance(x), each.signed_distance(x), atol=1e-14)
    points, triangles = tool.surface()
    assert len(points) == sum(len(part.surface()[0]) for part in apart) and triangles.max() == len(points) - 1


def test_normal_and_hessian_at_a_fillet_are_derivatives_of_the_distance():
    tool, e = fx.tools.union(BOX, RIB, fillet=0.2), 1e-6
    x = np.random.default_rng(3).uniform((0.1, -1.0, -0.6), (0.6, 1.0, -0.3), (300, 3))
    found = tool.distances(x)
    normal, hessian = (np.stack([(value(x + h) - value(x - h)) / (2 * e) for h in e * np.eye(3)], -1)
                       for value in (tool.signed_distance, lambda x: tool.distances(x).normal))
    assert (np.abs(hessian).max((1, 2)) > 2).mean() > 0.1                     # in the fillet
    assert np.quantile(np.abs(normal - found.normal).max(1), 0.97) < 1e-7     # a few lie where two arcs meet
    assert np.quantile(np.abs(hessian - found.hessian).max((1, 2)), 0.97) < 1e-5


@pytest.mark.parametrize("parts, options, text", [
    ([BOX], {}, "1 parts"), ([BOX, fx.tools.plane(0.0)], {}, "a tool in three dimensions"),
    ([BOX, RIB], {"names": ["a"]}, "one for each of the 2"), ([BOX, RIB], {"names": ["a", "a"]}, "each another")])
def test_unions_that_are_refused(parts, options, text):
    with pytest.raises(fx.InputError, match=text):
        fx.tools.union(*parts, **options)


@pytest.mark.parametrize("friction", ["stick", *(pytest.param(mu, marks=pytest.mark.thorough) for mu in (0.2, "none"))])
def test_no_point_of_the_sheet_lies_inside_a_part(friction):
    """Of two contacts with one face, one would hold the points that the other should stop."""
    path, tool = form(friction)
    deepest = tool.signed_distance(path.wall().deformed_points).max()
    assert deepest < 1e-3 and tool.nearest_parts(path.wall().deformed_points).any()
    filling = path.filling("mould")
    box, rib = (filling.parts[name] for name in ("box", "rib"))
    np.testing.assert_allclose(box[0] + rib[0], filling.touching, atol=1e-12)
    assert rib[0][-1] > 0.03 and filling.gap[-1] < 0.1
    np.testing.assert_allclose(4 * (box[1] + rib[1])[-1, 2], path["tool_force"][-1], rtol=1e-8)
    assert filling.columns["rib_force"][-1] < 0


@pytest.mark.thorough
def test_report_names_the_parts_of_tools(tmp_path, monkeypatch):
    """The report has a row for each part of a union, with its share of the contact and the force on it."""
    monkeypatch.setattr("formingx.extensions.space.show.view", lambda *arguments: None)
    path, _ = form("stick")
    text = path.report(tmp_path / "report.html").read_text()
    table = text[text.index("<h2>Parts of tools</h2>"):].split("</table>")[0]
    rows = [re.sub("<[^>]*>", " ", row).split() for row in table.split("<tr>") if "mould" in row]
    assert [row[:3] for row in rows] == [["mould", "box", "run"], ["mould", "rib", "run"]]
    shares, forces = ([float(row[k].rstrip("%")) for row in rows] for k in (3, 4))
    filling = path.filling("mould")
    assert sum(shares) == pytest.approx(100 * filling.touching[-1], abs=0.11)
    assert sum(forces) == pytest.approx(path["tool_force"][-1], rel=1e-3)
    assert forces[1] == pytest.approx(4 * filling.columns["rib_force"][-1], rel=1e-3)
