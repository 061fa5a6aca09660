"""Parameter studies: all combinations, failed runs, continued folders, effects, the best run."""

import dataclasses
import logging
import math
import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import treloar
from mpi4py import MPI

import formingx as fx

RUNS = []


def doubtful(x):
    """In place of a run that warns."""
    logging.getLogger("formingx").warning("the body folds at %g", x)
    return SimpleNamespace(f=x)


def formula(x, y):
    """In place of a run: f = -(x - 1)^2 - 3 (y - 2)^2, g = x; fails at x = 3."""
    RUNS.append((x, y))
    if x == 3:
        raise fx.ConvergenceError("no state was found")
    return SimpleNamespace(f=-((x - 1) ** 2) - 3 * (y - 2) ** 2, last=SimpleNamespace(measures={"g": x}))


def f(path):
    return path.f


def inflate(modulus):
    scene = treloar((6, 1), stress=1 / modulus, comm=MPI.COMM_SELF)
    return fx.trace(scene, until=fx.pole_stretch(1.5), progress=False)


@pytest.fixture
def here():
    RUNS.clear()
    with ThreadPoolExecutor(1) as pool:
        yield pool


def run(pool, x=(0, 1, 2), y=(1, 2), **more):
    return fx.study(formula, {"x": x, "y": y}, {"f": f, "g": "g"}, goal={"f": "max", "g": "min"}, executor=pool,
                    progress=False, **more)


def test_all_combinations(here, tmp_path):
    found = run(here)
    assert [run.values for run in found.runs] == [{"x": x, "y": y} for x in (0, 1, 2) for y in (1, 2)]
    assert found.best.values == {"x": 1, "y": 2} and found.best.measures == {"f": 0, "g": 1}
    effects = found.effects("f")
    assert effects["x"] == pytest.approx({0: -2.5, 1: -1.5, 2: -2.5})
    assert effects["y"] == pytest.approx({1: -11 / 3, 2: -2 / 3})
    assert [run.values for run in found.pareto("f", "g")] == [{"x": 0, "y": 2}, {"x": 1, "y": 2}]
    found.to_csv(tmp_path / "all.csv")
    assert (tmp_path / "all.csv").read_text().splitlines()[:2][0] == "x,y,f,g,seconds,error"
    found.report(tmp_path / "all.html")
    assert (tmp_path / "all.html").read_text().count("data:image/png") == 3
    with pytest.raises(fx.InputError, match="measure 'h' is not known"):
        found.effects("h")


def test_the_page_of_a_study_has_names_and_units(here, tmp_path):
    found = fx.study(formula, {"x": [0, 1], "y": [1, 2]}, {"pole_height": f, "tool": "g"}, executor=here,
                     progress=False, goal={"pole_height": "max", "tool": "min"})
    found.report(tmp_path / "all.html", units=fx.Units(length="mm", stress="MPa"), labels={"x": "modulus, MPa"})
    page = (tmp_path / "all.html").read_text()
    assert "best (max pole height, min tool): modulus = 1, y = 2, pole height = " in page
    for head in ("modulus, MPa", "y, mm", "pole height, mm", "tool", "run time, s", "failure"):
        assert f">{head}</th>" in page, head
    assert "pole_height" not in page and "seconds" not in page
    assert found.plot_effects("pole_height", fx.Units(length="mm")).axes[0].get_ylabel() == "pole height, mm"
    assert "pole_height" in str(found)
    with pytest.raises(fx.InputError, match="labels: 'z' is not known"):
        found.report(tmp_path / "all.html", labels={"z": "depth"})


def test_main_effects_do_not_depend_on_failed_runs(here):
    """The best runs at y = 2 are missing: y = 2 is better by 3 all the same, as in each pair of runs."""
    found = run(here)
    found.runs = [one for one in found.runs if one.values not in ({"x": 1, "y": 2}, {"x": 2, "y": 2})]
    effects = found.effects("f")
    assert effects["y"][2] - effects["y"][1] == pytest.approx(3)
    assert effects["x"][1] - effects["x"][0] == pytest.approx(1) == effects["x"][1] - effects["x"][2]


