"""A run costs little more than its linear algebra."""

import json
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT, run
from scipy.spatial import cKDTree

import formingx as fx
from formingx.forms.material_history import MaterialHistory
from formingx.mesh import nodes as mesh_nodes
from formingx.solve.newton import BorderedNewton

sys.path.insert(0, str(ROOT / "benchmarks"))
import limit  # noqa: E402


def test_closed_forms_are_reached_by_their_names():
    """As the pages name them; each module is loaded at its first use."""
    assert fx.exact.inflation.membrane_inflation is not None and {"heat", "time"} <= set(dir(fx.exact))
    with pytest.raises(AttributeError, match="no attribute 'inflations'; it has heat"):
        fx.exact.inflations  # noqa: B018


def test_completion_lists_what_users_meet():
    """No folders of the package, and nothing that its files import."""
    listed = {name for module in (fx, fx.mesh, fx.tools) for name in dir(module) if not name.startswith("__")}
    assert {"Scene", "trace", "disc", "tube", "cup", "solid", "mesh", "tools", "exact"} <= listed
    assert not {"MPI", "forms", "problem", "build", "shapes", "optional"} & listed
    assert not any(name.startswith("_") for name in listed)


def test_importing_loads_no_optional_modules():
    code = "import sys, formingx; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert "formingx.extensions.heat" in loaded
    assert {"gmsh", "matplotlib", "plotly", "pyvista", "scipy", "tqdm"}.isdisjoint(loaded)


@pytest.mark.thorough
def test_a_picture_does_not_load_pyplot():
    """PyVista imports it for charts, which are drawn nonetheless."""
    code = """import sys
from formingx import figures
pyvista = figures.pyvista()
print("matplotlib.pyplot" in sys.modules, pyvista.plotting.charts.plt.get_fignums(), "matplotlib.pyplot" in sys.modules)
import matplotlib.pyplot
print(matplotlib.pyplot.get_fignums())"""
    printed = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert printed == "False [] True\n[]\n"


def test_nearest_points_equal_those_of_a_search_tree():
    points, places = (np.random.default_rng(k).random((n, 2)) for k, n in ((1, 60), (2, 50)))
    places = places.reshape(2, 25, 2)
    for found, wanted in zip(mesh_nodes.nearest(points, places), cKDTree(points).query(places)):
        assert np.array_equal(found, wanted)


def test_a_run_costs_little_more_than_its_linear_algebra():
    limit.measure(limit.inflation, (10, 1))                 # imports and forms
    found = limit.measure(limit.inflation, (40, 2))
    assert 0.5 < found["ratio"] < 3 and found["iterations"] < 58


def cup(friction="stick", **options):
    """The cup of the benchmark, coarse."""
    scene, _ = limit.cup((20, 1))
    return limit.fx.Scene(mesh=scene.mesh, materials=scene.materials, supports=scene.supports, loads=scene.loads,
                          contacts=[limit.fx.Contact("top", scene.contacts[0].tool, friction, **options)])


def test_tool_distances_are_evaluated_once_for_the_same_points(monkeypatch):
    """Of 19 evaluations a state, beside those of iterations, four follow its points and three check the state.

    (Contact events that are predicted one after the other need more evaluations a state, and fewer in all.)
    """
    calls, nearest = [0], limit.fx.Tool.nearest

    def counted(self, x):
        calls[0] += 1
        return nearest(self, x)
    monkeypatch.setattr(limit.fx.Tool, "nearest", counted)
    looks = []
    for nodes in (1, None):
        path = limit.fx.trace(cup(nodes_per_step=nodes), until=limit.fx.pressure(8.0), progress=False,
                              step=limit.fx.StepControl(target=8))
        looks.append(calls[0] - sum(looks))
        assert nodes is None or looks[0] < 2 * path.counts.iterations + 19 * len(path)
    assert looks[1] < looks[0]


@pytest.mark.parametrize("friction", ["stick", "none"])
def test_the_path_tangent_uses_the_stored_factors(monkeypatch, friction):
    update_one_sided, found, changed = BorderedNewton.update_one_sided, [], [0.0]

    def beside_other_factors(self, x, control):
        before = self.b.array_r.copy()
        found.append(update_one_sided(self, x, control))
        now = self.b.array_r.copy()
        assert self.tangent(x, control, one_sided=True)
        size = np.abs(self.b.array_r).max()
        changed.append(np.abs(now - before).max() / size)
        np.testing.assert_allclose(now, self.b.array_r, atol=1e-6 * size)
        return True
    monkeypatch.setattr(BorderedNewton, "update_one_sided", beside_other_factors)
    fx = limit.fx
    path = fx.trace(cup(friction, nodes_per_step=1), until=fx.pressure(8.0), progress=False,
                    tolerances=fx.Tolerances(correction=1e-14))     # the last factors are those of the state
    assert all(found) and len(path) - 2 <= len(found) < len(path)
    assert (max(changed) > 1e-3) == (friction == "stick")           # nodes that have just arrived


def test_internal_variables_are_computed_four_times_per_step(monkeypatch):
    """Once, in two halves for the error, and half way for the energy dissipated (Simpson's rule): an accepted state
    takes the predicted values."""
    calls, after = [0], MaterialHistory._values_at_end

    def counted(self, cells):
        calls[0] += 1
        return after(self, cells)
    monkeypatch.setattr(MaterialHistory, "_values_at_end", counted)
    fx = limit.fx
    mesh = fx.mesh.disc(radius=2.0, inner_radius=1.0, thickness=0.5, elements=(2, 1))
    scene = fx.Scene(mesh=mesh, materials=fx.Viscoelastic(fx.NeoHookean(c10=0.05), branches=[(0.3, 0.5), (0.4, 5.0)]),
                     supports=[fx.Symmetry("bottom", "z"), fx.Symmetry("top", "z")], loads=[fx.Pressure("inner")])
    amplitudes = {lambda value: fx.displacement(value, at=(1.0, 0.0), component="r"): [(0, 0), (1, 1)]}
    path = fx.Process(scene).run([fx.Stage("widen", control=scene.loads[0], amplitudes=amplitudes)], progress=False)
    assert len(path) > 8 and calls[0] <= 4 * (path.counts.steps + path.counts.failures) + 2
    before, last = path.states[-2:]
    with path.problem.state_context(last) as problem:
        problem.history.variables = before.history_variables
        problem.history.advance(last.x, last.control)
        for name, values in problem.history.variables[0].values.items():
            np.testing.assert_array_equal(values, last.history_variables[0].values[name])


@pytest.mark.thorough
def test_peers_measures_what_is_there(tmp_path):
    printed = run("benchmarks/peers.py", "--codes", "formingx", "--only", "treloar", "--sizes", "10x1", "20x1",
                  "--repeat", "1", "--out", tmp_path)
    coarse, fine = json.loads((tmp_path / "summary.json").read_text())["treloar"]
    assert 1e-4 < coarse["error"] < 2e-3 and fine["error"] == 0
    assert fine["limit"] == pytest.approx(0.493271, abs=5e-6) and fine["pressure"] == pytest.approx(0.33387, rel=1e-4)
    assert "| 20 x 1 | formingx | 448 |" in printed and (tmp_path / "peers.png").exists()
