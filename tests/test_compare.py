"""Comparison of curves: closed forms, curves that turn back, units, limit points, bad input."""

import numpy as np
import pytest
from conftest import drawn, run_script, treloar
from mpi4py import MPI
from reference import element
from test_reference_element import follow, pair

import formingx as fx
from formingx.io import csv_files
from formingx.results import files


def spiral(t, shift=0.0):
    """Return a curve on which both columns turn back."""
    return {"pressure": 3.0 + t * np.cos(t) / 5 + shift, "pole_height": 100 * t * np.sin(t)}


def write(file, header, columns):
    file.write_text("\n".join([header, *(",".join(map(repr, map(float, row))) for row in zip(*columns))]) + "\n")
    return file


def test_same_curve_other_points():
    """Two samplings of one curve differ only by the interpolation."""
    t = np.linspace(0, 12, 700)
    found = fx.compare(spiral(t), spiral(np.linspace(0.2, 11.8, 173)))
    assert found.columns == ["pressure", "pole_height"] and found.points_beyond_ends == 0
    for d in found.differences.values():
        assert d.rms <= d.maximum < 1e-5 * d.range
        assert d.maximum < found.resolution[0] * d.range


def test_error_falls_with_the_points():
    """The interpolation error decreases fast with the number of points, and is below `resolution`."""
    errors = []
    for n in (40, 80, 160):
        found = fx.compare(spiral(np.linspace(0, 12, n)), spiral(np.linspace(0.2, 11.8, 173)))
        errors.append(max(d.maximum / d.range for d in found.differences.values()))
        assert errors[-1] < found.resolution[0]
    assert errors[1] < errors[0] / 3 and errors[2] < errors[1] / 3


def test_known_shift():
    """The differences of a straight line that is moved along its normal are its displacements in both columns."""
    t = np.linspace(0, 1, 21)
    found = fx.compare({"a": 2 * t, "b": 10 * t}, {"a": 2 * t + 0.02, "b": 10 * t - 0.1}, along="arc length")
    for name, value in (("a", 0.02), ("b", -0.1)):
        d = found.differences[name]
        assert np.allclose(d.values, value) and d.rms == pytest.approx(abs(value)) == d.maximum
    assert found.differences["a"].range == 2.0


def test_short_curves_do_not_tell_their_resolution():
    t = np.linspace(0, 1, 4)
    found = str(fx.compare({"a": t, "b": t}, {"a": t, "b": 2 * t}))
    assert "fewer than five points" in found and "inf" not in found


@pytest.mark.parametrize("factor", [1.03, 0.8])
def test_walls_are_compared_at_the_same_radius(factor):
    """A wall that is thicker by a factor, at other nodes and in reverse order, differs by this factor."""
    def wall(r):
        return 0.2 + np.exp(-8 * (r - 0.9) ** 2) + 0.3 * np.tanh(20 * (r - 0.5))
    r, s = np.linspace(0, 1, 160), np.linspace(1, 0, 57)
    found = fx.compare({"r": r, "wall": wall(r)}, {"r": s, "wall": factor * wall(s)})
    assert found.along == "r" and found.points_beyond_ends == 0 and "at the same r" in str(found)
    d = found.differences["wall"]
    assert d.values == pytest.approx((factor - 1) * wall(s), abs=2e-4)
    slid = fx.compare({"r": r, "wall": wall(r)}, {"r": s[::-1], "wall": factor * wall(s[::-1])}, along="arc length")
    assert slid.differences["wall"].rms < 0.6 * d.rms


def test_tables_of_the_wall_are_compared_by_their_walls(tmp_path):
    """Between the radius and the wall a table of `Path.wall` has other columns."""
    path = fx.trace(treloar(), until=fx.pole_height(1.0), progress=False)
    path.wall().to_csv(tmp_path / "ours.csv")
    found = fx.compare(tmp_path / "ours.csv", tmp_path / "ours.csv")
    assert found.columns == ["reference_radius", "wall"] and found.differences["wall"].maximum < 1e-12