def test_a_failed_run_does_not_stop_a_study(here):
    found = run(here, x=(3, 1))
    assert [bool(r.error) for r in found.runs] == [True, True, False, False]
    assert "ConvergenceError: no state was found" in str(found) and "2 failed" in str(found)
    assert np.isnan(found.columns["f"][0]) and found.best.values == {"x": 1, "y": 2}
    with pytest.raises(fx.InputError, match="all runs failed"):
        _ = run(here, x=(3,)).best


def test_a_study_continues_from_its_folder(here, tmp_path):
    run(here, x=(0, 1), folder=tmp_path / "runs")
    assert len(RUNS) == 4
    found = run(here, x=(0, 1, 2), folder=tmp_path / "runs")
    assert RUNS[4:] == [(2, 1), (2, 2)] and len(found.runs) == 6
    assert [tuple(r.values.values()) for r in found.runs] == [(x, y) for x in (0, 1, 2) for y in (1, 2)]
    again = run(here, folder=tmp_path / "runs")
    assert len(RUNS) == 6 and again.runs == found.runs
    with pytest.raises(fx.InputError, match="holds another study"):
        fx.study(formula, {"x": [1.0], "y": [1.0]}, {"f": f}, executor=here, folder=tmp_path / "runs")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("mine")
    with pytest.raises(fx.InputError, match="holds no study"):
        run(here, folder=tmp_path / "other")


def test_a_best_value_at_the_edge_of_its_range_is_reported(here):
    text = str(run(here, x=(0, 1, 2), y=(1, 1.5)))           # the best is at (1, 2)
    assert "the best is at the edge of y, which was run from 1 to 1.5: a better one may lie above" in text
    assert "edge of x" not in text and "edge" not in str(run(here, x=(0, 1, 2), y=(1, 2, 3)))


def test_warnings_name_their_run(here, caplog, tmp_path):
    found = fx.study(doubtful, {"x": [2, 3]}, {"f": f}, executor=here, progress=False, folder=tmp_path / "runs")
    assert [run.warnings for run in found.runs] == [["the body folds at 2"], ["the body folds at 3"]]
    assert "warning: x = 2: the body folds at 2\nwarning: x = 3: the body folds at 3" in str(found)
    assert caplog.messages == ["run x = 2: the body folds at 2", "run x = 3: the body folds at 3"]
    logging.getLogger("formingx").warning("after the runs")
    assert caplog.messages[-1] == "after the runs"
    again = fx.study(doubtful, {"x": [2, 3]}, {"f": f}, executor=here, progress=False, folder=tmp_path / "runs")
    assert again.runs == found.runs


def test_an_error_too_long_for_excel(here, tmp_path):
    found = run(here, x=(0, 1))
    for error in ("x" * 40_000, "\x01x"):
        found.runs[1] = dataclasses.replace(found.runs[1], error=error)
        with pytest.raises(fx.InputError, match=f"column 'error', row 2: {len(error)} characters, .* Excel cell holds"):
            found.to_excel(tmp_path / "all.xlsx")
        assert not (tmp_path / "all.xlsx").exists()


def test_no_run_of_a_folder_is_written_over(here, tmp_path):
    """A file that was removed leaves a gap, which no other run's number comes from."""
    run(here, x=(0, 1), folder=tmp_path)
    next(tmp_path.glob("run-00001*.json")).unlink()
    kept = {file: file.read_text() for file in tmp_path.glob("run-*.json")}
    found = run(here, x=(0, 1, 2), folder=tmp_path)
    assert len(found.runs) == 6 and all(file.read_text() == text for file, text in kept.items())
    assert run(here, folder=tmp_path).runs == found.runs and len(RUNS) == 7


