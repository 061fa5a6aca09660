"""Smooth surfaces of tools from STL and STEP files: distance, normal and curvature against exact shapes."""

import sys

import numpy as np
import pytest
from conftest import ROOT

import formingx as fx
from formingx.extensions.space import solid_tool
from formingx.extensions.space.triangulated import Triangulated
from formingx.io.stl import write_stl
from formingx.mesh import with_gmsh


def grid(position, n, m):
    """Points and triangles of a grid n by m that is closed in both directions, without doubled points."""
    u, v = np.meshgrid(np.arange(n + 1) / n, np.arange(m + 1) / m, indexing="ij")
    points = np.array(position(u.ravel(), v.ravel())).T
    row = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    a, b, c, d = (part.ravel() for part in (row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]))
    _, first, same = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    triangles = same.ravel()[np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])]
    kept = (triangles != np.roll(triangles, 1, axis=1)).all(1)
    return points[first], triangles[kept]


def ball(n, radius=1.0):
    """A sphere of 4 n^2 triangles, uneven: they are small at the poles."""
    def position(u, v):
        s = np.round(np.sin(np.pi * u), 12)
        return radius * s * np.cos(2 * np.pi * v), radius * s * np.sin(2 * np.pi * v), radius * np.cos(np.pi * u)
    return grid(position, n, 2 * n)


def torus(n):
    return grid(lambda u, v: ((1 + 0.4 * np.cos(2 * np.pi * v)) * np.cos(2 * np.pi * u),
                              (1 + 0.4 * np.cos(2 * np.pi * v)) * np.sin(2 * np.pi * u), 0.4 * np.sin(2 * np.pi * v)),
                2 * n, n)


def revolved(line, n):
    """The solid that a polyline (r, z) from axis to axis bounds, upwards."""
    line = np.asarray(line, float)

    def position(u, v):
        r, z = (np.interp(v * (len(line) - 1), np.arange(len(line)), line[:, k]) for k in (0, 1))
        return r * np.cos(2 * np.pi * u), r * np.sin(2 * np.pi * u), z
    return grid(position, n, len(line) - 1)


def of_ball(x):
    return 1 - np.linalg.norm(x, axis=1)


def of_torus(x):
    return 0.4 - np.hypot(np.hypot(*x[:, :2].T) - 1, x[:, 2])


def of_profile(line):
    profile = fx.Tool(line)
    return lambda x: profile.signed_distance(np.column_stack([np.hypot(*x[:, :2].T), x[:, 2]]))


CYLINDER, CONE = [(0, 0), (0.5, 0), (0.5, 2), (0, 2)], [(0, 0), (0.7, 0), (0, 1)]
SHAPES = {"ball": (lambda n: ball(n), of_ball, 2.5e-4), "torus": (lambda n: torus(2 * n), of_torus, 7e-4),
          "cylinder": (lambda n: revolved(CYLINDER, 2 * n), of_profile(CYLINDER), 3e-4),
          "cone": (lambda n: revolved(CONE, 2 * n), of_profile(CONE), 1.5e-3)}


def points_near(distance, n=3000, band=0.15, extent=1.6):
    x = np.random.default_rng(5).uniform(-extent, extent, (40 * n, 3))
    return x[np.abs(distance(x)) < band][:n]


@pytest.mark.parametrize("name", SHAPES)
def test_distance_to_triangles_of_a_smooth_shape_converges(name):
    """Patches are nearer to the shape than flat triangles, by a factor that grows; so are normals."""
    make, exact, bound = SHAPES[name]
    x, errors = points_near(exact), []
    for n in (8, 16):
        smooth, flat = (Triangulated(*make(n), name, crease=crease) for crease in (40.0, 0.0))
        error, of_flat = (np.abs(tool.signed_distance(x) - exact(x)).max() for tool in (smooth, flat))
        assert error < of_flat / (4 if name == "cone" else 10)    # one triangle reaches from tip to base
        errors.append(error)
    assert errors[0] < 16 * bound and errors[1] < bound and errors[1] < errors[0] / 4


@pytest.mark.parametrize("crease", [40.0, 0.0])
@pytest.mark.parametrize("name", SHAPES)
def test_normal_and_hessian_are_derivatives_of_the_distance(name, crease):
    make, exact, _ = SHAPES[name]
    tool, x, e = Triangulated(*make(8), name, crease=crease), points_near(exact, 500), 1e-6
    found = tool.distances(x)
    np.testing.assert_allclose(found.distance, tool.signed_distance(x), atol=1e-14)
    normal = np.column_stack([(tool.signed_distance(x + h) - tool.signed_distance(x - h)) / (2 * e)
                              for h in e * np.eye(3)])
    hessian = np.stack([(tool.distances(x + h).normal - tool.distances(x - h).normal) / (2 * e)
                        for h in e * np.eye(3)], 2)
    size = np.maximum(1, np.abs(hessian).max((1, 2)))
    assert np.quantile(np.abs(normal - found.normal).max(1), 0.99) < 1e-7         # a few lie where two patches meet
    assert np.quantile(np.abs(hessian - found.hessian).max((1, 2)) / size, 0.98) < 2e-3