def test_curves_that_turn_back_are_paired_by_arc_length():
    t = np.linspace(0, 6, 60)
    assert fx.compare(spiral(t), spiral(t)).along == ""
    with pytest.raises(fx.InputError, match="along = 'pressure': it turns back"):
        fx.compare(spiral(t), spiral(t), along="pressure")
    with pytest.raises(fx.InputError, match="along 'x' is not known"):
        fx.compare(GOOD, GOOD, along="x")


def test_points_beyond_the_ends_of_a_curve_are_left_out():
    t = np.linspace(0, 1, 41)
    longer = np.linspace(-0.5, 2, 51)
    found = fx.compare({"a": t, "b": t**2}, {"a": longer, "b": np.where(longer > 0, longer**2, 0)})
    assert found.points_beyond_ends == 30 and max(d.maximum for d in found.differences.values()) < 1e-4


def test_limit_points_of_a_table():
    """The maximum and the minimum of a cubic are found from 25 points."""
    t = np.linspace(-2, 2, 25)
    cubic = {"pressure": t**3 - 3 * t, "travelled": t}
    found = fx.compare(cubic, cubic).limit_points[1]
    assert [p["pressure"] for p in found] == pytest.approx([2, -2], abs=0.01)
    assert [p["travelled"] for p in found] == pytest.approx([-1, 1], abs=0.02)


def test_units(tmp_path):
    """Units of a header or factors convert their values; the file has semicolons and comments."""
    t = np.linspace(0, 5, 30)
    ours = {"pressure": np.sin(t), "pole_height": t}
    text = ["# from elsewhere", "H (in);p [psi]"] + [f"{h / 2.54!r};{p / 0.070306957964!r}"
                                                     for h, p in zip(t.tolist(), np.sin(t).tolist())]
    (tmp_path / "theirs.csv").write_text("\n".join(text))
    names = {"pressure": "p", "pole_height": "H"}
    for units in ({"pressure": "kg/cm2", "pole_height": "cm"}, {"pressure": 0.070306957964, "pole_height": 2.54}):
        found = fx.compare(ours, tmp_path / "theirs.csv", columns=names, units=units)
        assert max(d.maximum for d in found.differences.values()) < 1e-6
    with pytest.raises(fx.InputError, match=r"column 'p' is in 'psi': give units="):
        fx.compare(ours, tmp_path / "theirs.csv", columns=names)
    with pytest.raises(fx.InputError, match="'psi' cannot be turned into 'cm'"):
        fx.compare(ours, tmp_path / "theirs.csv", columns=names, units={"pressure": "cm", "pole_height": "cm"})
    with pytest.raises(fx.InputError, match="unit 'ksc' is not known; known: m, cm"):
        fx.compare(ours, tmp_path / "theirs.csv", columns=names, units={"pressure": "ksc", "pole_height": "cm"})
    assert csv_files.conversion("cm3", "m3") == pytest.approx(1e-6)


