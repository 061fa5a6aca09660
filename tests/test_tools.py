"""Signed distance and normal of every tool against brute force; what a profile may not be."""

import numpy as np
import pytest

import formingx as fx
from formingx.physics.tools import Line

tools = fx.tools
SHAPES = {
    "plane": tools.plane(0.3),
    "cup": tools.cup(radius=10, depth=5, mouth=0.3, fillet=1),
    "cup with draft and lip": tools.cup(radius=3, depth=6, draft=5, fillet=0.7, lip=0.4),
    "sharp cup": tools.cup(radius=1, depth=0.5),
    "cup with a round floor": tools.cup(radius=1, depth=1.5, fillet=1),
    "male": tools.male(radius=2, height=3, draft=4, fillet=0.5, foot=0.3),
    "bottle": tools.bottle(radius=3, height=8, neck=1.2, shoulder=2, neck_height=1.5, fillet=0.6, shoulder_fillet=0.8),
    "cylinder": tools.cylinder(radius=1.5, z=0.2, fillet=0.3),
    "cone": tools.cone(half_angle=30, z=-0.5, tip=0.4),
    "sharp cone": tools.cone(half_angle=50, z=0.1),
    "sphere": tools.sphere(radius=1.3, z=0.2),
    "mirrored": tools.male(radius=2, height=3, fillet=0.5).mirrored().moved(z=5),
    "turned": tools.Tool([(1, 0), (3, 0.5), (2.5, 2), (1.2, 1.5)], fillets=[0.1, 0.2, 0.0, 0.3],
                         closed=True).turned(20),
    "long": tools.Tool([(0.5 * k, 0.3 * (k % 2)) for k in range(40)], fillets=0.05),
}


def polygon(tool):
    """The solid as a fine polygon, and points along its profile; open ends go on far."""
    line = tool.outline(8000 if len(tool.pieces) == 1 else 4000)       # sagitta of a chord below 1e-7
    if tool.closed:
        return line, line
    left = []
    far = 50 * tool.size
    ends = [(line[0], line[0] - line[1]), (line[-1], line[-1] - line[-2])]
    for k, (point, out) in enumerate(ends):
        out = out / np.hypot(*out)
        on_axis = abs(point[0]) < 1e-12 and abs(out[1]) > 1e-6
        if not on_axis:
            new = point + far * out
            line = np.vstack([new, line]) if k == 0 else np.vstack([line, new])
        travel = -out if k == 0 else out
        end = line[0] if k == 0 else line[-1]
        left.append(end + 4 * far * np.array([-travel[1], travel[0]]))
    return np.vstack([line, left[1], left[0]]), line


def inside(points, corners):
    """Even-odd rule."""
    a, b = corners, np.roll(corners, -1, axis=0)
    x, y = points.T[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = ((a[:, 1] > y) != (b[:, 1] > y)) & (x < a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0])
                                                       / (b[:, 1] - a[:, 1]))
    return crossing.sum(1) % 2 == 1


def distance_to(points, line):
    """To a polyline, segment by segment."""
    best = np.full(len(points), np.inf)
    for a, b in zip(line, line[1:]):
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.hypot(*(points - a - t[:, None] * (b - a)).T))
    return best


@pytest.mark.parametrize("name", SHAPES)
def test_distance_against_brute_force(name):
    tool = SHAPES[name]
    low, high = tool.outline().min(0) - 0.4 * tool.size, tool.outline().max(0) + 0.4 * tool.size
    points = np.random.default_rng(3).uniform([max(low[0], 1e-3), low[1]], high, (300, 2))
    corners, line = polygon(tool)
    signed = distance_to(points, line) * np.where(inside(points, corners), 1, -1)
    np.testing.assert_allclose(tool.signed_distance(points), signed, atol=2e-7 * tool.size)


@pytest.mark.parametrize("name", SHAPES)
def test_normal_and_curvature_are_derivatives_of_distance(name):
    tool, h = SHAPES[name], 1e-5
    outline = tool.outline(7)
    middle = np.repeat((outline[1:] + outline[:-1]) / 2, 9, axis=0)        # no joint: there the curvature jumps
    rng = np.random.default_rng(4)
    points = middle + 0.02 * tool.size * rng.uniform(-1, 1, middle.shape) * (middle[:, :1] > 0)
    near = tool.nearest(points)
    same = np.ones(len(points), bool)
    gradient, second = np.zeros((2, len(points), 2))[0], np.zeros((len(points), 2, 2))
    for i, e in enumerate(np.eye(2)):
        plus, minus = tool.nearest(points + h * e), tool.nearest(points - h * e)
        same &= np.abs(plus.normal - minus.normal).max(1) < 1e-2      # no ridge of the distance in between
        gradient[:, i] = (plus.distance - minus.distance) / (2 * h)
        second[:, :, i] = (plus.normal - minus.normal) / (2 * h)
    assert same.mean() > 0.9
    smooth = same & (np.abs(near.distance) > 1e-3 * tool.size)
    exact = near.curvature[:, None, None] * np.einsum("ni,nj->nij", near.tangent, near.tangent)
    np.testing.assert_allclose(gradient[smooth], near.normal[smooth], atol=1e-6)
    joints = np.abs(second - exact).max((1, 2)) > 1e-4 * (1 + np.abs(near.curvature))
    assert joints[smooth].mean() < 0.05