@pytest.mark.parametrize("text", ["", "{", "[]", "3", '{"values": {"x": 1}}', '{"values": {"x": 0, "y": NaN}}', "\xff",
                                  '{"values": {"x": 0, "y": 1}, "measures": 3}', '{"valves": {}}', "[" * 100_000])
@pytest.mark.parametrize("name", ["run-00002", "study"])
def test_a_damaged_folder_is_refused(here, tmp_path, text, name):
    run(here, x=(0, 1), folder=tmp_path)
    file = next(tmp_path.glob(f"{name}*.json"))
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(fx.InputError, match=f"{name}.*is damaged|holds another study"):
        run(here, folder=tmp_path)


def test_refining_finds_the_maximum_between_the_levels(here):
    """The maximum of the quadratic at (1, 2), which no run of the design is at."""
    found = run(here, x=(0.0, 2.5), y=(0.5, 3.0))
    before = found.best.measures["f"]
    best = found.refine(evaluations=60, executor=here)
    assert best.measures["f"] > before and len(found.runs) <= 4 + 60
    assert (best.values["x"], best.values["y"]) == (pytest.approx(1, abs=0.03), pytest.approx(2, abs=0.03))


def test_wrong_arguments_of_studies_are_refused():
    both = {"x": [1], "y": [1]}
    for given, message in (((both, {"f": lambda path: 1.0}), "importable by name"), (({}, {"f": f}), "variables"),
                           (({"x": ["a"]}, {"f": f}), "study: x = 'a'"), ((both, {}), "measures = {}"),
                           (({"x": [1]}, {"f": f}), "cannot be called with these: missing .* 'y'"),
                           ((both | {"z": [1]}, {"f": f}), "cannot be called with these: .* 'z'")):
        with pytest.raises(fx.InputError, match=message):
            fx.study(formula, *given, progress=False)
    with pytest.raises(fx.InputError, match="goal of f: 'big' is not known"):
        fx.study(formula, both, {"f": f}, goal={"f": "big"})
    with pytest.raises(fx.InputError, match="workers = 0: must be a whole number of at least 1"):
        fx.study(formula, both, {"f": f}, workers=0)
    with pytest.raises(fx.InputError, match=r"goal = 'f': must be a dict \{a word: a word\} or None"):
        fx.study(formula, both, {"f": f}, goal="f")


def test_a_run_that_failed_by_a_fault_of_the_script_is_repeated(here, tmp_path):
    def study(measure):
        return fx.study(formula, {"x": [1, 3], "y": [2]}, {"f": measure}, executor=here, progress=False,
                        folder=tmp_path / "runs")
    assert [run.error[:10] for run in study(lambda path: path.F).runs] == ["AttributeE", "Convergenc"]
    for _ in range(2):
        assert [run.error[:10] for run in study(f).runs] == ["", "Convergenc"]
    assert RUNS == [(1, 2), (3, 2), (1, 2)]


def test_an_unknown_column_is_named_with_the_known_ones(here):
    found = fx.study(formula, {"x": [1], "y": [2]}, {"f": "presure"}, executor=here, progress=False)
    assert found.runs[0].error == "InputError: measure 'f': column 'presure' is not known; known: 'g'"


@pytest.mark.thorough
def test_runs_in_processes():
    """A neo-Hookean sheet's pressure is proportional to its modulus."""
    found = fx.study(inflate, {"modulus": [1.0, 3.0]}, {"p": "pressure"}, workers=2, progress=False)
    a, b = (run.measures["p"] for run in found.runs)
    assert b == pytest.approx(3 * a, rel=1e-8) and math.isfinite(a) and found.columns["seconds"].min() > 0


