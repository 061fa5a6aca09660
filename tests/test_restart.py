"""Checkpoints: a continued run equals an uninterrupted one; messages for damaged or foreign checkpoints."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import ROOT, run_script, treloar
from test_contact import cup

import formingx as fx
from formingx.measures import columns
from formingx.results.files import checkpoint, checkpoint_data

SCENES = {"hinged": (treloar, fx.pole_stretch(3.0)), "stick": (lambda: cup("stick"), fx.pressure(8.0)),
          "coulomb": (lambda: cup(0.3), fx.pressure(8.0)),
          "membrane": (lambda: treloar(model=fx.Membrane()), fx.pole_stretch(3.0))}
OTHER_RANKS = """
import sys
sys.path.insert(0, "tests")
import formingx as fx
from test_restart import SCENES
make, until = SCENES[{name!r}]
scene = make()
start = fx.load({folder!r}, scene, state={state}) if {state} is not None else None
fx.trace(scene, until=until, start=start, progress=False).save({out!r})
"""


def numbers(path):
    """All measures of all states, those that are round-off only (mass error) left out."""
    return np.array([[s.measures[c] for c in path.columns if c != "mass_error"] for s in path.states])


def same(path, other, rel=1e-9):
    assert [s.kind for s in path.states] == [s.kind for s in other.states]
    np.testing.assert_allclose(numbers(path), numbers(other), rtol=rel, atol=1e-12)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """{scene: (its folder, the scene, the path of an uninterrupted run)}."""
    found = {}
    for name, (make, until) in SCENES.items():
        folder, scene = tmp_path_factory.mktemp("runs") / name, make()
        found[name] = folder, scene, fx.trace(scene, until=until, progress=False, checkpoint=folder)
    return found


@pytest.mark.quick
@pytest.mark.parametrize("name", SCENES)
def test_a_run_continues_from_any_state_to_the_same_path(name, whole):
    folder, scene, path = whole[name]
    same(fx.load(folder, scene), path, rel=0)
    for state in (0, len(path) // 2, len(path) - 2):
        again = fx.trace(scene, until=SCENES[name][1], start=fx.load(folder, scene, state), progress=False)
        same(again, path)
        if path.states[state].stepping:
            assert (again.counts.steps, again.counts.iterations) == (path.counts.steps, path.counts.iterations)


@pytest.mark.thorough
@pytest.mark.quick
@pytest.mark.parametrize("name, ranks", [("hinged", (1, 2)), ("hinged", (2, 1)), ("stick", (1, 2)), ("stick", (2, 1)),
                                         ("membrane", (1, 2))])
def test_on_another_number_of_ranks(name, ranks, whole, tmp_path):
    folder, scene, path = whole[name]
    made = folder
    if ranks[0] > 1:
        made = tmp_path / "made"
        run_script(OTHER_RANKS.format(name=name, folder="", state=None, out=str(made)), ranks=ranks[0])
    if ranks[1] > 1:
        out = tmp_path / "out"
        run_script(OTHER_RANKS.format(name=name, folder=str(made), state=len(path) // 2, out=str(out)), ranks=ranks[1])
        same(fx.load(out, scene), path)
    else:
        start = fx.load(made, scene, state=len(path) // 2)
        same(fx.trace(scene, until=SCENES[name][1], start=start, progress=False), path)


def test_a_run_continues_to_another_target(whole, tmp_path):
    folder, scene, path = whole["hinged"]
    further = fx.trace(scene, until=fx.pole_stretch(4.0), start=path, progress=False)
    assert len(further) > len(path) == len(fx.load(folder, scene))
    assert further.last.measures["pressure"] == pytest.approx(0.4390, rel=5e-3)
    assert fx.trace(scene, until=SCENES["hinged"][1], start=path, progress=False).last is path.last
    copy = tmp_path / "copy"
    path.save(copy)
    path.save(copy)                                       # there is nothing more to write
    assert len(fx.load(copy, scene)) == len(path)
    fx.trace(scene, until=fx.pole_stretch(4.0), start=fx.load(copy, scene), progress=False, checkpoint=copy)
    same(fx.load(copy, scene), further)


def test_a_state_is_stored_with_one_set_of_history_variables(whole):
    """Files hold the history variables after a state only: those before it are the ones of an earlier state."""
    folder, scene, path = whole["stick"]
    before = path.states[-1].history_variables_before[0]
    assert before.history.position.shape == path.states[-1].history_variables[0].history.position.shape
    assert not any(state.history_variables_before for state in fx.load(folder, scene).states)
    data = checkpoint_data.read_data(folder, len(path) - 1)
    assert len(data["memory"]) == len(path.problem.history.parts) and "history_variables_before" not in data


def test_a_run_that_fails_leaves_its_states(tmp_path):
    scene = treloar()
    with pytest.raises(fx.ConvergenceError) as caught:
        fx.trace(scene, until=fx.pole_stretch(8.0), max_steps=3, progress=False, checkpoint=tmp_path / "run")
    path = fx.load(tmp_path / "run", scene)
    same(path, caught.value.path)
    assert fx.trace(scene, until=fx.pole_stretch(2.0), start=path, progress=False).last.measures["pole_stretch"] \
        == pytest.approx(2.0)


def test_solve_is_saved_too(tmp_path):
    scene = treloar()
    path = fx.solve(scene, to=0.3, increments=3)
    path.save(tmp_path / "run")
    found = fx.trace(scene, until=fx.pressure(0.45), start=fx.load(tmp_path / "run", scene), progress=False)
    assert found["pressure"][-1] == pytest.approx(0.45) and len(found) > len(path)


KILLED = """
import sys
sys.path.insert(0, "tests")
import formingx as fx
from test_restart import SCENES
make, until = SCENES["stick"]
print("begins", flush=True)
fx.trace(make(), until=until, progress=False, checkpoint=sys.argv[1])
"""


def killed_after(seconds, folder):
    """Kill -9 a run so long after its first state; True if it was still running."""
    child = subprocess.Popen([sys.executable, "-c", KILLED, str(folder)], cwd=ROOT, stdout=subprocess.DEVNULL)
    while not (folder / "0000").exists() and child.poll() is None:
        time.sleep(0.001)
    time.sleep(seconds)
    running = child.poll() is None
    child.send_signal(signal.SIGKILL)
    child.wait()
    return running


def test_a_shorter_path_deletes_no_stored_state(tmp_path):
    scene = treloar()
    fx.solve(scene, to=0.3, increments=3).save(tmp_path / "solved")
    fx.trace(scene, until=fx.pole_stretch(1.5), progress=False, checkpoint=tmp_path / "traced")
    for folder in (tmp_path / "solved", tmp_path / "traced"):
        before = sorted(map(str, folder.rglob("*")))
        for start in (None, fx.load(folder, scene, 1)):
            with pytest.raises(fx.InputError, match="states of another run"):
                fx.trace(scene, until=fx.pole_stretch(1.5), start=start, progress=False, checkpoint=folder)
        assert sorted(map(str, folder.rglob("*"))) == before


@pytest.mark.thorough
def test_killed_at_any_moment(whole, tmp_path):
    _, scene, path = whole["stick"]
    rng = np.random.default_rng(int.from_bytes(os.urandom(4), "little"))
    for k in range(2):
        folder = tmp_path / f"run{k}"
        seconds = rng.uniform(0, 0.6)
        running = killed_after(seconds, folder)
        left = fx.load(folder, scene)
        assert 1 <= len(left) <= len(path), seconds
        again = fx.trace(scene, until=SCENES["stick"][1], start=left, progress=False, checkpoint=folder)
        same(again, path)
        same(fx.load(folder, scene), path)
        assert running or len(left) == len(path)


@pytest.mark.slow
def test_killed_at_fifty_moments(whole, tmp_path):
    _, scene, path = whole["stick"]
    for k, seconds in enumerate(np.random.default_rng(1).uniform(0, 0.8, 50)):
        killed_after(seconds, tmp_path / f"run{k}")
        left = fx.load(tmp_path / f"run{k}", scene)
        same(fx.trace(scene, until=SCENES["stick"][1], start=left, progress=False), path)


@pytest.fixture
def copied(whole, tmp_path):
    shutil.copytree(whole["hinged"][0], tmp_path / "run")
    return tmp_path / "run", whole["hinged"][1]


@pytest.mark.parametrize("file", ["0003/arrays.bin", "0003/state.json", "scene.json"])
@pytest.mark.parametrize("how", ["cut", "changed", "gone", "empty"])
def test_damaged_checkpoint_files_are_refused(file, how, copied):
    folder, scene = copied
    victim = folder / file
    content = victim.read_bytes()
    if how == "gone":
        victim.unlink()
    else:
        changed = bytearray(content)
        changed[len(content) // 2] ^= 0xFF
        victim.write_bytes({"cut": content[:-7], "empty": b"", "changed": bytes(changed)}[how])
    with pytest.raises(fx.InputError, match="damaged|not there"):
        fx.load(folder, scene)


def test_histories_are_saved_as_arrays(whole):
    """Histories are saved as arrays: state.json does not grow with the mesh."""
    folder, _, path = whole["coulomb"]
    for k in range(len(path)):
        variables = json.loads((folder / f"{k:04d}" / "state.json").read_text())["memory"]
        assert len(json.dumps(variables)) < 600, variables


def test_a_changed_digit_in_a_checkpoint_is_detected(copied):
    folder, scene = copied
    file = folder / "0003" / "state.json"
    text = file.read_text()
    k = text.index('"control": ') + 16
    file.write_text(text[:k] + str((int(text[k]) + 1) % 10) + text[k + 1:])
    with pytest.raises(fx.InputError, match="0003' is damaged"):
        fx.load(folder, scene)
    assert len(fx.load(folder, scene, state=2)) == 3


def test_a_state_that_is_missing(copied):
    folder, scene = copied
    shutil.rmtree(folder / "0002")
    with pytest.raises(fx.InputError, match="state 2 is missing"):
        fx.load(folder, scene)


def test_unfinished_states_are_ignored(whole, copied):
    folder, scene = copied
    shutil.copytree(folder / "0003", folder / "0099.part")                         # killed while writing
    path = whole["hinged"][2]
    assert len(fx.load(folder, scene)) == len(path)
    k = next(k for k, state in enumerate(path.states) if state.kind == "limit point")
    assert len(fx.load(folder, scene, state=k)) == k + 1
    for later in range(k + 1, len(path)):                                          # killed inside a step
        shutil.rmtree(folder / f"{later:04d}")
    left = fx.load(folder, scene)
    assert len(left) == k
    same(fx.trace(scene, until=SCENES["hinged"][1], start=left, progress=False, checkpoint=folder), path)
    same(fx.load(folder, scene), path)


OTHERS = {
    "mesh.cells: 20 there, 24 here": lambda: treloar((12, 1)),
    r"materials.sheet.kind: 'NeoHookean\(c10=2.0": lambda: treloar(stress=2.0),
    r"supports\[1\].kind: 'SimplySupported' there": lambda: treloar(support=fx.Clamped("rim")),
    "model.eps": lambda: treloar(model=fx.MixedPressure(eps=1e-3)),
    r"mesh.extent\[0\]: 1.25 there, 0.625 here": lambda: treloar(length=2.0),
}


@pytest.mark.parametrize("message", OTHERS)
def test_a_checkpoint_of_another_scene_is_refused(message, whole):
    folder, _, path = whole["hinged"]
    with pytest.raises(fx.InputError, match=f"of another scene: .*{message}"):
        fx.load(folder, OTHERS[message]())


def test_contacts_are_compared_to_the_last_number(whole):
    folder, *_ = whole["stick"]
    with pytest.raises(fx.InputError, match=r"contacts\[0\].penalty: 200000.0 there, 10000.0 here"):
        fx.load(folder, cup("stick", penalty=1e4))
    with pytest.raises(fx.InputError, match=r"contacts\[0\].tool.pieces"):
        fx.load(folder, cup("stick", fillet=1.1))


def test_the_folder_of_another_run_is_not_overwritten(copied):
    folder, scene = copied
    before = sorted(map(str, folder.rglob("*")))
    with pytest.raises(fx.InputError, match="holds 9 states of another run: go on"):
        fx.trace(scene, until=fx.pole_stretch(1.2), progress=False, checkpoint=folder,
                 step=fx.StepControl(length=0.03))
    with pytest.raises(fx.InputError, match="is of another scene"):
        fx.trace(treloar((8, 1)), until=fx.pole_stretch(1.2), progress=False, checkpoint=folder)
    assert sorted(map(str, folder.rglob("*"))) == before


@pytest.mark.parametrize("given, message", [
    ({"state": 99}, "state = 99: the checkpoint holds states 0 to"),
    ({"state": "last"}, "state = 'last'"),
])
def test_bad_state(given, message, copied):
    with pytest.raises(fx.InputError, match=message):
        fx.load(*copied, **given)


def test_a_missing_checkpoint_is_named(tmp_path):
    with pytest.raises(fx.InputError, match="there is no folder"):
        fx.load(tmp_path / "nothing", treloar())
    (tmp_path / "file").write_text("x")
    with pytest.raises(fx.InputError, match="is not a folder"):
        fx.load(tmp_path / "file", treloar())
    with pytest.raises(fx.InputError, match="exists already and is not a checkpoint"):
        treloar_path(tmp_path / "file")
    with pytest.raises(fx.InputError, match="start: must be a path of this very scene"):
        fx.trace(treloar(), until=fx.pole_stretch(2.0), start="run")


def treloar_path(folder):
    return fx.trace(treloar(), until=fx.pole_stretch(1.5), progress=False, checkpoint=folder)


@pytest.mark.parametrize("number", [8, 99])
def test_another_format_is_refused(copied, number):
    folder, scene = copied
    about = json.loads((folder / "scene.json").read_text()) | {"formingx": number}
    (folder / "scene.json").write_text(json.dumps(about))
    read = checkpoint_data.FORMAT
    with pytest.raises(fx.InputError, match=f"has the format {number}; this version of formingx reads {read}"):
        fx.load(folder, scene)


def test_unwritable_folder():
    with pytest.raises(OSError, match="checkpoint '/proc/run': cannot be begun"):
        treloar_path("/proc/run")


def test_a_folder_that_vanishes_and_one_that_two_write_to(copied):
    """What is lost is not called kept; a second writer is told of the first."""
    folder, scene = copied
    longer = fx.trace(scene, until=fx.pole_stretch(3.5), start=fx.load(folder, scene), progress=False)
    first, second = (checkpoint.Checkpoint(folder, longer) for _ in range(2))
    first.write()
    with pytest.raises(OSError, match=r"state \d+ could not be written: it is there already: does another run write"):
        second.write()
    assert len(fx.load(folder, scene)) == len(longer)
    shutil.rmtree(folder)
    with pytest.raises(OSError, match=r"could not be written: the folder is gone, and the states in it$"):
        second.write()


def test_full_disk(copied):
    """A limit on the size of files stands for a disk that is full: the states that are there are kept."""
    folder, scene = copied
    path, limit = fx.load(folder, scene), resource.getrlimit(resource.RLIMIT_FSIZE)
    before = sorted(map(str, folder.rglob("*")))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, limit[1]))
    try:
        with pytest.raises(OSError, match=r"state \d+ could not be written; the states before it are kept"):
            fx.trace(scene, until=fx.pole_stretch(3.5), start=path, progress=False, checkpoint=folder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    kept = sorted(map(str, folder.rglob("*")))
    assert [f for f in kept if ".part" not in f] == before
    assert len(fx.load(folder, scene)) == len(path)


UNWRITABLE = """
import sys
sys.path.insert(0, "tests")
from mpi4py import MPI
from test_restart import treloar_path
try:
    treloar_path("/proc/run")