@pytest.mark.thorough
def test_run_against_hand_coded_solver(tmp_path):
    """A run agrees with the coarse curve of a hand-coded program past the pressure maximum, and with its nodes."""
    scene = treloar((10, 1), fx.PinnedNode(1.25, 0.041),
                    model=fx.DisplacementPenalty(eps=0.1, stress_free=False))
    path = fx.trace(scene, until=fx.pole_stretch(3.5), progress=False)
    _, body, _ = pair(scene, element.Mooney(2.0, 0.0), tmp_path)
    R, Z = body.nodes.T
    pin, pole = (np.argmin(np.hypot(R - radius, Z - 0.041)) for radius in (1.25, 0.0))
    row = np.zeros(2 * len(R))
    row[2 * pole + 1] = 1.0
    heights = np.linspace(0.1, 2.0, 15)
    states = follow(body, np.concatenate([2 * np.flatnonzero(R == 0), [2 * pin, 2 * pin + 1]]), row, heights)
    theirs = write(tmp_path / "theirs.csv", "H,p", [heights, [q for _, q in states]])
    found = fx.compare(path, theirs, columns={"pressure": "p", "pole_height": "H"})
    assert found.points_beyond_ends == 0
    for d in found.differences.values():
        assert d.maximum < 1e-4 * d.range
    (ours,), (other,) = found.limit_points
    assert ours["pressure"] == path.limit_points[0].measures["pressure"]
    assert other["pressure"] == pytest.approx(ours["pressure"], rel=2e-4)
    assert other["pole_height"] == pytest.approx(ours["pole_height"], abs=(heights[1] - heights[0]) / 10)
    assert "theirs minus ours" in str(found) and "1 theirs" in str(found)
    found.plot().savefig(tmp_path / "both.png")
    assert drawn(tmp_path / "both.png")
    found.to_csv(tmp_path / "pairs.csv")
    assert len((tmp_path / "pairs.csv").read_text().splitlines()) == 16
    # its last displacements, node by node, in the numbering of the mesh file
    u = states[-1][0]
    nodes = write(tmp_path / "nodes.csv", "node,u_r,u_z", [range(1, len(u) + 1), *u.T])
    nodal = fx.compare_nodes(path, nodes, mesh=tmp_path / "mesh.txt", state=path.state_at(fx.pole_height(heights[-1])))
    assert nodal.maximum < 1e-8 * nodal.largest and nodal.largest > 1.9
    # the run's own file: the same limit point, and curves that differ by their drawing only
    path.to_csv(tmp_path / "ours.csv")
    again = fx.compare(tmp_path / "ours.csv", path)
    assert again.columns == ["pressure", "pole_height"] and again.limit_points[0] == again.limit_points[1]
    assert max(d.maximum / d.range for d in again.differences.values()) < 1e-6


GOOD = {"a": [0, 1, 2], "b": [0, 1, 4]}


@pytest.mark.parametrize("text, message", [
    (None, "is not there"), ("", "is empty"), ("1,2\n3,4\n5,6\n", "the first line must name the columns"),
    ("a,b\n1,2\n", "1 rows of data"), ("a,b\n1,2\n3\n4,5\n", "line 3: 1 cells, but the header names 2"),
    ("a,a\n1,2\n3,4\n", "stands twice"), ("a,b\n1,2\n3,x\n4,5\n", "column 'b': row 2 of the data is empty or not a"),
    ("a,b\n1,2\n3,nan\n4,5\n", "row 2"),
    ("a,b\n1,2\n3,1_0\n4,5\n", "row 2"), ("a;b\n1;2,5\n3;4.5\n", "decimal comma"), ("a,3\n1,2\n3,4\n", "must name"),
    ("a,c\n1,2\n3,4\n", "fewer than two have the same name"),
    ("a,b\n1,2\n1,3\n", "column 'a' does not vary on their side"),
])
def test_bad_tables(tmp_path, text, message):
    file = tmp_path / "theirs.csv"
    if text is not None:
        file.write_text(text)
    with pytest.raises(fx.InputError, match=message):
        fx.compare(GOOD, file)


def test_numbers_near_the_largest():
    """Curves with values near the largest number are compared; ranges that differ by too much are refused."""
    far = {"a": [0.0, 1.0, 2.0, 1e308], "b": [0.0, 1.0, 3.0, 1e308]}
    assert fx.compare(far, far).differences["b"].maximum < 1e-9 * 1e308
    for theirs in ({"a": [-1e308, 1e308], "b": [0.0, 1.0]}, {"a": [0.0, 1e200], "b": [0.0, 1.0]}):
        with pytest.raises(fx.InputError, match="column 'a': ours changes by .* no curves to compare"):
            fx.compare(GOOD, theirs)