def test_gmsh_curves(tmp_path):
    file = tmp_path / "mould.geo"
    file.write_text("""
        Point(1) = {0, 5, 0}; Point(2) = {9, 5, 0}; Point(3) = {9, 4, 0}; Point(4) = {10, 4, 0}; Point(5) = {10, 0, 0};
        Line(1) = {1, 2}; Circle(2) = {2, 3, 4}; Line(3) = {5, 4};
    """)
    tool, same = tools.read(file, [1, 2, -3]), tools.cup(radius=10, depth=5, fillet=1)
    points = np.random.default_rng(1).uniform([0, 1.5], [12, 7], (100, 2))
    np.testing.assert_allclose(tool.signed_distance(points), same.signed_distance(points), atol=1e-12)
    with pytest.raises(fx.InputError, match="no curve 7"):
        tools.read(file, [7])
    (tmp_path / "bad.geo").write_text("Point(1) = {0,")
    with pytest.raises(fx.InputError, match="cannot be read"):
        tools.read(tmp_path / "bad.geo", [1])


@pytest.mark.parametrize("kind", ["brep", "step", "msh"])
def test_gmsh_models(tmp_path, kind):
    """Arcs stay arcs in CAD files, and in a mesh, whose nodes lie on them."""
    import gmsh
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        points = [occ.addPoint(*x, 0) for x in ((0, 5), (9, 5), (9, 4), (10, 4), (10, 0))]
        occ.addLine(*points[:2]), occ.addCircleArc(*points[1:4]), occ.addLine(*points[3:])
        occ.addCircle(0, 3, 0, 1), occ.addEllipse(0, 0, 0, 2, 1)
        occ.synchronize()
        if kind == "msh":
            gmsh.model.mesh.setSize(gmsh.model.getEntities(0), 0.4)
            gmsh.model.mesh.generate(1)
        gmsh.write(str(tmp_path / f"mould.{kind}"))
    finally:
        gmsh.finalize()
    file = tmp_path / f"mould.{kind}"
    points = np.random.default_rng(1).uniform([0, 1.5], [12, 7], (100, 2))
    tool, same = tools.read(file, [1, 2, 3]), tools.cup(radius=10, depth=5, fillet=1)
    np.testing.assert_allclose(tool.signed_distance(points), same.signed_distance(points), atol=1e-12)
    ball = tools.read(file, [4], closed=True)
    np.testing.assert_allclose(ball.signed_distance(points), tools.sphere(radius=1, z=2).signed_distance(points),
                               atol=1e-12)
    with pytest.raises(fx.InputError, match="curve 5 is neither a straight line nor a circular arc"):
        tools.read(file, [5])


@pytest.mark.parametrize("build, message", [
    (lambda: tools.cup(radius=1, depth=0.5, fillet=0.6), "too large for its corner"),
    (lambda: tools.Tool([(0, 0), (2, 0), (2, 1), (1, -1)]), "crosses itself"),
    (lambda: tools.Tool([(0, 0)]), "at least 2"),
    (lambda: tools.Tool([(0, 0), (0, 0), (1, 0)]), "are the same"),
    (lambda: tools.Tool([(0, 0), (1, 0), (1, 1)], fillets=[0, -1, 0]), "must not be negative"),
    (lambda: tools.Tool([(1, 0), (2, 0), (2, 1)], fillets=[0.1, 0, 0]), "no corner to round"),
    (lambda: tools.Tool([(0, 0), (1, 1)], fillets=0.1), "fillets = 0.1: the profile has no corner to round"),
    (lambda: tools.Tool([(0, 0), (1, 0), (2, 0)], fillets=0.1), "fillets = 0.1: the profile has no corner to round"),
    (lambda: tools.Tool([(0, 0), (1, 1)], fillets=-0.1), "fillets = -0.1: must not be negative"),
    (lambda: tools.Tool([(0, 0), (1, 0)], fillets=[0.1, 0]), "point 0 = 0.1: the profile runs straight on"),
    (lambda: tools.Tool([(0, 0), (1, 0), (2, 0), (2, 1)], fillets=[0, 0.1, 0.2, 0]), "point 1 = 0.1: .* straight on"),
    (lambda: tools.Tool.of_pieces([Line(np.zeros(2), np.ones(2)), Line(np.zeros(2), np.ones(2))]),
     "follow one another"),
    (lambda: tools.cup(radius=1, depth=5, draft=20), "leaves no floor"),
    (lambda: tools.cone(half_angle=90), "below 90"),
    (lambda: tools.bottle(radius=1, height=1, neck=2, shoulder=1, neck_height=1), "below radius"),
])
def test_bad_profiles(build, message):
    with pytest.raises(fx.InputError, match=message):
        build()
