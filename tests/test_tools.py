"""Signed distance and normal of every tool against brute force; what a profile may not be."""

from pathlib import Path

import numpy as np
import pytest

import formingx as fx
from formingx.tools.shapes import Arc, Line

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
    "clamp ring": tools.clamp_ring(radius=1.5, width=2.0, fillet=0.3, z=0.1),
    "thick clamp ring, below": tools.clamp_ring(radius=1.5, width=2.0, fillet=0.3, height=1.0).mirrored(),
    "mirrored": tools.male(radius=2, height=3, fillet=0.5).mirrored().moved(z=5),
    "turned": tools.Tool([(1, 0), (3, 0.5), (2.5, 2), (1.2, 1.5)], fillets=[0.1, 0.2, 0.0, 0.3],
                         closed=True).turned(20),
    "cup with a stacking step": tools.cup(radius=3, depth=6, draft=5, fillet=0.7, lip=0.4).with_piece(
        [(3 - 1.5 * np.tan(np.radians(5)), 1.5), (3.4, 1.5), (3.4, 0)], [0.1, 0.2, 0.3]),
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


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[pytest.mark.thorough] * (name == "long")) for name in SHAPES])
def test_distance_against_brute_force(name):
    tool = SHAPES[name]
    low, high = tool.outline().min(0) - 0.4 * tool.size, tool.outline().max(0) + 0.4 * tool.size
    points = np.random.default_rng(3).uniform([max(low[0], 1e-3), low[1]], high, (300, 2))
    corners, line = polygon(tool)
    signed = distance_to(points, line) * np.where(inside(points, corners), 1, -1)
    np.testing.assert_allclose(tool.signed_distance(points), signed, atol=2e-7 * tool.size)


def test_behind_an_arc_with_an_open_end_there_is_a_distance_too():
    """A tool of the other half plane, whose tip is round: what lies beside the tip, and within no piece's reach."""
    tool = fx.tools.Tool([(0.0, 0.0), (-2.0, -2.0)], [0.1, 0])
    near = tool.nearest(np.random.default_rng(0).uniform(-2, 2, (200, 2)))
    assert np.all(np.isfinite(near.distance))
    np.testing.assert_allclose(np.hypot(*near.normal.T), 1.0, rtol=1e-12)


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


