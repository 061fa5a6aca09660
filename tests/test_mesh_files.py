"""Mesh files: read as data, equal meshes from all formats of gmsh, messages for damaged files."""

import numpy as np
import pytest

import formingx as fx
from formingx.mesh import boxes, check
from formingx.mesh.boxes import overlapping

SQUARE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 2 "bottom"
1 3 "top"
2 1 "sheet"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
4
1 1 2 2 1 1 2
2 1 2 3 2 3 4
3 2 2 1 1 1 2 3
4 2 2 1 1 1 3 4
$EndElements
"""


def read(tmp_path, text, name="mesh.msh"):
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return fx.mesh.read(tmp_path / name)


def hostile(marker):
    """gmsh scripts that would create a file, at each position in a mesh file."""
    order = f'SystemCall "touch {marker}";\n'
    return {"script": order, "after comments": "// a mesh\n" + order, "before a mesh": order + SQUARE,
            "after a mesh": SQUARE + order, "between sections": SQUARE.replace("$Nodes", order + "$Nodes"),
            "in the nodes": SQUARE.replace("1 0 0 0", order + "1 0 0 0"),
            "in the names": SQUARE.replace('"sheet"', '"sheet"; ' + order.strip()),
            "in the format": SQUARE.replace("2.2 0 8", "2.2 0 8 " + order.strip()),
            "in the elements": SQUARE.replace("1 1 2 2 1 1 2", order + "1 1 2 2 1 1 2"),
            "gmsh options": f'Mesh.SaveAll = 1; NonBlockingSystemCall "touch {marker}";',
            "python": f"Merge \"x.py\"; PrintString StrPrefix('touch {marker}');"}


@pytest.mark.parametrize("kind", hostile(""))
@pytest.mark.parametrize("name", ["mesh.msh", "mesh.txt", "mesh.geo", "mesh"])
def test_files_are_not_executed(tmp_path, kind, name):
    marker = tmp_path / "it ran"
    with pytest.raises(fx.InputError, match="mesh file"):
        read(tmp_path, hostile(str(marker).replace(" ", r"\ "))[kind], name)
    assert not marker.exists()


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("order", [1, 2])
def test_formats_of_gmsh(tmp_path, version, binary, order):
    """Two layers and a curved edge in a file that gmsh wrote."""
    import gmsh
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        lower, upper = occ.addRectangle(0, 0, 0, 2, 1), occ.addDisk(0, 0, 0, 1.5, 1.5)
        (_, parts) = occ.fragment([(2, lower)], [(2, upper)])
        occ.synchronize()
        inside = [e[1] for e in parts[0] if e in parts[1]]
        outside = [e[1] for e in parts[0] if e not in parts[1]]
        gmsh.model.addPhysicalGroup(2, inside, name="inner layer")
        gmsh.model.addPhysicalGroup(2, outside, name="outer")
        rim = [abs(e[1]) for e in gmsh.model.getBoundary([(2, outside[0])])]
        gmsh.model.addPhysicalGroup(1, rim, name="around")
        gmsh.model.addPhysicalGroup(1, rim[:1], name="one of them")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(tmp_path / "mesh.msh"))
        numbers = [len(np.concatenate([gmsh.model.mesh.getElements(2, e)[1][0] for e in part]))
                   for part in (inside, outside)]
    finally:
        gmsh.finalize()
    mesh = fx.mesh.read(tmp_path / "mesh.msh")
    assert [len(mesh.cells.find(mesh.layers[n])) for n in ("inner layer", "outer")] == numbers
    area = sum(_area(rows, fx.mesh.to_grid(mesh).points) for rows in fx.mesh.to_grid(mesh).layers.values())
    assert area == pytest.approx(2.0, rel=1e-9)              # the inner edge is shared, whatever its shape
    assert set(mesh.facets_of("one of them")) < set(mesh.facets_of("around"))


def _area(triangles, x):
    """Area of the corner triangles, and of the curved edges: two thirds of chord times sagitta."""
    a, b, c = (x[triangles[:, k]] for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() / 2
    for i, j, k in ((0, 1, 3), (1, 2, 4), (2, 0, 5)) if triangles.shape[1] == 6 else ():
        p, q, m = x[triangles[:, i]], x[triangles[:, j]], x[triangles[:, k]]
        out = m - (p + q) / 2
        area += 2 / 3 * ((q - p)[:, 1] * out[:, 0] - (q - p)[:, 0] * out[:, 1]).sum()
    return area


def changed(*pairs):
    text = SQUARE
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("binary", [0, 1])
def test_partitions_are_of_their_groups(tmp_path, version, binary):
    """A mesh that gmsh partitioned is read like the mesh without partitions."""
    import gmsh
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addRectangle(0, 0, 0, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="sheet")
        gmsh.model.addPhysicalGroup(1, [1], name="bottom")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.partition(3)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(tmp_path / "mesh.msh"))
    finally:
        gmsh.finalize()
    mesh = fx.mesh.read(tmp_path / "mesh.msh")
    plain = fx.mesh.to_grid(mesh)
    assert _area(plain.layers["sheet"], plain.points) == pytest.approx(2.0, rel=1e-12)
    assert np.ptp(mesh.nodes_of("bottom"), axis=0) == pytest.approx([2.0, 0.0])


QUADS = changed(("4\n1 1 2 2", "3\n1 1 2 2"), ("3 2 2 1 1 1 2 3\n4 2 2 1 1 1 3 4", "3 3 2 1 1 1 2 3 4"))
BAD = {
    "no mesh": ("hello", "does not begin with"), "empty": ("", "does not begin with"),
    "version": (changed(("2.2 0 8", "4.0 0 8")), "must be MSH 2.2 or 4.1"),
    "cut off": (SQUARE[:200], "ends within its section"),
    "unmeshed": (changed((SQUARE[SQUARE.index("$Nodes"):], "")), "no section \\$Nodes: was it meshed"),
    "no elements": (changed((SQUARE[SQUARE.index("$Elements"):], "$Elements\n0\n$EndElements\n")), "was it meshed"),
    "3-D": (changed(("4\n1 1 2 2", "5\n1 1 2 2"), ("$EndElements", "5 4 2 0 1 1 2 3 4\n$EndElements")),
            "three-dimensional"),
    "quads": (QUADS, "group 'sheet' has elements of 4 nodes .*formingx needs triangles of 3 or 6"),
    "triangles and quads": (changed(("4\n1 1 2 2", "5\n1 1 2 2"), ("$EndElements", "5 3 2 1 1 1 2 3 4\n$EndElements")),
                            "formingx needs triangles"),
    "two orders": (changed(("$Nodes\n4", "$Nodes\n7"), ("4 0 1 0\n", "4 0 1 0\n5 .5 0 0\n6 1 .5 0\n7 .5 .5 0\n"),
                           ("3 2 2 1 1 1 2 3", "3 9 2 1 1 1 2 3 5 6 7")), "mixes triangles of 3 and 6"),
    "one surface in two groups": (changed(("4\n1 1 2 2", "6\n1 1 2 2"), ("$EndElements", "5 2 2 9 1 1 2 3\n"
                                          "6 2 2 9 1 1 3 4\n$EndElements")), "belong to more than one layer"),
    "nan": (changed(("3 1 1 0", "3 nan 1 0")), "must be finite"),
    "huge": (changed(("3 1 1 0", "3 1e300 1 0")), "must be between"),
    "no such node": (changed(("1 2 3\n4", "1 2 9\n4")), "a node that is not in"),
    "node twice": (changed(("3 1 1 0", "2 1 1 0")), "stands twice"),
    "too few nodes": (changed(("$Nodes\n4", "$Nodes\n400000000000")), "ends too early"),
    "a fraction of a node": (changed(("1 2 3\n4", "1 2 2.5\n4")), "whole number"),
    "an unknown type": (changed(("3 2 2 1 1 1 2 3", "3 99 2 1 1 1 2 3")), "type 99"),
    "same names": (changed(('"top"', '"bottom"')), "have the same name"),
    "flat": (changed(("3 1 1 0", "3 2 0 0")), "flat"),
    "over each other": (changed(("3 1 1 0", "3 -2 1.5 0")), "over each other|touches or crosses"),
    "an edge inside": (changed(("2 1 2 3 2 3 4", "2 1 2 2 2 2 4")), "is not an edge of an element"),
    "not joined": (changed(("$Nodes\n4", "$Nodes\n6"), ("4 0 1 0\n", "4 0 1 0\n5 0 0 0\n6 1 1 0\n"),
                           ("1 1 3 4\n$End", "1 5 6 4\n$End")), "touches or crosses itself"),
    "in pieces": (changed(("$Nodes\n4", "$Nodes\n7"), ("4 0 1 0\n", "4 0 1 0\n5 3 0 0\n6 4 0 0\n7 4 1 0\n"),
                          ("1 1 3 4\n$End", "1 5 6 7\n$End")), "the body is in pieces: no elements lead from"),
    "an element beyond the count": (changed(("$Elements\n4", "$Elements\n3")), "8 more numbers follow what its counts"),
    "a node beyond the count": (changed(("$Nodes\n4", "$Nodes\n3")), "4 more numbers follow"),
    "a name beyond the count": (changed(("$PhysicalNames\n3", "$PhysicalNames\n2")), "3 names follow the count '2'"),
    "a fraction of a node's number": (changed(("3 1 1 0", "3.5 1 1 0")), "whole number"),
    "underscores": (changed(("3 1 1 0", "3 1_0 1 0")), "must be numbers"),
    "hexadecimal": (changed(("3 1 1 0", "3 0x1 1 0")), "must be numbers"),
    "Arabic digits": (changed(("3 1 1 0", "3 \u0661 1 0")), "must be numbers"),
    "a hole": (changed(("4 2 2 1 1 1 3 4", "4 2 2 0 1 1 3 4")), "of surface 1 are of no physical group, and part"),
    "binary without its mark": (changed(("2.2 0 8", "2.2 1 8")), "must hold the number one"),
    "bytes": (b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n\xff\xfe\x00\n$EndNodes\n$Elements\n$EndElements",
              "must be numbers"),
}


CURVED = """six-node triangles 1
numbering corners
nodes 9
1 0 0
2 1 0
3 1 1
4 0 1
5 .5 0
6 1 .5
7 .5 .5
8 .5 1
9 0 .5
elements 2 sheet
1 1 2 3 5 6 7
2 1 3 4 7 8 9
"""


@pytest.mark.parametrize("old, new, words", [
    ("2 1 3 4 7 8 9", "2 1 3 4 6 8 9", "has two middle nodes"), ("nodes 9", "nodes 9\n", ""),
    ("2 1 3 4 7 8 9", "1 1 3 4 7 8 9", "element number stands twice"),
    ("1 1 2 3 5 6 7", "1 1 2 3 5 4 7", "inside out|of another one too or a corner"),
    ("4 0 1\n", "4 0 1_0\n", "must be number R Z"), ("nodes 9", "nodes 8", "line 12"),
    ("nodes 9", "numbering around\nnodes 9", "each once"), ("3 1 1\n", "3 \u0661 1\n", "must be number R Z")])
def test_text_files(tmp_path, old, new, words):
    """Each edge has one mid-edge node and each node number is unique; other words than numbers are refused."""
    assert old in CURVED
    if not words:
        assert read(tmp_path, CURVED.replace(old, new, 1), "mesh.txt").check() is None
        return
    with pytest.raises(fx.InputError, match=words):
        read(tmp_path, CURVED.replace(old, new, 1), "mesh.txt")


def test_text_files_that_lost_their_end(tmp_path):
    """Missing blocks and missing last digits are found; version 1, which has no last line, is read."""
    file = tmp_path / "mesh.txt"
    fx.mesh.write(fx.mesh.disc(radius=1.0, thickness={"a": 0.1, "b": 0.05}, elements=(2, 1)), file)
    text = file.read_text()
    whole = fx.mesh.read(file)
    for k in range(0, len(text) - 1, 7):
        with pytest.raises(fx.InputError, match="first line|must be|ends after|is not among"):
            read(tmp_path, text[:k], "cut.txt")
    with pytest.raises(fx.InputError, match="stands after 'end'"):
        read(tmp_path, text + "boundary 1 more\n", "more.txt")
    old = read(tmp_path, text.replace("triangles 2", "triangles 1").replace("end\n", ""), "old.txt")
    assert old.boundaries.keys() == whole.boundaries.keys() and old.layers.keys() == whole.layers.keys()


def test_blocks_of_no_dimension(tmp_path):
    """A block of nodes with coordinates on an entity of dimension -4 had rows of -1 number."""
    text = """$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 1 1 1\n-4 1 1 1\n1\n0 0 0\n$EndNodes\n$Elements