except OSError as error:
    print(MPI.COMM_WORLD.rank, error, flush=True)
"""


@pytest.mark.thorough
def test_errors_come_on_all_ranks():
    assert run_script(UNWRITABLE, ranks=2).count("cannot be begun") == 2


def test_contents_need_no_scene(whole):
    folder, _, path = whole["hinged"]
    about, states = checkpoint_data.contents(folder)
    assert about["summary"]["material of sheet"] == "NeoHookean(c10=2.0)" and len(states) == len(path)
    assert states[-1]["measures"] == path.last.measures
    np.testing.assert_allclose(states[-1]["profile"]["top"], path.profile().top, atol=1e-12)


INTERRUPTED = """
import sys
sys.path.insert(0, "tests")
import os, signal
import formingx as fx
from test_restart import SCENES
make, until = SCENES["stick"]
def stop(problem):
    stop.calls += 1
    if stop.calls == 6:
        os.kill(os.getpid(), signal.SIGINT)
    return float(stop.calls)
stop.calls = 0
signal.signal(signal.SIGINT, signal.default_int_handler)         # what a shell starts in the background ignores it
fx.trace(make(), until=until, progress=False, checkpoint=sys.argv[1], record={"calls": stop})
"""


@pytest.mark.thorough
def test_an_interrupted_run_prints_one_line_and_can_be_continued(tmp_path):
    done = subprocess.run([sys.executable, "-c", INTERRUPTED, str(tmp_path / "run")], cwd=ROOT, capture_output=True,
                          text=True, timeout=300)
    assert done.returncode != 0 and len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "interrupted at pressure" in done.stderr and "resume=True" in done.stderr
    make, until = SCENES["stick"]
    scene = make()
    path = fx.trace(scene, until=until, progress=False, checkpoint=tmp_path / "run", resume=True)
    plain = fx.trace(scene, until=until, progress=False)
    assert len(path) == len(plain) and np.abs(path.last.x - plain.last.x).max() < 1e-9 * np.abs(plain.last.x).max()
    with pytest.raises(fx.InputError, match="of another scene"):
        fx.trace(treloar(), until=fx.pole_stretch(1.2), progress=False, checkpoint=tmp_path / "run", resume=True)
    begun = fx.trace(scene, until=until, progress=False, checkpoint=tmp_path / "new", resume=True)
    assert len(begun) == len(plain)


@pytest.mark.parametrize("damage", ["swapped", "superscript", "truncated", "deep", "step", "checksums"])
def test_a_damaged_checkpoint_is_refused(tmp_path, damage):
    from formingx.results.files.checkpoint_data import contents
    scene, folder = treloar(), tmp_path / "run"
    fx.trace(scene, until=fx.pole_stretch(1.3), progress=False, checkpoint=folder)
    state = folder / "0001" / "state.json"
    data = json.loads(state.read_text())
    if damage == "swapped":
        for a, b in (("0001", "x"), ("0002", "0001"), ("x", "0002")):
            (folder / a).rename(folder / b)
    elif damage == "superscript":
        (folder / "0001").rename(folder / "\u00b9")
    elif damage == "truncated":
        (folder / "scene.json").write_text((folder / "scene.json").read_text()[:200])
    elif damage == "deep":
        state.write_text("[" * 100_000 + "]" * 100_000)
    elif damage == "step":
        del data["stepping"]
        state.write_text(json.dumps(data))
    else:
        data["measures"]["pressure"] = 7.0
        state.write_text(json.dumps(data))
    for look in (lambda: fx.load(folder, scene), lambda: contents(folder)):
        with pytest.raises(fx.InputError, match="damaged|missing"):
            look()


@pytest.mark.parametrize("run", ["trace", "solve", "process"])
def test_interrupted_before_its_first_state(monkeypatch, run):
    """While forms are compiled, too, one line says so."""
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("formingx.runs.Problem", interrupt)
    scene = treloar()
    with pytest.raises(fx.Interrupted, match="before its first state"):
        {"trace": lambda: fx.trace(scene, until=fx.pole_height(0.1)), "solve": lambda: fx.solve(scene, to=0.1),
         "process": lambda: fx.Process(scene).run([fx.Stage("up", control=scene.driven,
                                                            until=fx.pressure(0.1))])}[run]()


def test_a_continued_run_evaluates_states_with_the_objects_of_its_start(monkeypatch):
    """The columns of a path serve for a path that continues it, unless other columns are recorded."""
    start, made = fx.trace(treloar(), until=fx.pressure(0.0), progress=False), []
    standard = columns.standard
    monkeypatch.setattr(columns, "standard", lambda *args: made.append(1) or standard(*args))
    path = fx.trace(start.scene, until=fx.pole_stretch(1.2), start=start, progress=False)
    assert not made and path.columns == start.columns and path["pole_stretch"][-1] == pytest.approx(1.2)
    other = fx.trace(start.scene, until=fx.pole_stretch(1.2), start=start, record={"height": fx.pole_height(1.0)},
                     progress=False)
    assert made and other.last.measures["height"] == pytest.approx(path["pole_height"][-1], rel=1e-12)