def hostile(marker):
    """Scripts that would leave a file behind if gmsh had them."""
    order = f'SystemCall "touch {marker}";'
    return {"geo": order, "geo 2": f"Point(1) = {{0, 0, 0}}; {order}", "geo 3": f'Mesh.X = StrCat("a"); {order}',
            "geo 4": f'x = 1; If (x) {order} EndIf', "geo 5": f'Physical Curve("a") = {{1}}; {order}',
            "geo 6": 'Merge "other.geo";', "geo 7": f"x = __import__('os').system('touch {marker}');",
            "geo 8": f"Mesh.Algorithm = 6 {order}", "geo 9": f'Macro a {order} Return Call a;',
            "step": order, "stp": f"// {order}\n" + order, "brep": order, "msh": order, "gz": order,
            "msh 2": f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{order}"}


@pytest.mark.parametrize("kind", hostile(""))
def test_files_are_not_executed(tmp_path, kind):
    marker, file = tmp_path / "it ran", tmp_path / f"tool.{kind.split()[0]}"
    (tmp_path / "other.geo").write_text(hostile(marker)["geo"])
    file.write_text(hostile(str(marker).replace(" ", r"\ "))[kind])
    with pytest.raises(fx.InputError, match="file '.*tool"):
        tools.read(file, [1])
    assert not marker.exists()


@pytest.mark.parametrize("text, words", [
    ("Point(1) = {0,", "line 1: 'Point.1. = .0,': is not allowed: a tool's .geo file may hold points"),
    ("\n\nx = y + 1;", "line 3.*'y' is not a number, nor a name"), ("x = 9^9^9^9^9;", "line 1.*out of range"),
    ("x = " + "(" * 400 + "1" + ")" * 400 + ";", "line 1"), ("Point(1) = {0, 0, 2};", "must be .x, y, 0."),
    ("Point(1) = {1/0, 0, 0};", "zero"), ("Line(1) = {1, 2};", "there is no point 1"),
    ("Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {3, 0, 0}; Circle(1) = {1, 2, 3};",
     "the ends are 1 and 2 away from the centre"),
    ("Point(0.5) = {0, 0, 0};", "no number of a point"), ("x = (-1)^0.5;", "root of a negative")])
def test_bad_drawings(tmp_path, text, words):
    (tmp_path / "bad.geo").write_text(text)
    with pytest.raises(fx.InputError, match=words):
        tools.read(tmp_path / "bad.geo", [1])


def test_drawing_with_names_and_loops(tmp_path):
    """What gmsh users write around the curves is passed over; numbers have names."""
    (tmp_path / "plug.geo").write_text("""
        SetFactory("OpenCASCADE"); /* a plug;
        in mm */ r = 2*Sqrt(4) - 1; h = r^2/3;   // r = 3, h = 3
        Point(1) = {0, h, 0, 0.1}; Point(2) = {r, h, 0, 0.1}; Line(1) = {1, 2}; Circle(7) = {0, r, 0, 1.5, 0, Pi};
        Curve Loop(1) = {1}; Plane Surface(1) = {1}; Physical Curve("face", 3) = {1}; Mesh.MeshSizeMax = 0.1;
        MeshSize {1, 2} = 0.1;""")
    assert repr(tools.read(tmp_path / "plug.geo", [-1])) == "Tool(1 line from (3, 3) to (0, 3))"
    arc = tools.read(tmp_path / "plug.geo", [-7]).pieces[0]
    assert arc.radius == 1.5 and arc.sweep == pytest.approx(-np.pi) and arc.ends[0] == pytest.approx([-1.5, 3])


@pytest.mark.parametrize("arguments, words", [
    (("no.geo", [1]), "not there"), ((3, [1]), "must be the name"), (("a.dwg", [1]), "not there|ending"),
    (("a.geo", 1), "must be a list"), (("a.geo", []), "at least one curve"), (("a.geo", ["1"]), "must be a number"),
    (("a.geo", [0]), "at least 1"), (("a.geo", [1.5]), "whole number")])
def test_read_refuses(tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.geo").write_text("x = 1;")
    with pytest.raises(fx.InputError, match=words):
        tools.read(*arguments)


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


def bottle_with_rings(order):
    """A bottle whose neck has two rings of a thread and whose base has a chime."""
    mould = tools.bottle(radius=30.0, height=110.0, neck=12.0, shoulder=20.0, neck_height=20.0, fillet=5.0)
    for z in (138.0, 144.0):
        ring = [(12.0, z - 1.5), (13.2, z - 0.5), (13.2, z + 0.5), (12.0, z + 1.5)]
        mould = mould.with_piece(ring[::order], [0.4, 0.3, 0.2, 0.1][::order])
    return mould.with_piece([(22.0, 0.0), (20.0, 3.0), (0.0, 3.0)][::order], [1.0, 1.0, 0.0][::order])


def test_pieces_are_added_to_a_profile():
    """The bottle is the one whose corners were all given; the order of the points of a piece does not matter."""
    rings = [p for z in (144.0, 138.0)
             for p in ((12.0, z + 1.5), (13.2, z + 0.5), (13.2, z - 0.5), (12.0, z - 1.5))]
    whole = tools.Tool([(12, 150), *rings, (12, 130), (30, 110), (30, 0), (22, 0), (20, 3), (0, 3)],
                       [0, *[0.1, 0.2, 0.3, 0.4] * 2, 0, 0, 5, 1, 1, 0])
    x = np.random.default_rng(7).uniform((0, -5), (35, 160), (400, 2))
    for order in (1, -1):
        built = bottle_with_rings(order)
        assert built.signed_distance(x) == pytest.approx(whole.signed_distance(x), abs=1e-10)
    assert np.ptp(whole.signed_distance(x) - tools.bottle(
        radius=30.0, height=110.0, neck=12.0, shoulder=20.0, neck_height=20.0, fillet=5.0).signed_distance(x)) > 1


@pytest.mark.parametrize("points, fillets, words", [
    ([(31, 4), (32, 0)], 0, r"the point \(31, 4\) is on no line of the profile: the nearest one is \(30, 4\)"),
    ([(30, 4)], 0, "give at least two points"), ([(30, 4), (32, 2), (30, 2)], [1, 1], "3 points and 2 fillets"),
    ([(30, 4), (30, 4)], 0, "the first and the last point are the same"),
    ([(30, 4), (32, 2), (30, 1)], 3, "too large for its corner"),
    ([(30, 4), (25, 30), (30, 1)], 0, "crosses itself")])
def test_pieces_that_are_refused(points, fillets, words):
    with pytest.raises(fx.InputError, match=words):
        tools.cup(radius=30.0, depth=20.0).with_piece(points, fillets)


def test_bounding_boxes_of_tools():
    cup = fx.tools.cup(radius=2.0, depth=1.0, mouth=0.5, fillet=0.2).moved(z=1.0)
    assert cup.bounds == pytest.approx(np.array([[0.0, 1.5], [4.0, 2.5]]))
    ball = fx.tools.sphere(radius=1.0, z=-0.5, r=3.0)
    assert ball.bounds == pytest.approx(np.array([[2.0, -0.5], [4.0, 1.5]]), abs=1e-2)


IN_SPACE = {
    "revolved": tools.revolved(SHAPES["male"]), "extruded": tools.extruded(SHAPES["cup"], along="x"),
    "box": tools.box(half=(6.0, 4.0), depth=2.0, corner=1.5, fillet=0.5, lip=0.2, draft=3).moved(x=1.0, z=-2.0),
}


@pytest.mark.parametrize("name", [*SHAPES, *IN_SPACE])
def test_surface_points_lie_on_the_tool(name):
    """Points on the tool, and pieces between them that cut its corners by no more than their sagitta; its bounds."""
    tool = (SHAPES | IN_SPACE)[name]
    points, pieces = tool.surface()
    size = np.ptp(points, axis=0).max()
    assert points.shape[1] == tool.components == pieces.shape[1] and np.unique(pieces).tolist() == [*range(len(points))]
    assert np.abs(tool.signed_distance(points)).max() < 1e-9 * size
    assert np.abs(tool.signed_distance(points[pieces].mean(1))).max() < 0.02 * size
    np.testing.assert_array_equal(tool.bounds, [points.min(0), points.max(0)])


class TestNearest:
    """The compiled search for closest points where arrays of numbers go wrong first."""

    corner = fx.Tool([(0, 0), (2, 0), (2, 2), (5, 2)])      # sharp: inward at (2, 0), outward at (2, 2)

    def test_coincident_points(self):
        """At joints and corners, on the profile itself, the distance is 0 and the gradient a unit vector."""
        for tool in (self.corner, *SHAPES.values()):
            x = np.array([end for piece in tool.pieces for end in piece.ends])
            near = tool.nearest(x)
            assert np.abs(near.distance).max() < 1e-12 * tool.size
            smooth = np.abs(near.curvature) < 1e9               # on a sharp corner there is no normal
            assert np.hypot(*near.normal[smooth].T) == pytest.approx(1.0, abs=1e-9)

    def test_centre_of_an_arc(self):
        """All points of the arc are equally near: the distance is the radius, every number finite."""
        ball = tools.sphere(radius=1.3, z=0.2)
        arc = next(piece for piece in ball.pieces if isinstance(piece, Arc))
        near = ball.nearest(arc.centre)
        assert near.distance == pytest.approx(1.3, rel=1e-14) and np.isfinite(near.normal).all()

    def test_axis(self):
        """On the axis of a sphere, above, below and far away, the normal is along the axis."""
        z = np.array([1e-9, 2.0, 1e6, 1e150])
        near = tools.sphere(radius=1.3).nearest(np.column_stack([0 * z, z]))
        ball = tools.sphere(radius=1.3)
        middle = next(piece for piece in ball.pieces if isinstance(piece, Arc)).centre[1]
        assert near.distance == pytest.approx(1.3 - np.abs(z - middle), rel=1e-12)
        assert np.abs(near.normal) == pytest.approx(np.tile([0.0, 1.0], (4, 1)), abs=1e-12)

    def test_middle_of_a_corner(self):
        """As near to one side as to the other: the first piece of the profile counts, the same at every call."""
        x = np.array([[2.5, 1.0], [1.0, 1.0]])              # the second one on the bisector of the inward corner
        near = self.corner.nearest(x)
        assert near.distance == pytest.approx([-0.5, 1.0])
        assert np.array_equal(near.normal, self.corner.nearest(x).normal)

    @pytest.mark.parametrize("degrees", range(0, 360, 30))
    def test_fillets_in_all_directions(self, degrees):
        """Angles of an arc go on beyond half a turn, in both senses: the other side of a trapezium is not nearer."""
        solid = fx.Tool([(-3, -1), (3, -1), (1, 1), (-1, 1)], fillets=[0, 0, 0.5, 0.5], closed=True).turned(degrees)
        for tool, sign in ((solid, 1), (solid.reversed(), -1)):
            arcs = [piece for piece in tool.pieces if isinstance(piece, Arc)]
            middle = np.array([piece.start + piece.sweep / 2 for piece in arcs])
            out = np.column_stack([np.cos(middle), np.sin(middle)])
            near = tool.nearest([piece.centre for piece in arcs] + 0.4 * out)
            assert near.distance == pytest.approx(sign * np.full(2, 0.1), rel=1e-12)
            assert near.normal == pytest.approx(-sign * out, abs=1e-12)

    def test_zero_length_and_nearly(self):
        """A piece of length 0 is refused; one of 1e-6 of the profile changes no distance by more than its length."""
        with pytest.raises(fx.InputError, match="no length"):
            fx.Tool.of_pieces([Line((0, 0), (1, 0)), Line((1, 0), (1, 0)), Line((1, 0), (2, 0))])
        ends = [(0, 0), (1, 0), (1 + 2e-6, 0), (2, 0)]
        cut = fx.Tool.of_pieces([Line(*pair) for pair in zip(ends, ends[1:])])
        x = np.random.default_rng(1).uniform(-3, 3, (500, 2))
        assert np.abs(cut.signed_distance(x) - tools.plane(0.0).signed_distance(x)).max() < 1e-12

    def test_not_a_number(self):
        """A point that is not a number has no distance, and spoils no other; no points give none."""
        for tool in (self.corner, *SHAPES.values()):
            good = tool.nearest([[0.3, 0.4], [0.7, -0.2]])
            for bad in ((np.nan, 0.0), (0.0, np.nan), (np.nan, np.nan)):
                near = tool.nearest([[0.3, 0.4], bad, [0.7, -0.2]])
                assert np.isnan(near.distance[1])
                assert all(np.array_equal(a[[0, 2]], b) for a, b in zip(near, good, strict=True))
            assert [part.shape for part in tool.nearest(np.zeros((0, 2)))] == [(0,), (0, 2), (0,)]

    def test_any_array(self):
        """Integers, columns of a larger array and read-only arrays give the same as their copy."""
        whole = np.random.default_rng(2).uniform(-3, 3, (40, 5))
        view = whole[::2, 3:0:-2]
        view.flags.writeable = False
        for x in (view, np.array([[1, 2], [3, -1]]), np.asfortranarray(whole[:, :2])):
            found = SHAPES["bottle"].nearest(x)
            for a, b in zip(found, SHAPES["bottle"].nearest(np.array(x, dtype=float, order="C")), strict=True):
                assert np.array_equal(a, b)


def test_no_compiler(tmp_path, monkeypatch):
    """A compiler that fails says so; nothing is left behind for the next run."""
    from formingx import _jit

    def compiled():
        return _jit.CFunctions("tools/nearest.c").nearest
    monkeypatch.setattr(_jit, "_compiler", lambda: ("false",))
    monkeypatch.setattr(_jit.jit, "get_options", lambda: {"cache_dir": tmp_path})
    with pytest.raises(RuntimeError, match="the C compiler failed, with status 1: false"):
        compiled()
    def interrupted(command, code):
        Path(command[-1]).write_text("half of a library")
        raise KeyboardInterrupt
    with monkeypatch.context() as patch:
        patch.setattr(_jit, "compile_c", interrupted)
        with pytest.raises(KeyboardInterrupt):
            compiled()
    monkeypatch.setattr(_jit, "_compiler", lambda: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(fx.InputError, match="there is no C compiler: install"):
        compiled()
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == []
