"""Compilation of forms by one call of the compiler: interruptions, errors, and libraries of another compiler."""

import fcntl
import shutil
import threading

import numpy as np
import pytest
import ufl
from conftest import run_script
from dolfinx import fem
from mpi4py import MPI

import formingx as fx
from formingx import _compat, _jit


@pytest.fixture
def calls(tmp_path, monkeypatch):
    """Calls of the compiler from now on; nothing has been compiled."""
    made, compile_c = [], _jit.compile_c
    monkeypatch.setattr(_jit, "compile_c", lambda command, code: made.append(code) or compile_c(command, code))
    monkeypatch.setattr(_compat, "_compiled", {})
    monkeypatch.setitem(_compat.JIT_OPTIONS, "cache_dir", tmp_path / "cache")
    return made


@pytest.fixture(scope="module")
def domain():
    return fx.mesh.disc(radius=1.0, thickness=1.0, elements=(1, 1), comm=MPI.COMM_SELF).domain


def area(domain, power=0):
    """The integral of r**power, 1 / (power + 1), compiled."""
    return fem.assemble_scalar(_compat.compile_form(ufl.SpatialCoordinate(domain)[0] ** power * ufl.dx(domain)))


def kept(folder):
    return sorted(file.name for file in (folder / "cache" / "formingx").iterdir())


def forget():
    _compat._compiled.clear()


def test_matrices_are_those_of_dolfinx(domain):
    """To the last bit, of a tangent with powers and logarithms; an expression too."""
    space = fem.functionspace(domain, ("Lagrange", 2, (2,)))
    w, v = fem.Function(space), ufl.TestFunction(space)
    w.interpolate(lambda x: 0.1 * np.sin(x[:2] + 1.0))
    F = ufl.Identity(2) + ufl.grad(w)
    energy = (ufl.tr(F.T * F) ** 1.3 - 2 * ufl.ln(ufl.det(F))) * ufl.SpatialCoordinate(domain)[0] * ufl.dx(domain)
    tangent = ufl.derivative(ufl.derivative(energy, w, v), w, ufl.TrialFunction(space))
    ours, theirs = _compat.compile_form(tangent), fem.form(tangent, jit_options=_compat.JIT_OPTIONS)
    assert ours.module.library and not hasattr(theirs.module, "library")
    assert np.array_equal(*(fem.assemble_matrix(form).data for form in (ours, theirs)))
    points = np.array([[0.2, 0.3], [0.6, 0.1]])
    both = (_compat.compile_expression(F, points), fem.Expression(F, points, jit_options=_compat.JIT_OPTIONS))
    assert np.array_equal(*(one.eval(domain, np.arange(2, dtype=np.int32)) for one in both))


def test_a_form_is_compiled_once(calls, tmp_path, domain):
    for _ in range(2):
        assert [area(domain), area(domain)] == pytest.approx([1.0, 1.0])
        forget()
    assert len(calls) == 1 and len(kept(tmp_path)) == 1


def test_a_run_calls_the_compiler_a_few_times(monkeypatch):
    """The forms of a path together, those of the columns together; volume and area, which scale them, come before."""
    calls, together = [], _jit.compile_together
    monkeypatch.setattr(_jit, "compile_together", lambda comm, items, *more: calls.append(len(items)) or together(
        comm, items, *more))
    monkeypatch.setattr(_compat, "_compiled", {})
    pot = fx.tools.pot(mouth=38.0, base=28.0, depth=40.0, sheet=1.2, fillet=8.0, lip=3.0, nose=20.0)
    scene = fx.Scene(mesh=fx.mesh.disc(radius=40.0, thickness=1.2, elements=(10, 1)), materials=fx.NeoHookean(c10=0.4),
                     supports=[fx.Symmetry("axis"), fx.Clamped("rim")], loads=[fx.Pressure("bottom", name="vacuum")],
                     contacts=[fx.Contact("top", pot.mould, "stick", separates=False, name="mould"),
                               fx.Contact("bottom", pot.plug, "none", direction=(0, 1), name="plug")])
    path = fx.Process(scene).run([fx.Stage("plug", control="plug", until=fx.travel(2.0))], progress=False)
    assert calls == [1, 1, 8, 4]
    path.stress()
    assert calls == [1, 1, 8, 4, 2, 1, 1]


def test_an_interrupted_compilation_leaves_no_library(calls, tmp_path, monkeypatch, domain):
    """Neither a compiler that is stopped, nor a file that was written in part."""
    def interrupted(command, code):
        raise KeyboardInterrupt
    with monkeypatch.context() as patch:
        patch.setattr(_jit, "compile_c", interrupted)
        with pytest.raises(KeyboardInterrupt):
            area(domain)
    assert kept(tmp_path) == []
    area(domain)
    (name,) = kept(tmp_path)
    part = tmp_path / "other" / "formingx" / name             # elsewhere: a process loads a file only once
    part.parent.mkdir(parents=True)
    part.write_bytes((tmp_path / "cache" / "formingx" / name).read_bytes()[:100])
    part.with_suffix(".lock").touch()
    monkeypatch.setitem(_compat.JIT_OPTIONS, "cache_dir", tmp_path / "other")
    forget()
    assert area(domain) == pytest.approx(1.0)
    assert len(calls) == 2 and list(part.parent.iterdir()) == [part]


def test_a_cache_that_cannot_be_written_to(calls, tmp_path, monkeypatch, domain):
    """Its libraries are used; others go to a folder of the process."""
    area(domain)
    before = kept(tmp_path)
    forget()
    monkeypatch.setattr(_jit.os, "access", lambda *_: False)
    assert (area(domain), area(domain, 1)) == pytest.approx((1.0, 0.5))
    forget()
    assert area(domain, 1) == pytest.approx(0.5)
    assert kept(tmp_path) == before and len(calls) == 2


def test_flags_and_compilers_have_libraries_of_their_own(calls, tmp_path, monkeypatch, domain):
    area(domain)
    forget()
    monkeypatch.setenv("CFLAGS", "-DNOTHING")
    area(domain)
    forget()
    monkeypatch.setattr(_jit, "_compiler_id", lambda: "another compiler")
    area(domain)
    assert len(calls) == len(kept(tmp_path)) == 3


def test_flags_of_the_environment_act_last(monkeypatch):
    monkeypatch.setenv("CFLAGS", "-O0")
    levels = [flag for flag in _jit._command({"cffi_extra_compile_args": ["-O2"], "cffi_libraries": None})
              if flag.startswith("-O")]
    assert levels[-2:] == ["-O2", "-O0"]


def test_a_process_waits_for_another_with_the_same_form(calls, tmp_path, monkeypatch, domain):
    area(domain)
    (name,) = kept(tmp_path)
    library = tmp_path / "other" / "formingx" / name
    library.parent.mkdir(parents=True)
    monkeypatch.setitem(_compat.JIT_OPTIONS, "cache_dir", tmp_path / "other")
    forget()
    with open(library.with_suffix(".lock"), "w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        waiting = threading.Thread(target=area, args=(domain,))
        waiting.start()
        waiting.join(0.2)
        assert waiting.is_alive()
        shutil.copyfile(tmp_path / "cache" / "formingx" / name, library)
    waiting.join(60)
    assert not waiting.is_alive() and len(calls) == 1


def test_compiler_errors_are_reported(calls, tmp_path, monkeypatch, domain):
    with monkeypatch.context() as patch:
        patch.setenv("CFLAGS", "--no-such-flag")
        with pytest.raises(RuntimeError, match=r"(?s)C compiler failed.*no-such-flag"):
            area(domain)
    assert area(domain) == pytest.approx(1.0) and len(kept(tmp_path)) == 1


RANKS = """
import tempfile
import ufl
from dolfinx import fem
from mpi4py import MPI
import formingx as fx
from formingx import _compat, _jit
comm, calls, compile_c, compiled = MPI.COMM_WORLD, [], _jit.compile_c, _compat._compiled
_jit.compile_c = lambda command, code: calls.append(code) or compile_c(command, code)
with tempfile.TemporaryDirectory() as folder:
    _compat._compiled, _compat.JIT_OPTIONS["cache_dir"] = {}, comm.bcast(folder)
    try:
        domain = fx.mesh.disc(radius=1.0, thickness=1.0, elements=(4, 1)).domain
        form = _compat.compile_form(ufl.SpatialCoordinate(domain)[0] * ufl.dx(domain))
        print(comm.rank, len(calls), round(comm.allreduce(fem.assemble_scalar(form)), 12))
    finally:
        _jit.compile_c, _compat._compiled = compile_c, compiled
        del _compat.JIT_OPTIONS["cache_dir"]
    comm.Barrier()
"""


def test_one_rank_compiles():
    assert sorted(run_script(RANKS, ranks=2).splitlines()) == ["0 1 0.5", "1 0 0.5"]


def test_arrays_for_functions_in_c():
    """Inputs are copied if they are not contiguous; an array into which C writes must be contiguous."""
    edges, low, high = _jit.CFunctions("mesh/boxes.c"), np.zeros((4, 2)), np.ones((2, 4)).T
    pairs = np.full((6, 2), -1)
    assert edges.overlaps(4, low, high, 6, pairs) == 6 and pairs.min() == 0
    with pytest.raises(ValueError, match="not C-contiguous"):
        edges.overlaps(4, low, high, 6, np.full((2, 6), -1).T)
    with pytest.raises(AttributeError):
        _ = edges.no_such_function