def test_curvature_of_a_sphere():
    tool, x = Triangulated(*ball(16), "ball"), points_near(of_ball, 500)
    r = np.linalg.norm(x, axis=1)[:, None, None]
    exact = -(np.eye(3) - x[:, :, None] * x[:, None] / r**2) / r
    assert np.abs(tool.distances(x).hessian - exact).max() < 0.05


def test_flat_faces_of_a_box_are_exact_and_its_edges_are_sharp(tmp_path):
    points = np.array(np.meshgrid([0, 2], [0, 1], [0, 1], indexing="ij"), float).reshape(3, -1).T
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    write_stl(points, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]), tmp_path / "box.stl")
    tool, x = fx.tools.solid(tmp_path / "box.stl"), np.random.default_rng(1).uniform(-1, 3, (2000, 3))
    off = np.maximum(-x, x - (2, 1, 1))
    exact = -(np.linalg.norm(np.maximum(off, 0), axis=1) + np.minimum(off.max(1), 0))
    np.testing.assert_allclose(tool.signed_distance(x), exact, atol=1e-12)


@pytest.fixture(scope="module")
def trays(tmp_path_factory):
    """A box tray with a lip, exact, and its STL file of some pieces an arc."""
    folder, patch = tmp_path_factory.mktemp("trays"), pytest.MonkeyPatch()
    exact, outline = fx.tools.box(half=(1.0, 1.5), depth=1.0, corner=0.3, fillet=0.2, lip=0.1), fx.Tool.outline
    for n in (8, 24):
        with patch.context() as changed:
            changed.setattr(solid_tool, "_CORNER_PIECES", n)
            changed.setattr(fx.Tool, "outline", lambda self, n=n: outline(self, n))
            exact.to_stl(folder / f"{n}.stl", wall=0.3)
    return exact, folder


@pytest.mark.parametrize("n, bound", [(8, 4e-4), (24, 4e-5)])
def test_stl_file_of_a_tray_is_as_smooth_as_the_tray(trays, n, bound):
    """Planes, cylinders, spheres, tori and the edges between them: distance, sign and normal."""
    exact, folder = trays
    rng, tool = np.random.default_rng(0), fx.tools.solid(folder / f"{n}.stl")
    flat = fx.tools.solid(folder / f"{n}.stl", crease=0)
    x = rng.uniform((-1.3, -1.8, -1.05), (1.3, 1.8, 0.05), (9000, 3))
    x = x[np.abs(exact.signed_distance(x)) < 0.1]
    for _ in range(3):
        found = exact.distances(x)
        x = x - found.distance[:, None] * found.normal
    x += rng.uniform(-0.01, 0.01, (len(x), 1)) * exact.distances(x).normal
    found, given = tool.distances(x), exact.distances(x)
    assert np.abs(found.distance - given.distance).max() < bound
    assert np.abs(flat.signed_distance(x) - given.distance).max() > 5 * bound
    assert np.quantile(np.degrees(np.arccos(np.clip((found.normal * given.normal).sum(1), -1, 1))), 0.99) < 0.3
    assert not any(surface.unresolved.any() for surface in tool.surfaces)


def test_distances_of_a_step_file_and_its_unit(tmp_path):
    with with_gmsh.model("torus", {"General.NumThreads": 1.0}) as gmsh:
        gmsh.model.occ.addTorus(0, 0, 0, 1, 0.4)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "torus.step"))
    x = points_near(of_torus)
    tool = fx.tools.solid(tmp_path / "torus.step")
    assert np.abs(tool.signed_distance(x) - of_torus(x)).max() < 1e-4
    inches = fx.tools.solid(tmp_path / "torus.step", scale=1 / 25.4, angle=30.0)
    assert np.abs(25.4 * inches.signed_distance(x / 25.4) - of_torus(x)).max() < 1e-3
    flat = fx.tools.solid(tmp_path / "torus.step", crease=0)
    assert 1e-3 < np.abs(flat.signed_distance(x) - of_torus(x)).max() < 1e-2
    (tmp_path / "no.step").write_text("ISO-10303-21;")
    with pytest.raises(fx.InputError, match=r"no\.step'.*(contains no solid|cannot read)"):
        fx.tools.solid(tmp_path / "no.step")


