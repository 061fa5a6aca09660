"""The text format of nodes and six-node elements, and nodal results on it."""

import numpy as np
import pytest
from conftest import ROOT, run_script, treloar

import formingx as fx
from formingx.mesh import text as grid

ONE = """six-node triangles 1
numbering corners   # one element, as a textbook numbers it
nodes 6
10 0 0
20 2 0
30 0 2
40 1 0
50 1 1
60 0 1
elements 1 sheet
1 10 20 30 40 50 60
boundary 1 bottom
10 40 20
"""


@pytest.mark.parametrize("numbering", ["corners", "around"])
def test_file_and_back(tmp_path, numbering):
    """Layers, boundaries, nodes and the order of the six nodes survive; so does the run."""
    layers = {"lower": 0.04, "upper layer": 0.042}
    mesh = fx.mesh.disc(radius=1.25, thickness=layers, elements=(6, 1))
    fx.mesh.write(mesh, tmp_path / "sheet.txt", numbering=numbering)
    plain, own = grid.read(tmp_path / "sheet.txt"), fx.mesh.to_grid(mesh)
    assert np.array_equal(plain.points, own.points)
    assert list(plain.layers) == list(layers) and set(plain.boundaries) == set(mesh.boundaries)
    for name in layers:
        assert np.array_equal(plain.layers[name], own.layers[name])
    for rows in plain.layers.values():                              # middles are where the numbering says
        corners, middles = plain.points[rows[:, :3]], plain.points[rows[:, 3:]]
        assert np.allclose((corners + np.roll(corners, -1, axis=1)) / 2, middles)
    bottom = plain.points[plain.boundaries["bottom"]]
    assert np.all(bottom[:, 1, 0] > bottom[:, 0, 0])                # the body on the left
    top = plain.points[plain.boundaries["top"]]
    assert np.all(top[:, 1, 0] < top[:, 0, 0])
    again = fx.mesh.read(tmp_path / "sheet.txt")
    pressures = []
    for m in (mesh, again):
        assert list(m.layers) == list(layers) and set(m.boundaries) == {"axis", "rim", "bottom", "top"}
        scene = fx.Scene(mesh=m, materials=fx.NeoHookean(c10=2.0), loads=[fx.Pressure("bottom")],
                         supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")])
        pressures.append(fx.trace(scene, until=fx.pole_stretch(1.5), progress=False).last.measures["pressure"])
    assert pressures[1] == pytest.approx(pressures[0], rel=1e-9)


@pytest.mark.thorough
def test_read_on_two_ranks(tmp_path):
    fx.mesh.write(treloar((10, 1)).mesh, tmp_path / "sheet.txt")
    script = f"""import formingx as fx
from mpi4py import MPI
m = fx.mesh.read({str(tmp_path / 'sheet.txt')!r})
try:
    fx.mesh.read('absent.txt')
except fx.InputError:
    n = MPI.COMM_WORLD.allreduce(m.domain.topology.index_map(2).size_local)
    print(n) if MPI.COMM_WORLD.rank == 0 else None"""
    assert run_script(script, ranks=2).split() == ["20"]


def test_textbook_element(tmp_path):
    """Any node numbers, unused ones too; both numberings of one element are the same element, also clockwise."""
    for name, old, new in (("a", "", ""), ("b", "numbering corners", "numbering around"),
                           ("c", "1 10 20 30 40 50 60", "1 10 30 20 60 50 40")):
        text = ONE.replace(old, new) if old else ONE
        text = text.replace("nodes 6", "nodes 7").replace("60 0 1", "5 9 9\n60 0 1")
        text = text.replace("1 10 20 30 40 50 60", "1 10 40 20 50 30 60") if name == "b" else text
        (tmp_path / f"{name}.txt").write_text(text)
        found = grid.read(tmp_path / f"{name}.txt")
        assert found.numbers[found.layers["sheet"]].tolist() == [[10, 20, 30, 40, 50, 60]]
        mesh = fx.mesh.read(tmp_path / f"{name}.txt")
        assert mesh.nodes_of("bottom").tolist() == [[0, 0], [1, 0], [2, 0]]


@pytest.mark.parametrize("old, new, message", [
    ("triangles 1", "triangles 3", "line 1 .*the first line must be 'six-node triangles 2'"),
    ("numbering corners", "numbering spiral", "line 2 .*must be one of 'corners', 'around'"),
    ("numbering corners", "", "must come before the elements"),
    (ONE, "", "line 0 .*the first line must be"), (ONE, "# all comment", "the first line must be"),
    ("nodes 6", "nodes six", "the count 'six' must be a whole number"), ("nodes 6", "nodes ⁶", "the count '⁶' must be"),
    ("nodes 6", f"nodes {'9' * 5000}", "the count '999"),
    ("nodes 6", "nodes 7", "line 10 .*must be number R Z: 3 numbers"),
    ("20 2 0", "20 2 nan", "not finite"), ("20 2 0", "10 2 0", "stands twice"),
    ("1 10 20 30 40 50 60", "1 10 20 30 40 50", "must be number and six nodes: 7 numbers"),
    ("1 10 20 30 40 50 60", "1 10 20 30 40 50 61", "line 11 .*node 61 is not among the nodes"),
    ("10 40 20", "10 50 20", "boundary 'bottom': 10 50 20 is not an edge of an element"),
    ("boundary 1", "boundary 2", "the file ends after 1 of 2 lines"), ("boundary 1", "border 1", "must be 'numbering"),
])
def test_bad_files(tmp_path, old, new, message):
    (tmp_path / "mesh.txt").write_text(ONE.replace(old, new, 1))
    with pytest.raises(fx.InputError, match=message):
        fx.mesh.read(tmp_path / "mesh.txt")


def test_write_refuses(tmp_path):
    mesh = treloar((2, 1)).mesh
    with pytest.raises(fx.InputError, match="must be one of 'corners', 'around'"):
        fx.mesh.write(mesh, tmp_path / "mesh.txt", numbering="odd")
    with pytest.raises(fx.InputError, match="gmsh files have their own"):
        fx.mesh.write(mesh, tmp_path / "mesh.msh", numbering="around")


@pytest.fixture(scope="module")
def path():
    return fx.trace(treloar((10, 1)), until=fx.pole_stretch(2.5), progress=False)


def test_nodal_results(path, tmp_path):
    """Our own nodes are ours; a difference put in at one node is found there; numbers of the mesh file count."""
    fx.mesh.write(path.problem.scene.mesh, tmp_path / "mesh.txt")
    fx.write_nodes(path, tmp_path / "nodes.csv")
    same = fx.compare_nodes(path, tmp_path / "nodes.csv")
    assert len(same.nodes) == 63 and same.maximum < 1e-13 and same.largest > 1.0
    pole = same.points[:, 0] == 0
    assert np.allclose(same.ours[pole & (same.points[:, 1] == 0.041), 1], path.last.measures["pole_height"])
    theirs = {"node": same.nodes, "u_r": same.ours[:, 0].copy(), "u_z": same.ours[:, 1] / 2.54}
    theirs["u_r"][7] += 0.01
    found = fx.compare_nodes(path, theirs, mesh=tmp_path / "mesh.txt", units={"u_z": 2.54})
    assert found.maximum == pytest.approx(0.01) and found.rms == pytest.approx(0.01 / 63**0.5)
    assert f"at node {same.nodes[7]}," in str(found)
    found.plot().savefig(tmp_path / "nodes.png")
    earlier = path.state_at(fx.pressure(0.3))
    fx.write_nodes(path, tmp_path / "earlier.csv", state=earlier, mesh=tmp_path / "mesh.txt")
    assert fx.compare_nodes(path, tmp_path / "earlier.csv", state=earlier).maximum < 1e-13
    assert fx.compare_nodes(path, tmp_path / "earlier.csv").maximum > 0.1
    finer = fx.trace(treloar((20, 2)), until=fx.pole_height(path.last.measures["pole_height"]), progress=False)
    assert fx.compare_nodes(finer, tmp_path / "nodes.csv").maximum < 0.01


def test_bad_nodal_results(path, tmp_path):
    fx.mesh.write(path.problem.scene.mesh, tmp_path / "mesh.txt")
    good = {"node": [1, 2], "R": [0.0, 1.0], "Z": [0.0, 0.0], "u_r": [0.0, 0.0], "u_z": [0.0, 0.0]}
    for change, arguments, message in (
            ({"node": [1, 99]}, {"mesh": tmp_path / "mesh.txt"}, "node 99 is not in the mesh file"),
            ({"node": [1, 1.5]}, {}, "must be whole numbers"),
            ({"R": [0.0, 3.0]}, {}, r"point \(R, Z\) = \(3, 0\) is not in the mesh"),
            ({}, {"columns": {"u_r": "U1"}}, "column 'U1' is not known"),
            ({}, {"columns": {"x": "U1"}}, "column 'x' is not known; known: 'node', 'R'"),
            ({}, {"units": {"u_r": "mm"}}, "does not state the unit"),
            ({}, {"mesh": "absent.txt"}, "'absent.txt' cannot be read")):
        with pytest.raises(fx.InputError, match=message):
            fx.compare_nodes(path, good | change, **arguments)


def test_shipped_grid_is_the_same_in_both_formats(tmp_path):
    mesh = fx.mesh.read(ROOT / "meshes" / "two_layer_40.msh")
    fx.mesh.write(mesh, tmp_path / "grid.txt", numbering="around")
    found = grid.read(tmp_path / "grid.txt")
    assert {name: len(rows) for name, rows in found.layers.items()} == {"lower": 20, "upper": 20}
    assert len(found.points) == 105 and np.ptp(found.points, axis=0) == pytest.approx([19.1, 1.27])