def fake_study(rows, goal):
    """A study whose runs are given, (values, measures)."""
    from formingx.extensions.study.study import Study, StudyRun
    study = Study(SimpleNamespace(measures=dict.fromkeys(rows[0][1])), list(rows[0][0]), goal, None)
    fields = {field.name for field in dataclasses.fields(StudyRun)}
    for values, measures in rows:
        given = {"values": values, "measures": measures, "seconds": 0.0, "error": "", "number": 0, "findings": []}
        study.runs.append(StudyRun(**{name: given[name] for name in fields if name in given}))
    return study


def test_sobol_indices_of_a_polynomial():
    """y = 4 a + 2 b + a b on [-1, 1]^3: variances 16/3, 4/3 and 1/9; c has no effect."""
    grid = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1).T
    study = fake_study([({"a": a, "b": b, "c": c}, {"y": 4 * a + 2 * b + a * b}) for a, b, c in grid], {"y": "max"})
    found, total = study.sensitivities("y"), 16 / 3 + 4 / 3 + 1 / 9
    assert list(found.total)[:2] == ["a", "b"] and found.deviation < 1e-9
    assert found.first["a"] == pytest.approx(16 / 3 / total, abs=0.02)
    assert found.total["b"] == pytest.approx((4 / 3 + 1 / 9) / total, abs=0.02) and found.total["c"] < 0.01
    assert "total" in str(found)
    with pytest.raises(fx.InputError, match="is not known"):
        study.sensitivities("z")


def test_studies_of_one_value_or_no_run():
    """A single variable causes the whole variance; without a range or a run there is a message."""
    study = fake_study([({"a": a}, {"y": a**2}) for a in (1.0, 2.0, 3.0, 4.0)], {"y": "max"})
    found = study.sensitivities("y")
    assert found.total == found.first == {"a": 1.0} and found.deviation < 1e-9
    with pytest.raises(fx.InputError, match="no variable was varied: give ranges"):
        fake_study([({"a": 1.0}, {"y": 1.0})], {"y": "max"}).refine(evaluations=2)
    study.runs.clear()
    with pytest.raises(fx.InputError, match="no run succeeded"):
        study.effects("y")


def test_pareto_front_of_the_goal_ends_its_line_at_a_gap():
    rows = [({"x": x}, {"a": x, "b": 1 - x}) for x in (0.0, 0.1, 0.2, 0.3, 0.9, 1.0)]
    study = fake_study(rows, {"a": "max", "b": "max"})
    assert len(study.pareto()) == 6
    line = study.plot_pareto().axes[0].lines[-1]
    assert np.isnan(line.get_xdata()).sum() == 1
    with pytest.raises(fx.InputError, match="needs two measures"):
        fake_study(rows, {"a": "max"}).pareto()


def test_a_study_on_a_dask_cluster(here, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.Client(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as client:
        found = run(client.get_executor(), folder=tmp_path / "study")
    assert len(found.successful) == len(found.runs)


def slow_square(x):
    """In place of a run of half a second; writes that it ran."""
    time.sleep(0.5)
    Path(f"ran_{x}_{os.getpid()}").touch()
    return SimpleNamespace(f=x * x)


@pytest.mark.thorough
def test_a_killed_dask_worker_loses_no_run_that_has_ended(tmp_path, monkeypatch):
    """Of eight runs on two workers, one killed after a while, all are found; none that had ended runs again."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.chdir(tmp_path)
    with (distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
          distributed.Client(cluster) as client):
        victim = next(iter(client.run(os.getpid).values()))

        def kill():
            while len(list(tmp_path.glob("ran_*"))) < 4:
                time.sleep(0.01)
            os.kill(victim, signal.SIGKILL)
        threading.Thread(target=kill, daemon=True).start()
        found = fx.study(slow_square, {"x": list(range(8))}, {"f": f}, folder="study", executor=client.get_executor(),
                         progress=False)
    assert sorted(run.measures["f"] for run in found.successful) == [x * x for x in range(8)]
    assert len(list(tmp_path.glob("ran_*"))) <= 9                       # at most the run that was killed at its end
