"""Files for ParaView, animations and reports: read back, and compared with what they were made from."""

import base64
import gzip
import json
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from html.parser import HTMLParser
from pathlib import Path as FilePath
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista
import test_process
from conftest import run_script, treloar
from mpi4py import MPI
from PIL import Image
from test_contact import cup

import formingx as fx
from formingx.__main__ import main
from formingx.contact.tooling import Tooling
from formingx.findings import Finding
from formingx.results.files import checkpoint_data
from formingx.results.files.description import describe
from formingx.results.files.fields import Fields
from formingx.results.files.solid import solid
from formingx.results.show import animation, plots, report
from formingx.results.show.picture import Picture
from formingx.results.show.report_data import progress


@pytest.fixture(scope="module")
def inflated():
    return fx.trace(treloar((10, 2)), until=fx.pole_stretch(2.5), intermediate=[fx.pole_stretch(1.5)], progress=False)


@pytest.fixture(scope="module")
def formed():
    return fx.trace(cup("none"), until=fx.pressure(8.0), progress=False)


def steps_of(file):
    """[(time, {name: array, and "points": reference positions})] of a .pvd file; its meshes have quadratic cells."""
    reader = pyvista.get_reader(file)
    steps = []
    for time in reader.time_values:
        reader.set_active_time_value(time)
        (grid,) = reader.read()
        assert set(grid.celltypes) <= {pyvista.CellType.QUADRATIC_TRIANGLE, pyvista.CellType.QUADRATIC_EDGE}
        steps.append((time, {name: np.array(grid.point_data[name]) for name in grid.point_data} | {
            "points": np.array(grid.points), "area": grid.compute_cell_sizes()["Area"]}))
    return steps


@pytest.mark.quick
def test_vtk_read_back(inflated, tmp_path):
    """Every state is a time step; node by node a quadratic triangle has the place and the stress that it should."""
    inflated.to_vtk(tmp_path / "run.pvd", "all")
    steps = steps_of(tmp_path / "run.pvd")
    assert [time for time, _ in steps] == list(range(len(inflated)))
    for k, state in ((0, inflated.states[0]), (len(inflated) - 1, inflated.last)):
        (_, step), profile = steps[k], inflated.profile(state)
        points, u = step["points"][:, :2], step["displacement"][:, :2]
        corners, halves = points.reshape(-1, 2, 3, 2)[:, 0], points.reshape(-1, 2, 3, 2)[:, 1]
        assert np.allclose(halves, (corners + np.roll(corners, -1, axis=1)) / 2, atol=1e-12)
        assert step["area"].sum() == pytest.approx(1.25 * 0.082, rel=1e-9)
        pole = np.flatnonzero(np.hypot(points[:, 0], points[:, 1] - 0.041) < 1e-9)
        assert len(pole) and np.allclose(u[pole, 1], state.measures["pole_height"], rtol=1e-10)
        for R, ratio in zip(profile.reference_radius, profile.thickness_ratio):
            at = np.abs(points[:, 0] - R) < 1e-9
            assert np.allclose(step["thickness_ratio"][at], ratio, rtol=1e-3)
        at = np.unique(points, axis=0)[::7]
        stress = inflated.stress(state).at_points(at)
        for x, sigma, stretches in zip(at, stress.cauchy, stress.principal_stretches):
            here = np.hypot(*(points - x).T) < 1e-9
            assert np.allclose(step["cauchy_rr"][here], sigma[0, 0], atol=1e-9)
            assert np.allclose(step["stretches"][here], stretches, rtol=1e-9)
    assert all(np.isfinite(array).all() for _, step in steps for array in step.values())