def test_an_oversized_csv_cell_is_refused(tmp_path):
    file = tmp_path / "long.csv"
    file.write_text("a,b\n0,0\n1," + "1" * 200_000 + "\n2,2\n")
    with pytest.raises(fx.InputError, match=r"long.csv', line 3: field larger than field limit \(131072\)"):
        csv_files.read(file)


@pytest.mark.parametrize("stage", ["#1 blow", "a, b", 'the "plug"', "two\nlines", "a\u2028b"])
def test_names_of_stages_are_read_back(tmp_path, stage):
    """Rows of a CSV file are read back for any name of a stage."""
    columns = {"stage": [stage, stage, "last"], "a": [0.0, 1.0, 2.5], "b": [3.0, 2.0, 4.0]}
    files.write_rows(tmp_path / "run.csv", list(columns), zip(*columns.values()), MPI.COMM_SELF)
    table = csv_files.read(tmp_path / "run.csv")
    assert [table.columns[name].tolist() for name in "ab"] == [columns["a"], columns["b"]]
    assert [row[0] for _, row in csv_files.records(tmp_path / "run.csv")] == ["stage", *columns["stage"]]


@pytest.mark.parametrize("name", ["mould;1_force", "a\tb", "r, mm"])
def test_names_of_columns_are_read_back(tmp_path, name):
    """A semicolon, a tab or a comma in the name of a column does not divide cells."""
    files.write_rows(tmp_path / "run.csv", ["stage", "x", name], [["blow; hold", 0.0, 1.5], ["b", 1.0, 2.5]],
                     MPI.COMM_SELF)
    assert csv_files.read(tmp_path / "run.csv").columns[name].tolist() == [1.5, 2.5]


@pytest.mark.thorough
def test_on_two_ranks(tmp_path):
    """Report and file are the same on one and on two ranks."""
    write(tmp_path / "theirs.csv", "pressure,pole_height", [[0.0, 0.3, 0.45, 0.49], [0.0, 0.5, 0.9, 1.3]])
    script = f"""import sys; sys.path.insert(0, 'tests')
import formingx as fx
from conftest import treloar
from mpi4py import MPI
path = fx.trace(treloar((10, 1)), until=fx.pole_stretch(2.0), progress=False)
found = fx.compare(path, {str(tmp_path / 'theirs.csv')!r})
found.to_csv({str(tmp_path / 'pairs.csv')!r})
print([round(d.maximum, 9) for d in found.differences.values()]) if MPI.COMM_WORLD.rank == 0 else None"""
    assert run_script(script, ranks=2) == run_script(script)
    assert len((tmp_path / "pairs.csv").read_text().splitlines()) == 5


def test_walls_of_sheets_are_compared_at_their_positions():
    """Two meshes of one flat sheet: the walls of a smooth field agree at (X, Y), whatever the number of triangles."""
    def table(n, seed, shift=0.0):
        X, Y = np.random.default_rng(seed).uniform(-1, 1, (2, n))
        return {"X": X, "Y": Y, "x": X, "wall": 1 + 0.3 * X * Y + 0.1 * X**2 + shift}
    same = fx.compare(table(2000, 0), table(700, 1))
    assert same.along == "X, Y" and set(same.differences) == {"wall"} and same.limit_points == ([], [])
    assert same.differences["wall"].rms < 0.005 * same.differences["wall"].range
    thicker = fx.compare(table(2000, 0), table(700, 1, shift=0.05))
    assert thicker.differences["wall"].rms == pytest.approx(0.05, rel=0.03)
    assert "at the same X, Y" in str(thicker) and "limit points" not in str(thicker)
    assert len(thicker.plot().axes) == 4
    with pytest.raises(fx.InputError, match="no point \\(X, Y\\) of theirs"):
        far = table(50, 2)
        fx.compare(table(100, 0), far | {"X": far["X"] + 9})


def test_a_component_in_place_of_a_displacement_is_named():
    with pytest.raises(fx.InputError, match="first argument is the displacement .* component='r'"):
        fx.displacement("r", at=(1.0, 0.0))