0 0 1 1\n$EndElements\n"""
    with pytest.raises(fx.InputError, match="section .Nodes: a dimension is -4"):
        read(tmp_path, text)
    with pytest.raises(fx.InputError, match="4 more numbers follow"):
        read(tmp_path, text.replace("-4 1 1 1", "2 1 1 0"))
    with pytest.raises(fx.InputError, match="1 nodes, but its first line says 2"):
        read(tmp_path, text.replace("-4 1 1", "2 1 0").replace("1 1 1 1", "1 2 1 1"))


@pytest.mark.parametrize("what", BAD)
def test_bad_files(tmp_path, what):
    text, words = BAD[what]
    with pytest.raises(fx.InputError, match=words):
        read(tmp_path, text)


def test_a_text_mesh_of_a_square_is_read(tmp_path):
    mesh = read(tmp_path, SQUARE)
    assert mesh.nodes_of("top").tolist() == [[0, 1], [1, 1]] and list(mesh.layers) == ["sheet"]
    apart = changed(("$Nodes\n4", "$Nodes\n6"), ("4 0 1 0\n", "4 0 1 0\n5 0 5 0\n6 1 5 0\n"), ("2 1 2 3 2 3 4",
                                                                                             "2 1 2 3 2 5 6"))
    assert len(read(tmp_path, apart).facets_of("top")) == 0         # a curve that is no part of the body


def moved(change, **disc):
    mesh = fx.mesh.disc(**{"radius": 1.0, "thickness": 0.1, "elements": (4, 2)} | disc)
    change(mesh.domain.geometry.x)
    return mesh


def nearest(x, R, Z):
    return np.argmin((x[:, 0] - R) ** 2 + (x[:, 1] - Z) ** 2)


def one_node(x):
    x[nearest(x, 0.5, 0.05)] = 0.9, 0.05, 0


def fold(x):
    x[:, 0] = np.minimum(x[:, 0], 1 - x[:, 0])


def bend_an_edge(x):
    x[nearest(x, 0.625, 0.1)] = 0.625, -0.5, 0


@pytest.mark.parametrize("change, words", [
    (one_node, "inside out"), (fold, "over each other"), (bend_an_edge, "inside out"),
    (lambda x: x.__setitem__((0, 0), np.nan), "finite"),
    (lambda x: x.__setitem__((slice(None), 1), 0), "flat")])
def test_tangled_meshes_are_refused(change, words):
    with pytest.raises(fx.InputError, match=words):
        moved(change).check()


@pytest.mark.parametrize("largest", [0, boxes.MAX_COMPARED], ids=["tree", "direct"])
@pytest.mark.parametrize("shape", ["scattered", "a row", "a column", "all over each other"])
def test_overlapping_boxes_are_found(shape, largest, monkeypatch):
    """Each overlapping pair is found once, as by comparison of all pairs."""
    monkeypatch.setattr(boxes, "MAX_COMPARED", largest)
    random = np.random.default_rng(3)
    for n in (1, 2, 3, 64, 65, 200):
        low = random.uniform(0, 1, (n, 2)) * {"a row": (1, 0), "a column": (0, 1)}.get(shape, (1, 1))
        high = low + (2 if shape == "all over each other" else random.uniform(0, 0.1, (n, 2)))
        found = sorted(tuple(sorted(pair)) for i, j in overlapping(low, high) for pair in zip(i.tolist(), j.tolist()))
        assert found == [(i, j) for i in range(n) for j in range(i + 1, n)
                         if np.all((low[i] <= high[j]) & (low[j] <= high[i]))]


@pytest.mark.parametrize("grid", [4, 1000], ids=["many touch", "few touch"])
def test_crossing_edges_are_found(grid):
    """Random polygons with corners on a grid: the same pairs of edges as in exact integer arithmetic.

    Two edges meet if they cross, or if an end of one, which is no node of the other, lies on the other.
    """
    random = np.random.default_rng(4)

    def turn(a, b, c):
        return np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    def meet(e, f):
        (a, b), (c, d) = corners[list(e)], corners[list(f)]
        if turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0:
            return True
        ends = [(p - x, q - x) for edge, other, p, q in ((e, f, c, d), (f, e, a, b))
                for node, x in zip(edge, corners[list(edge)]) if node not in other]
        return any(u[0] * v[1] == u[1] * v[0] and u @ v <= 0 for u, v in ends)
    number = 0
    for _ in range(150):
        n = int(random.integers(3, 13))
        corners = random.integers(0, grid, (n, 2))
        edges = [(i, (i + 1) % n) for i in range(n) if np.any(corners[i] != corners[(i + 1) % n])]
        found = check.crossing_edges(0.1 * corners, np.array(edges)) if edges else ()
        pairs = sorted((min(pair), max(pair)) for rows in found for pair in rows.tolist())
        assert pairs == [(i, j) for i in range(len(edges)) for j in range(i + 1, len(edges))
                         if meet(edges[i], edges[j])]
        number += len(pairs)
    assert number > 500


def test_long_rows_of_elements_are_checked_fast(monkeypatch):
    """Ten times as many elements need about ten times as many compared pairs of edges, not a hundred times."""
    looked = []
    monkeypatch.setattr(check, "overlapping", lambda *boxes: (looked.append(len(i)) or (i, j)
                                                              for i, j in overlapping(*boxes)))
    numbers = []
    for n in (100, 1000):
        looked.clear()
        fx.mesh.disc(radius=1.0, thickness=0.1, elements=(n, 1))
        numbers.append(sum(looked))
    assert 0 < numbers[1] < 15 * numbers[0]


def test_bent_bodies_are_accepted():
    """A strip that is bent to an open ring is accepted, and so is each mesh of `formingx.mesh`."""
    def roll(x, angle):
        a, r = angle * x[:, 0], 0.5 - x[:, 1]
        x[:, 0], x[:, 1] = 2 + r * np.sin(a), r * np.cos(a)
    moved(lambda x: roll(x, 6.2), elements=(40, 2)).check()
    with pytest.raises(fx.InputError, match="touches or crosses itself"):
        moved(lambda x: roll(x, 6.5), elements=(40, 2)).check()
    for mesh in (fx.mesh.disc(radius=1, thickness=1e-4), fx.mesh.sphere(inner_radius=1, thickness=5),
                 fx.mesh.parison(inner_radius=1, thickness=0.01, length=9)):
        mesh.check()