def test_an_interface_keeps_both_sides(tmp_path):
    mesh = fx.mesh.disc(radius=1.0, thickness={"soft": 0.1, "hard": 0.1}, elements=(6, 1))
    scene = fx.Scene(mesh=mesh, materials={"soft": fx.NeoHookean(c10=1.0), "hard": fx.NeoHookean(c10=10.0)},
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom")])
    path = fx.trace(scene, until=fx.pole_stretch(1.3), progress=False)
    path.to_vtk(tmp_path / "two.pvd")
    _, step = steps_of(tmp_path / "two.pvd")[0]
    here = np.hypot(step["points"][:, 0] - 0.5, step["points"][:, 1] - 0.1) < 1e-9
    found = step["cauchy_hoop"][here]
    for layer in ("soft", "hard"):
        exact = path.stress().at_points([(0.5, 0.1)], layer).cauchy[0, 2, 2]
        assert np.abs(found - exact).min() < 1e-9 * abs(exact)
    assert np.ptp(found) > 0.5 * np.abs(found).max()
    errors = step["stress_error"].reshape(-1, 6)                # a value for each triangle
    assert np.ptp(errors, axis=1).max() == 0
    assert np.sort(errors[:, 0]) == pytest.approx(np.sort(path.stress().error().mean), rel=1e-12)


def test_contact_pressure_is_the_blowing_pressure_on_the_floor(formed):
    """A stretched sheet that lies flat passes on the pressure: p = 8 per deformed area, and sigma_zz = -8."""
    fields = Fields(formed)
    values, X = fields.evaluate(formed.last), fields.points
    p, top = values["contact_pressure"][..., 0], np.abs(X[..., 1] - 0.3) < 1e-9
    flat = top & (X[..., 0] > 0.9) & (X[..., 0] < 2.8)
    assert flat.sum() > 10 and values["thickness_ratio"][flat].max() < 0.8
    np.testing.assert_allclose(p[flat], 8.0, rtol=5e-4)
    np.testing.assert_allclose(values["cauchy_zz"][flat], -8.0, rtol=0.02)
    free = X[..., 0] > 4.0
    assert p.min() >= 0 and np.all(p[free & (X[..., 0] < 9)] == 0) and np.all(p[~top] == 0)


@pytest.mark.quick
def test_vtk_of_some_states(formed, tmp_path):
    formed.to_vtk(tmp_path / "run.pvd", formed.states[-2:])
    assert sorted(f.name for f in tmp_path.iterdir()) == [*(f"run-{len(formed) - k}.vtu" for k in (2, 1)), "run.pvd"]
    (first, _), (last, step) = steps_of(tmp_path / "run.pvd")
    assert [first, last] == [len(formed) - 2, len(formed) - 1] and len(step["points"]) == 6 * 80
    assert {"displacement", "contact_pressure", "principal_stresses", "thickness"} <= set(step)
    assert step["contact_pressure"].max() > 7.0


@pytest.mark.quick
def test_membrane_and_plane_strain(tmp_path):
    path = fx.trace(treloar((10, 1), model=fx.Membrane()), until=fx.pole_stretch(2.0), progress=False)
    path.to_vtk(tmp_path / "line.pvd")
    _, step = steps_of(tmp_path / "line.pvd")[0]
    assert step["thickness_ratio"].min() == pytest.approx(2.0 ** -2, rel=1e-9) and "cauchy_rr" not in step


VTK = """
import sys
sys.path.insert(0, "tests")
import formingx as fx
from conftest import treloar
path = fx.trace(treloar((10, 2)), until=fx.pole_stretch(2.5), intermediate=[fx.pole_stretch(1.5)], progress=False)
path.to_vtk(sys.argv[1], "all")
try:
    path.to_vtk("/proc/run.pvd")
except OSError as error:
    print("could not" in str(error), flush=True)
"""


@pytest.mark.thorough
def test_on_two_ranks(inflated, tmp_path):
    assert run_script(VTK, tmp_path / "two.pvd", ranks=2).count("True") == 2
    inflated.to_vtk(tmp_path / "one.pvd", "all")
    (_, one), (_, two) = steps_of(tmp_path / "one.pvd")[-1], steps_of(tmp_path / "two.pvd")[-1]
    assert sorted(one) == sorted(two)
    for name in ("displacement", "stretches", "cauchy_rr", "thickness"):
        assert np.abs(one[name]).sum() == pytest.approx(np.abs(two[name]).sum(), rel=1e-8)


@pytest.mark.thorough
@pytest.mark.quick
def test_animation(formed, tmp_path):
    formed.animate(tmp_path / "run.gif", frames=7, seconds=2.0)
    with Image.open(tmp_path / "run.gif") as film:
        assert film.n_frames == 7 and film.size == (1000, 420)
        times, pictures = [], []
        for k in range(7):
            film.seek(k)
            times.append(film.info["duration"])
            pictures.append(np.asarray(film.convert("RGB"), dtype=float))
    assert times == [280] * 6 + [1280]                     # hundredths of a second
    assert all(np.abs(a - b).mean() > 0.1 for a, b in zip(pictures, pictures[1:]))
    for given, message in (({"frames": 0}, "frames = 0"), ({"seconds": -1}, "seconds = -1")):
        with pytest.raises(fx.InputError, match=message):
            formed.animate(tmp_path / "run.gif", **given)
    with pytest.raises(fx.InputError, match="must end in .gif or .mp4"):
        formed.animate(tmp_path / "run.avi")


@pytest.mark.parametrize("kinematics, left, image", [
    (fx.Axisymmetric(), fx.Symmetry("axis"), True), (fx.PlaneStrain(), fx.Symmetry("axis"), True),
    (fx.PlaneStrain(), fx.Clamped("axis"), False)])
def test_an_animation_draws_a_mirror_image_of_halves_and_rings_alone(kinematics, left, image):
    """A plane-strain sheet that is held at r = 0 is the whole part."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.1, elements=(4, 1)), materials=fx.NeoHookean(c10=0.5),
                     kinematics=kinematics, supports=[left, fx.Clamped("rim")], loads=[fx.Pressure("bottom")])
    assert animation.has_image_at_axis(scene) == image


def test_an_animation_of_a_tall_part_is_narrow(tmp_path):
    mesh = fx.mesh.parison(inner_radius=10.0, thickness=2.0, length=130.0, elements=(20, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.NeoHookean(c10=1.0), loads=[fx.Pressure("inner")],
                     supports=[fx.Symmetry("axis"), fx.Clamped("neck")])
    fx.trace(scene, until=fx.pressure(0.01), progress=False).animate(tmp_path / "run.gif", frames=2)
    with Image.open(tmp_path / "run.gif") as film:
        assert film.size == (680, 420)                     # 2.8 and 4 inches, not 6 and 4


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg")
def test_an_animation_is_mp4(formed, tmp_path):
    """Seven moving frames in two seconds, and the last one for a second more, as ffmpeg's own programs read them."""
    formed.animate(tmp_path / "run.mp4", frames=7, seconds=2.0)
    film = json.loads(subprocess.run(["ffprobe", "-v", "error", "-show_streams", "-of", "json", tmp_path / "run.mp4"],
                                     capture_output=True, check=True).stdout)["streams"][0]
    assert (film["codec_name"], film["pix_fmt"], film["width"], film["height"]) == ("h264", "yuv420p", 1000, 420)
    assert int(film["nb_frames"]) == 10 and float(film["duration"]) == pytest.approx(10 * 2 / 7, rel=1e-3)
    data = subprocess.run(["ffmpeg", "-v", "error", "-i", tmp_path / "run.mp4", "-f", "rawvideo", "-pix_fmt", "gray",
                           "-"], capture_output=True, check=True).stdout
    frames = np.frombuffer(data, np.uint8).reshape(10, 420, 1000).astype(float)
    change = np.abs(np.diff(frames, axis=0)).mean((1, 2))
    assert change[:6].min() > 0.1 and change[6:].max() < 0.02


def test_mp4_without_ffmpeg(formed, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)       # the package that brings the program
    with pytest.raises(fx.InputError, match="needs the program ffmpeg"):
        formed.animate(tmp_path / "run.mp4")


def test_notebooks_show_pictures(inflated, tmp_path):
    """Axes show their figure, a picture or a film shows its file, a table its first and last rows."""
    drawn = inflated.plot("pressure", "pole_stretch")
    assert drawn._repr_png_() == drawn.figure._repr_png_() and drawn._repr_png_().startswith(b"\x89PNG")
    Image.new("RGB", (3, 2)).save(tmp_path / "a.png")
    shown = Picture(tmp_path / "a.png")._repr_mimebundle_()
    assert base64.b64decode(shown["image/png"]) == (tmp_path / "a.png").read_bytes()
    (tmp_path / "b.gif").write_bytes(b"GIF")
    assert 'src="data:image/gif;base64,R0lG"' in Picture(tmp_path / "b.gif")._repr_mimebundle_()["text/html"]
    assert Picture(tmp_path / "c.mp4")._repr_mimebundle_() == {}


def test_every_stage_has_its_frames(plugged):
    """Frames are even in the process: the plug goes down by 1 and up by 0.5."""
    shown = [b.stage for _, b, _ in animation.spread(plugged, 60)]
    assert 30 <= shown.count("down") <= 50 and shown.count("up") >= 10


def test_stages_without_time_have_their_share(monkeypatch):
    """A plug moves in 1 s, then vacuum comes at once; the last frame shows the end of a last stage without motion."""
    measures = {"process_time": np.array([0, 0.5, 1, 1, 1, 1]), "plug_travel": np.array([0, 1, 2, 2, 2, 2]),
                "pressure": np.array([0, 0, 0, 0, 0.5, 1])}
    assert progress(measures, [None] * 6) == pytest.approx([0, 0.4, 0.8, 0.8, 0.9, 1])
    monkeypatch.setattr(animation, "progress", lambda *given: np.array([0, 0.5, 1, 1]))
    path = SimpleNamespace(states=list(range(4)), columns=[], profile=lambda state: None)
    assert animation.spread(path, 3) == [(0, 1, 0.0), (1, 2, 0.0), (2, 3, 1.0)]


def test_every_stage_has_its_curve():
    """What a stage drives: a plug's force against its travel, a pressure against the height; else the plug's."""
    rows = [("plug", 0, 0, 0, 0), ("plug", 5, 2, 0, 5), ("air", 5, 1, 0.1, 6), ("air", 5, 0, 0.2, 9),
            ("hold", 5, 0, 0.2, 9), ("hold", 5, 0, 0.2, 9)]
    names = ["plug_travel", "plug_force", "pressure", "pole_height"]
    states = [SimpleNamespace(stage=stage, measures=dict(zip(names, values))) for stage, *values in rows]
    assert animation.columns_of_stages(SimpleNamespace(states=states, columns=names)) == {
        "plug": ("plug_travel", "plug_force"), "air": ("pole_height", "pressure"),
        "hold": ("plug_travel", "plug_force")}
    for k, state in enumerate(states):                       # while all stands still, but a force falls
        state.measures |= {"process_time": float(k), "mould_force": -float(k)}
    names += ["process_time", "mould_force"]
    assert animation.columns_of_stages(SimpleNamespace(states=states, columns=names))["hold"] == (
        "process_time", "mould_force")


@pytest.mark.thorough
def test_solids_are_closed_and_hold_the_volume(formed, tmp_path):
    """Every edge of the triangles belongs to two of them, run both ways; the volume is the part's."""
    points, triangles = solid(formed.profile(), True, 600)
    edges = np.concatenate([triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == len(edges) and all((b, a) in there for a, b in there)
    a, b, c = points[triangles].transpose(1, 0, 2)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(formed.part().volume, rel=1e-3) and volume > 0
    formed.to_stl(tmp_path / "cup.stl")
    data = (tmp_path / "cup.stl").read_bytes()
    count = int.from_bytes(data[80:84], "little")
    assert len(data) == 84 + 50 * count and count > 1000
    formed.to_gltf(tmp_path / "cup.glb")
    data = (tmp_path / "cup.glb").read_bytes()
    assert data[:4] == b"glTF" and int.from_bytes(data[8:12], "little") == len(data)
    length = int.from_bytes(data[12:16], "little")
    found = json.loads(data[20:20 + length])
    assert found["asset"]["version"] == "2.0" and found["buffers"][0]["byteLength"] == len(data) - 28 - length
    with pytest.raises(fx.InputError, match="must end in .stl"):
        formed.to_stl("cup.obj")


def test_shells_hold_the_volume(formed, tmp_path):
    """An input file for CalculiX read back: area times wall is the part's volume, and the rim is all round."""
    formed.to_inp(tmp_path / "cup.inp", parts=40)
    blocks, lines = {}, (tmp_path / "cup.inp").read_text().splitlines()
    for line in lines:
        if line.startswith("**") or "formingx" in line:
            continue
        if line.startswith("*"):
            rows = blocks.setdefault(line, [])
        else:
            rows.append([float(v) for v in line.split(",") if v.strip()])
    nodes = np.array(blocks["*NODE, NSET=ALL"])
    walls = np.array(blocks["*NODAL THICKNESS"])
    assert np.array_equal(nodes[:, 0], np.arange(1, len(nodes) + 1)) and np.array_equal(walls[:, 0], nodes[:, 0])
    volume, numbers, flux = 0.0, [], 0.0
    for kind, n in (("S6", 3), ("S8R", 4)):
        elements = np.array(blocks[f"*ELEMENT, TYPE={kind}, ELSET=WALL"], dtype=int)
        numbers += elements[:, 0].tolist()
        for row in elements[:, 1:] - 1:
            round_it = row.reshape(2, n).T.ravel()                      # corner, middle of the edge behind it, ...
            x = nodes[round_it, 1:]
            area = np.cross(x, np.roll(x, -1, axis=0)).sum(0) / 2
            volume += np.linalg.norm(area) * walls[round_it, 1].mean()
            flux += area[2]
    assert numbers == list(range(1, len(numbers) + 1)) and len(blocks["*NSET, NSET=RIM"]) == 80
    assert volume == pytest.approx(formed.part().volume, rel=4e-3)
    rim = formed.profile().middle[-1, 0]
    assert abs(flux) == pytest.approx(np.pi * rim**2, rel=2e-3)              # all elements are turned the same way
    with pytest.raises(fx.InputError, match="at least 3"):
        formed.to_inp(tmp_path / "cup.inp", parts=2)


def test_deformed_mesh_as_a_file(formed, tmp_path):
    formed.to_msh(tmp_path / "cup.msh")
    mesh, old = fx.mesh.read(tmp_path / "cup.msh"), formed.deformed_mesh()
    assert mesh.layers.keys() == old.layers.keys() and mesh.boundaries.keys() == old.boundaries.keys()
    for name in old.boundaries:
        assert mesh.line_of(name) == pytest.approx(old.line_of(name), abs=1e-12)


class Links(HTMLParser):
    """What a page would load or link to, and its text."""

    def __init__(self):
        super().__init__()
        self.links, self.words, self.open = [], [], []

    def handle_starttag(self, tag, attributes):
        self.links += [value for name, value in attributes if name in ("src", "href", "data", "action")]
        if tag not in ("meta", "img", "br", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def page(file):
    text = file.read_text(encoding="utf-8")
    found = Links()
    found.feed(text)
    assert not found.open and "://" not in text and "@import" not in text and "url(" not in text
    assert all(link.startswith("data:image/png;base64,") for link in found.links)
    for link in found.links:
        assert base64.b64decode(link.partition(",")[2]).startswith(b"\x89PNG")
    return " ".join(found.words)


@pytest.mark.quick
def test_report_is_one_file(inflated, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = inflated.report(title="A <test>")
    assert [f.name for f in tmp_path.iterdir()] == ["report.html"] == [str(file)]
    text = page(tmp_path / file)
    for words in ("A <test>", "NeoHookean(c10=2.0)", "SimplySupported('rim')", "Pressure('bottom') (driven)",
                  "limit point 1", f"{inflated.limit_points[0].measures['pressure']:.6g}", "dolfinx", "No warnings"):
        assert words in text
    with pytest.raises(fx.InputError, match="its name must end in .html"):
        inflated.report(tmp_path / "a.pdf")


def test_report_of_a_run_that_failed(tmp_path):
    with pytest.raises(fx.ConvergenceError) as caught:
        fx.trace(treloar(), until=fx.pole_stretch(8.0), max_steps=4, progress=False)
    caught.value.path.report(tmp_path / "failed.html", failure=caught.value)
    text = page(tmp_path / "failed.html")
    assert "The run could not go on" in text and "max_steps = 4 were used up" in text
    assert "The path ended early: its target is pole stretch 8" in text


@pytest.fixture(scope="module")
def plugged():
    """A plug goes down with the floor taken away, and back up with it there."""
    scene = test_process.plugged(more=[test_process.FLOOR])
    return test_process.run(scene, test_process.plug("down", 1.0, inactive=["floor"]), test_process.plug("up", 0.5))


def test_tools_are_drawn_where_they_are(plugged):
    path, there = plugged, Tooling.of_problem(plugged.problem)
    again = Tooling.of_description(json.loads(json.dumps(describe(path.problem))))
    for state, travelled in zip(path.states, path["plug_travel"]):
        travels = there.travels(state.setting, state.control)
        assert travels == again.travels(state.setting, state.control)
        assert travels == [pytest.approx(travelled, abs=1e-12), None if state.stage == "down" else 0.0]
        placed, top = there.placed(travels), path.profile(state).top
        for (tool, shift), (other, _) in zip(placed, again.placed(travels)):
            assert repr(tool) == repr(other)
            depth = tool.signed_distance(top - shift)
            np.testing.assert_allclose(other.signed_distance(top - shift), depth, rtol=1e-12)
        tool, shift = placed[0]
        ramp = path.problem.contacts[0].law.theta
        deepest = tool.signed_distance(top - shift).max()
        assert deepest == pytest.approx(state.measures["penetration"], abs=1.01 * ramp)
    assert path["penetration"].max() > 0


def test_report_of_tools(plugged, formed, tmp_path):
    plugged.report(tmp_path / "run.html")
    text = page(tmp_path / "run.html")
    force = f"{plugged.last.measures['plug_force']:.6g}"           # it travels down: what it takes resists
    for words in ("plug", "1 arc, closed", "moves along (0, -1)", force, "floor", "1 line from", "fixed",
                  " Stages ", "plug travel at its end", "largest force on plug"):
        assert words in text
    plugged.save(tmp_path / "run")
    assert main(["report", str(tmp_path / "run"), "--out", str(tmp_path / "again.html")]) == 0
    one, two = (drawn(tmp_path / f"{name}.html") for name in ("run", "again"))
    for data in (one, two):                                  # a checkpoint does not know stress and contact pressure
        fields = data["runs"][0]["sheet"]["fields"]
        fields.pop("largest principal stress", None), fields.pop("contact pressure", None)
    assert one == two


def drawn(file):
    """What a report draws."""
    packed = re.search("id=data>([^<]*)<", file.read_text())[1]
    return json.loads(gzip.decompress(base64.b64decode(packed)))


def test_report_draws_what_was_computed(plugged, tmp_path):
    plugged.report(tmp_path / "run.html", units=fx.Units("mm", "MPa"))
    data = drawn(tmp_path / "run.html")
    run, = data["runs"]
    assert run["stage"] == [s.stage for s in plugged.states] and len(run["sheet"]["top"]) == len(plugged)
    assert run["progress"][0] == 0 and run["progress"][-1] == 1 and np.all(np.diff(run["progress"]) >= 0)
    k = len(plugged) // 2
    profile = plugged.profile(plugged.states[k])
    assert np.allclose(run["sheet"]["bottom"][k], profile.bottom.T, atol=1e-4 * np.ptp(profile.bottom))
    assert np.allclose(run["sheet"]["fields"]["wall, mm"][k], profile.wall_thickness, rtol=1e-4)
    plug, floor = run["tools"]
    assert np.allclose(plug["travel"], plugged["plug_travel"], atol=1e-6) and floor["travel"][0] is None
    chart = data["charts"][0]
    assert chart["x"] == "plug travel, mm" and chart["y"] == "plug force, N"
    found = np.concatenate([trace["y"] for trace in chart["traces"]])
    assert np.allclose(found, plugged.tool_forces()["plug"], atol=1e-4 * found.max()) and found.max() > 0


def test_runs_side_by_side(inflated, formed, tmp_path):
    file = fx.report([inflated, formed], tmp_path / "two.html", "Two", names=["sheet", "cup"])
    assert file == tmp_path / "two.html"
    text, data = page(tmp_path / "two.html"), drawn(tmp_path / "two.html")
    assert [run["name"] for run in data["runs"]] == ["sheet", "cup"] and "MooneyRivlin" in text
    walls = next(chart for chart in data["charts"] if chart["title"].startswith("Wall against arc"))
    assert [trace["name"] for trace in walls["traces"]] == ["sheet", "cup"]
    with pytest.raises(fx.InputError, match="2 runs and 1 names"):
        fx.report([inflated, formed], tmp_path / "three.html", names=["a"])


def test_runs_with_and_without_time_side_by_side(formed, tmp_path):
    """The gaps in the corners of both are drawn over the pressure."""
    scene = cup("none")
    timed = fx.Process(scene).run([fx.Stage("blow", amplitudes={scene.driven: [(0.0, 0.0), (1.0, 8.0)]})],
                                  progress=False)
    for runs in ([formed, timed], [timed, formed]):
        fx.report(runs, tmp_path / "both.html", units=fx.Units("cm", "kg/cm2"))
        gaps, = (chart for chart in drawn(tmp_path / "both.html")["charts"] if chart["title"].startswith("Gap"))
        assert gaps["x"] == "pressure, kg/cm2" and len(gaps["traces"]) == 2
        assert gaps["traces"][0]["y"][-1] == pytest.approx(gaps["traces"][1]["y"][-1], rel=1e-2)
    assert report.of_path(timed).control(1) == "process_time" and report.of_path(formed).control(1) == "pressure"


@pytest.mark.thorough
def test_a_sheet_that_creeps_under_its_weight(tmp_path):
    """A run without a controlled load or tool: a report, and an animation of the pole height over time."""
    creeps = fx.TransientNetwork(fx.NeoHookean(c10=1e-6), [(1.0, 2.0)])
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(8, 1)), materials=creeps,
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Gravity(1.0, value=1e-5)])
    path = fx.Process(scene).run([fx.Stage("sag", duration=5.0)], progress=False)
    path.report(tmp_path / "run.html")
    run, = drawn(tmp_path / "run.html")["runs"]
    assert np.allclose(run["progress"], path["process_time"] / 5.0, atol=1e-4)
    path.animate(tmp_path / "run.gif", frames=2)
    assert animation.columns_of_stages(path) == {"sag": ("process_time", "pole_height")}


def test_a_sheet_that_sags_as_its_weight_grows(tmp_path):
    """A run without time, pressure and travel: the load over the pole height."""
    scene = fx.Scene(mesh=fx.mesh.disc(radius=1.0, thickness=0.05, elements=(8, 1)), materials=fx.NeoHookean(c10=1.0),
                     supports=[fx.Symmetry("axis"), fx.SimplySupported("rim")], loads=[fx.Gravity(1e-3)])
    path = fx.trace(scene, until=fx.pole_height(-0.05), progress=False)
    path.animate(tmp_path / "run.gif", frames=2)
    assert animation.columns_of_stages(path) == {"": ("pole_height", "load")}
    # without a pole and a stored energy, as a K-BKZ body
    assert plots.main_columns(["process_time", "volume_error"]) == ("process_time", "volume_error")


def test_forces_of_round_off_are_0_in_the_table_of_stages(plugged):
    record = report.of_path(plugged)
    force = np.abs(record.forces["plug"]).max()
    record.forces = {"floor": np.where(np.array(record.stages) == "up", force, 1e-14 * force)}
    down, up = re.findall(r"<tr>.*?</tr>", report._stages(record, fx.Units()))[1:]
    assert ">0<" in down and "e-1" not in down and f">{force:.6g}<" in up


def test_a_part_that_recovers_has_its_height_over_time():
    """All tools are inactive: their travels are constant, their forces 0."""
    names = ["process_time", "plug_travel", "plug_force", "pole_height"]
    states = [SimpleNamespace(stage="recovery", measures=dict(zip(names, (t, 6.0, 0.0, 9.0 - t)))) for t in (0.0, 1.0)]
    found = animation.columns_of_stages(SimpleNamespace(states=states, columns=names))
    assert found == {"recovery": ("process_time", "pole_height")}


def test_labels_of_all_stages_have_room_in_an_animation(formed, monkeypatch):
    """The force of the second stage has longer numbers than the pressure of the first."""
    drawn, plain = [], animation.figures.figure
    monkeypatch.setattr(animation.figures, "figure",
                        lambda *size, **more: drawn.append(plain(*size, **more)) or drawn[-1])
    curves = {("pole_height", "pressure"): ([0, 1], [0, 1]), ("process_time", "mould_force"): ([0, 1], [0, 12345.6])}
    shape = formed.profile()
    animation._draw([shape] * 2, [[]] * 2, [(names, (0, 0)) for names in curves], curves, True, fx.Units())
    (figure, (_, loading)), = drawn
    bar = figure.axes[-1]
    assert loading.get_ylabel() == "mould force"
    assert loading.yaxis.label.get_window_extent().x0 > bar.yaxis.label.get_window_extent().x1


def test_findings_name_the_control_of_their_stage(formed, tmp_path):
    """A plug moves, then a pressure rises: each state is named by the quantity that its stage controls."""
    record = report.of_path(formed)
    n, half = len(formed), len(formed) // 2
    assert record.control(n - 1) == "pressure"
    later = np.arange(n) - half
    record.findings = []
    record.stages = ["plug"] * half + ["blow"] * (n - half)
    record.measures = {"air_pressure": np.maximum(later, 0), "plug_travel": np.minimum(np.arange(n), half - 1),
                       **record.measures, "penetration": np.zeros(n), "volume_error": np.where(later > 1, 0.5, 0),
                       "mass_error": np.where(np.arange(n) > 1, 0.1, 0)}
    assert (record.control(1), record.control(n - 1)) == ("plug_travel", "air_pressure")
    assert "from state 2 on ('plug', plug travel = 2)" in " ".join(record.warnings())
    assert f"50 % (state {half + 2}, air pressure = 2)" in " ".join(record.warnings())
    report.write(record, tmp_path / "run.html", "", None, MPI.COMM_WORLD, fx.Units("mm", "MPa"))
    assert "state kind plug travel, mm air pressure, MPa iterations" in page(tmp_path / "run.html")
    rows = [re.findall(r"<td.*?>(.*?)</td>", row) for row in report._iterations(record, fx.Units()).split("</tr>")]
    shown = {row[0]: row[2:4] for row in rows if row}
    assert shown["1"] == ["1", ""] and shown[str(n - 1)] == ["", str(n - 1 - half)]


def test_largest_vacuum(tmp_path):
    """A pressure below 0 is largest where its magnitude is."""
    path = fx.trace(treloar((10, 1)), until=fx.pressure(-0.3), progress=False)
    path.report(tmp_path / "run.html", units=fx.Units("cm", "kg/cm2"))
    assert "-0.3 kg/cm2 largest pressure" in page(tmp_path / "run.html")


def test_a_long_run_makes_a_small_file(formed, tmp_path):
    """300 states of a sheet of 40 elements: below 8 MB, plotly.js in it."""
    record = report.of_path(formed)
    times = -(-300 // len(formed))
    for name in ("kinds", "stages", "histories", "profiles", "fields", "travels"):
        setattr(record, name, getattr(record, name) * times)
    record.measures = {c: np.tile(v, times) for c, v in record.measures.items()}
    record.forces = {c: np.tile(v, times) for c, v in record.forces.items()}
    report.write(record, tmp_path / "long.html", "Long", None, MPI.COMM_WORLD)
    assert len(record.kinds) >= 300 and (tmp_path / "long.html").stat().st_size < 8e6
    run, = drawn(tmp_path / "long.html")["runs"]
    limits = [k for k, kind in enumerate(record.kinds) if kind == "limit point"]
    assert 80 < len(run["progress"]) == len(run["sheet"]["top"]) < 120
    assert {0, len(record.kinds) - 1, *limits} <= set(record.frames)
    assert np.diff(record.progress[record.frames]).max() < 0.05


def test_forces_of_tools_do_not_leap_between_states(formed):
    force, pressure = formed.curve("tool_force", "pressure", points=8)
    assert len(force) > 4 * len(formed)
    states = np.searchsorted(pressure, formed["pressure"])
    assert np.array_equal(force[states], formed["tool_force"])
    for a, b in zip(states, states[1:]):                    # monotone from one state to the next
        assert np.all(np.diff(force[a:b + 1]) * (force[b] - force[a]) >= 0)
    drawn = formed.plot("tool_force", "pressure").lines[0].get_ydata()
    assert drawn.max() == formed["tool_force"].max()


def test_warnings(formed, inflated):
    assert report.of_path(inflated).warnings() == []
    record = report.of_path(formed)
    worst = formed["volume_error"].max()                    # the corner of the clamped rim
    assert worst > 0.02 and [found.severity for found in record.all_findings()] == ["note"]
    last = formed["volume_error"][-1]
    assert f"J - 1 is {100 * last:.2g} %" in record.warnings()[0] and "clamped face" in record.warnings()[0]
    assert "% from 2 lengths of that face on" in record.warnings()[0]
    n = len(formed)
    record.measures |= {"penetration": np.full(n, 0.1), "mass_error": np.full(n, -0.02), "volume_error": np.zeros(n)}
    record.findings = []
    assert [w[:24] for w in record.warnings()] == ["The body penetrates a to", "The mass changes by up t"]


@pytest.mark.thorough
def test_report_of_a_warm_process(tmp_path, capsys):
    """Temperatures, conductances, values of functions without a name, what limited the steps; of a checkpoint, too."""
    sheet = fx.mesh.disc(radius=2.0, thickness=0.3, elements=(8, 1))
    soft = fx.Viscoelastic(fx.NeoHookean(c10=fx.of_temperature(lambda T: 10 / T)), branches=[(0.3, 0.5)])
    heat = fx.Cooling(fx.ThermalProperties(conductivity=1e-2, density=1.0, heat_capacity=1.0), unit="C",
                      tools={"plug": (0.025, 40.0)})
    scene = fx.Scene(mesh=sheet, materials=soft, temperature=100.0, heat=heat,
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")],
                     contacts=[fx.Contact("top", fx.tools.sphere(radius=1.0, z=0.3), "stick", direction=(0, -1),
                                          name="plug")])
    path = fx.Process(scene).run([fx.Stage("go_down", control="plug", until=fx.travel(0.5), speed=1.0),
                                  fx.Stage("hold", duration=1.0)], accuracy="draft", progress=False)
    path.report(tmp_path / "one.html", units=fx.Units("mm", "MPa"))
    path.save(tmp_path / "run")
    words = ["report", str(tmp_path / "run"), "--out", str(tmp_path / "two.html"), "--units", "mm,MPa",
             "--density", "1.2", "--trim", "1.5"]
    assert main(words) == 0 and main([*words[:4], "--units", "mm"]) == 2
    assert "must be LENGTH,STRESS" in capsys.readouterr().err
    for name in ("one", "two"):
        text, data = page(tmp_path / f"{name}.html"), drawn(tmp_path / f"{name}.html")
        for said in ("0.25 at 40, 0.1 at 100", "temperature, °C", "0.025", "heat_capacity=", "gap closure (",
                     "go down"):
            assert said in text
        assert "lambda" not in text and ("volume of the part" in text) == (name == "one")
        chart = next(chart for chart in data["charts"] if chart["title"] == "Temperature over time")
        last = [trace["y"][-1] for trace in chart["traces"]]
        profile = path.profile()
        faces = np.vstack([profile.reference_bottom, profile.reference_top])
        T = path.temperature(faces).reshape(2, -1).mean(0)
        assert last == pytest.approx([T.max(), T.mean(), T.min()], rel=1e-3) and T.min() < 95
        assert "temperature, °C" in data["runs"][0]["sheet"]["fields"]
        assert next(chart for chart in data["charts"] if chart["title"] == "Force over time")["y"] == "force, N"
    limits = path.counts.limits
    for command in (["status"], ["watch", "--patience", "0"]):
        assert main([*command, str(tmp_path / "run")]) == 0
    said, again = capsys.readouterr().out.split(f"{len(path)} states, stage 'hold': ")[1:]
    assert said == again and "process time 1.5 of 1.5" in said and "the target is met" in said
    assert "warning: temperature: The error" in said
    assert f"gap closure ({limits['gap closure']} times)" in said
    (tmp_path / "run" / "end.json").unlink()
    for k in range(len(path) - 2, len(path)):               # as it was two states earlier
        shutil.rmtree(tmp_path / "run" / f"{k:04d}")
    assert main(["status", str(tmp_path / "run")]) == 0 and "to the end of the stage" in capsys.readouterr().out
    for command in (["status"], ["watch", "--patience", "0"]):
        assert main([*command, str(tmp_path / "nothing")]) == 2


def test_findings_say_where_they_begin(formed):
    record = report.of_path(formed)
    n = len(formed)
    deep = np.where(np.arange(n) >= n // 2, 0.1, 0.0)
    record.measures |= {"penetration": deep, "mass_error": -deep, "volume_error": np.zeros(n)}
    record.findings = []
    assert all(f"from state {n // 2} on (pressure = " in text for text in record.warnings())
    assert len(record.warnings()) == 2


def test_the_report_names_an_inadmissible_state(inflated):
    record = report.of_path(inflated)
    record.inadmissible_reasons = ["the body folds" if k > 3 else "" for k in range(len(inflated))]
    found, = record.all_findings()
    assert found.severity == "serious" and "From state 4 on" in found.text
    assert "must not be used: the body folds" in found.text


def test_command_line(inflated, tmp_path, capsys):
    folder = tmp_path / "run"
    inflated.save(folder)
    assert main(["open", str(folder)]) == 0
    text = capsys.readouterr().out
    assert "NeoHookean(c10=2.0)" in text and text.count("limit point") == 1
    assert f"{inflated.last.measures['pressure']:.8g}" in text and "more states" not in text
    assert main(["report", str(folder), "--title", "From a checkpoint"]) == 0
    assert "From a checkpoint" in page(folder / "report.html") and "SimplySupported" in page(folder / "report.html")
    assert main(["report", str(folder), "--out", "/proc/report.html"]) == 2
    assert main(["open", str(tmp_path / "nothing")]) == 2
    error = capsys.readouterr().err
    assert "'/proc/report.html' could not be written" in error and "there is no folder" in error
    assert "Trace" not in error


def test_open_prints_a_short_summary(plugged, tmp_path, capsys):
    """The ends of the stages, limit points, states between them; what is driven by its own name."""
    path = fx.trace(treloar((6, 1)), until=fx.pole_stretch(3.0), step=fx.StepControl(largest=0.05), progress=False)
    (limit,), rows = path.limit_points, []
    for one, folder in ((path, tmp_path / "long"), (plugged, tmp_path / "staged")):
        one.save(folder)
        assert main(["open", str(folder)]) == 0
        text = capsys.readouterr().out
        rows = [line.split() for line in text.splitlines() if line[:5].strip().isdigit()]
        shown, left = {int(row[0]) for row in rows}, len(one) - len(rows)
        assert {0, len(one) - 1} <= shown and len(rows) <= 24
        assert (f"({left} more states)" in text) == (left > 0) == (one is path)
        assert one is plugged or path.states.index(limit) in shown
    assert "plug travel" in text and [row[-1] for row in rows] == [state.stage for state in plugged.states]
    assert main(["report", str(folder)]) == 0
    assert str(folder / "report.html") in capsys.readouterr().out


@pytest.mark.parametrize("name, states, message", [
    ("run.vtu", None, "must end in .pvd"), ("run.pvd", "some", "states = 'some'"),
    ("run.pvd", [], "one or more states"), ("run.pvd", [3], "must be one or more states")])
def test_vtk_bad_input(inflated, tmp_path, name, states, message):
    with pytest.raises(fx.InputError, match=message):
        inflated.to_vtk(tmp_path / name, states)


def test_a_view_is_a_png(inflated, tmp_path):
    with pytest.raises(fx.InputError, match="must end in .png"):
        inflated.view3d(tmp_path / "view.svg")
    with pytest.raises(fx.InputError, match="view3d: file = 3: must be the name of a file"):
        inflated.view3d(3)


@pytest.mark.parametrize("write", ["to_vtk", "to_csv", "animate", "report"])
def test_unwritable(inflated, write):
    suffix = {"to_vtk": "pvd", "to_csv": "csv", "animate": "gif", "report": "html"}[write]
    with pytest.raises(OSError, match=r"'/proc/run(-\d+)?\.[a-z]+' could not be written"):
        getattr(inflated, write)(f"/proc/run.{suffix}", **{"frames": 2} if write == "animate" else {})


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["to_csv", "report", "animate", "view3d", "mesh"])
def test_writing_keeps_pipes_links_and_file_modes(inflated, tmp_path, name):
    """What is no regular file is written to; a link stays one, a mode and its file too; nothing is left beside."""
    ending = {"to_csv": "csv", "report": "html", "animate": "gif", "view3d": "png", "mesh": "msh"}[name]
    write = partial(inflated.animate, frames=2) if name == "animate" else getattr(
        inflated, name, lambda file: fx.mesh.write(inflated.problem.scene.mesh, file))
    pipe, file, link = (tmp_path / f"{word}.{ending}" for word in ("pipe", "file", "link"))
    os.mkfifo(pipe)
    with ThreadPoolExecutor() as pool:
        read = pool.submit(pipe.read_bytes)
        write(pipe)
        assert len(read.result(10)) > 200 and pipe.is_fifo()
    write(file)
    before = file.read_bytes()
    file.write_text("earlier")
    file.chmod(0o600)
    link.symlink_to(file.name)
    write(link)
    assert link.is_symlink() and file.stat().st_mode & 0o777 == 0o600 and len(file.read_bytes()) == len(before)
    assert len(list(tmp_path.iterdir())) == 3
    with pytest.raises(OSError, match="full.* could not be written"):
        (tmp_path / f"full.{ending}").symlink_to("/dev/full")
        write(tmp_path / f"full.{ending}")
    assert FilePath("/dev/full").is_char_device()


def test_a_checkpoint_says_how_its_run_ended(tmp_path, capsys):
    """What a run said when it ended stands in its folder: in a report of it, too; a run that goes on takes it away."""
    body = treloar()
    with pytest.raises(fx.ConvergenceError) as failed:
        fx.trace(body, until=fx.pressure(50.0), checkpoint=tmp_path / "run", max_steps=5, progress=False)
    assert main(["watch", str(tmp_path / "run")]) == 0                 # it does not wait for more
    said = capsys.readouterr().out
    assert "the run could not go on" in said and str(failed.value).split(":")[0] in said
    assert main(["report", str(tmp_path / "run")]) == 0
    assert "The run could not go on" in page(tmp_path / "run" / "report.html")
    start = fx.load(tmp_path / "run", body)
    path = fx.trace(body, until=fx.pole_height(0.1 + start.last.measures["pole_height"]), start=start, progress=False,
                    checkpoint=tmp_path / "run")
    (tmp_path / "run" / "end.json").unlink()
    path.findings = lambda: [Finding("warning", "snap-through", "it snapped")]
    path.save(tmp_path / "run")
    assert main(["status", str(tmp_path / "run")]) == 0
    said = capsys.readouterr().out
    assert "the target is met" in said and "could not go on" not in said and "warning: snap-through: it snapped" in said
    record = report.of_checkpoint(*checkpoint_data.contents(tmp_path / "run"))
    assert Finding("warning", "snap-through", "it snapped") in record.all_findings()


@pytest.mark.parametrize("words, there", [
    ("there is no folder", None), ("is empty", ""), ("folder of a study", "study.json"),
    ("folders that do: 3", "3/scene.json"), ("holds no run", "notes.txt")])
def test_folders_without_a_run(tmp_path, capsys, words, there):
    folder = tmp_path / "ein Ordner für ihn"
    if there is not None:
        folder.mkdir()
        (folder / there).parent.mkdir(exist_ok=True)
        (folder / there).touch() if there else None
    for command in (["status"], ["open"], ["report"], ["watch", "--patience", "0.01"]):
        assert main([*command, str(folder)]) == 2
    out, err = capsys.readouterr()
    assert err.count(words) == 4 and ("waiting" in out) == (not there)


def test_a_stage_of_a_run_without_stages(inflated):
    with pytest.raises(fx.InputError, match="the run has no stages"):
        inflated.state(stage="hold")