def test_step_file_of_a_cone_has_its_tip(tmp_path):
    """Curvature grows without bound at the tip, where gmsh without a least size would not end."""
    with with_gmsh.model("cone", {"General.NumThreads": 1.0}) as gmsh:
        gmsh.model.occ.addCone(0, 0, 0, 0, 0, 1, 0.7, 0)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "cone.stp"))
    exact = of_profile(CONE)
    x = points_near(exact, band=0.1)
    assert np.abs(fx.tools.solid(tmp_path / "cone.stp").signed_distance(x) - exact(x)).max() < 1e-3


def test_surface_of_uneven_triangles(tmp_path):
    """A sphere whose vertices lie at random, so that its triangles have all angles."""
    from scipy.spatial import ConvexHull
    points = np.random.default_rng(7).normal(size=(600, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    hull = ConvexHull(points)
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    out = np.einsum("ni,ni->n", np.cross(b - a, c - a), a + b + c) > 0
    triangles = np.where(out[:, None], hull.simplices, hull.simplices[:, ::-1])
    x = points_near(of_ball, extent=1.2)
    smooth, flat = (Triangulated(points, triangles, "ball", crease=crease) for crease in (60.0, 0.0))
    error, of_flat = (np.abs(tool.signed_distance(x) - of_ball(x)).max() for tool in (smooth, flat))
    assert error < 5e-4 and of_flat > 20 * error


@pytest.mark.thorough
def test_two_hundred_thousand_triangles():
    tool = Triangulated(*ball(224), "ball")
    assert tool.triangles > 199_000
    x = points_near(of_ball)
    assert np.abs(tool.signed_distance(x) - of_ball(x)).max() < 1e-9


@pytest.mark.thorough
def test_points_far_outside_are_outside_of_patches_that_fold(tmp_path):
    """A ribbed mould on a grid of heights: its edges cross the triangles; the sign is that of the flat triangles."""
    sys.path.insert(0, str(ROOT / "demos"))
    from ribbed_tray import write_mould
    write_mould(tmp_path / "mould.stl", 1.25)
    smooth, flat = (fx.tools.solid(tmp_path / "mould.stl", crease=crease) for crease in (40, 0))
    x = np.vstack([[-38.4535, -23.0402, -14.6867], np.random.default_rng(0).uniform(-30, 30, (300, 3))])
    assert np.abs(smooth.signed_distance(x) - flat.signed_distance(x)).max() < 1.0


def egg(seed, n, crease):
    """A closed surface of long uneven triangles, dented, on which patches fold."""
    from scipy.spatial import ConvexHull
    points = np.random.default_rng(seed).normal(size=(n, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    hull = ConvexHull(points)
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    out = np.einsum("ni,ni->n", np.cross(b - a, c - a), a + b + c) > 0
    triangles = np.where(out[:, None], hull.simplices, hull.simplices[:, ::-1])
    return Triangulated(points * (1 + 0.3 * np.cos(5 * points[:, :1])), triangles, "egg", crease=crease)


def test_points_far_inside_are_inside_of_patches_that_fold():
    """Patches and flat triangles have the same sign farther from a surface than twice the largest bulge."""
    x, found = np.random.default_rng(1).uniform(-1.4, 1.4, (20000, 3)), 0
    for seed, n, crease in ((16, 80, 40.0), (14, 150, 40.0), (21, 250, 20.0)):
        (surface,) = egg(seed, n, crease).surfaces
        d, flat = surface.distance(x), surface._flat.distance(x)
        far, folds = np.abs(d) > 2 * surface._bulges.max(), surface._folds[surface.nearest_triangles(x)]
        assert not (far & (d * flat < 0)).any()
        found += (far & folds).sum()
    assert found > 0


@pytest.mark.parametrize("depth, crosses", [(1.2, False), (1.9, True)])
def test_surface_that_passes_through_itself_is_refused(depth, crosses, tmp_path):
    """A ball whose lower part is pushed up into it: a dent, or through its upper part."""
    points, triangles = ball(12)
    points[points[:, 2] < -0.8] += [0.03, 0.01, depth]
    write_stl(points, triangles, tmp_path / "dent.stl")
    if crosses:
        with pytest.raises(fx.InputError, match=r"'.*dent.stl' passes through itself at .* an edge by .* at \("):
            fx.tools.solid(tmp_path / "dent.stl")
    else:
        assert fx.tools.solid(tmp_path / "dent.stl").triangles == len(triangles)


@pytest.mark.parametrize("option, text", [
    ({"crease": -1}, "crease = -1.*0 to less than 90"), ({"crease": 100}, "crease = 100"),
    ({"scale": 0}, "scale"), ({"angle": 0}, "angle = 0"), ({"size": -1}, "size")])
def test_options_of_solid(option, text, tmp_path):
    file = tmp_path / ("a.step" if {"angle", "size"} & set(option) else "a.stl")
    with pytest.raises(fx.InputError, match=text):
        fx.tools.solid(file, **option)
