"""Compilation of forms: FFCx writes C, and one call of the C compiler makes a shared library.

DOLFINx itself builds a Python extension module for each form, by distutils. This takes three times the processor time
and gives the same machine code. A library receives its final name in the cache when it is complete. So an interrupted
build leaves no file for which another process would wait.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import importlib.util
import inspect
import os
import re
import shlex
import shutil
import subprocess
import sysconfig
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cffi
import ffcx
import ffcx.compiler
import numpy as np
import ufl
from _cffi_backend import from_buffer
from dolfinx import jit
from ffcx import naming
from ffcx.codegeneration import get_include_path
from ffcx.codegeneration import jit as ffcx_jit

from .errors import InputError

_FFI = cffi.FFI()
_DOUBLES, _LONGS, _NULL = _FFI.typeof("double[]"), _FFI.typeof("long[]"), _FFI.NULL


def supported(jit_options: dict[str, Any]) -> bool:
    """Return True for FFCx 0.9 to 0.11 and a C compiler, without `cffi_debug` and `cffi_verbose`."""
    return (ffcx.__version__.startswith(("0.9.", "0.10.", "0.11.")) and os.name == "posix" and _compiler() is not None
            and not (jit_options["cffi_debug"] or jit_options["cffi_verbose"]))


def key(item: Any, jit_options: dict[str, Any], form_options: dict[str, Any]) -> str:
    """Return the name of the library of a form or (expression, points): a digest of it, options and compiler."""
    tag = f"{sorted(form_options.items())}{_command(jit_options)}{_compiler_id()}" if supported(jit_options) else ""
    return "form_" + naming.compute_signature([item], tag)


def compile_together(comm: Any, items: dict[str, Any], jit_options: dict[str, Any], form_options: dict[str, Any]
                     ) -> dict[str, tuple[Any, Any, tuple]]:
    """Return compiled forms and expressions; rank 0 builds all missing ones as one library.

    Collective. Items are {name by `key`: UFL form, or (expression, points)}, results {name: (object of FFCx, namespace,
    (None, None))}. A failed compiler, or an item refused on rank 0, is a RuntimeError.
    """
    folder = Path(jit_options["cache_dir"]) / "formingx"
    if comm.rank == 0:
        try:
            found = _open_libraries(items, folder, form_options, jit_options)
        except BaseException as error:
            comm.bcast(str(error))
            raise
        comm.bcast(None)
        return found
    if (failure := comm.bcast(None)) is not None:
        raise RuntimeError(failure)
    # another machine may not see the folder of rank 0
    return _open_libraries(items, folder, form_options, jit_options)


def _open_libraries(items: dict[str, Any], folder: Path, form_options: dict[str, Any], jit_options: dict[str, Any]
            ) -> dict[str, Any]:
    """Return {library: result of `_load`} of all items, built where missing; a failure is a RuntimeError."""
    ffi = _declarations(np.dtype(form_options["scalar_type"]).name)
    found = {name: _load(ffi, name, item, folder) for name, item in items.items()}
    if not all(found.values()):
        folder = _writable(folder)
        with _locked(folder, next(name for name, compiled in found.items() if not compiled)):
            found = {name: compiled or _load(ffi, name, items[name], folder) for name, compiled in found.items()}
            missing = {name: items[name] for name, compiled in found.items() if not compiled}
            if missing:
                _build(missing, folder, jit_options, form_options)
        found |= {name: _load(ffi, name, item, folder) for name, item in missing.items()}
        if not all(found.values()):
            raise RuntimeError(f"the compiled forms in {folder} cannot be loaded: if its file system forbids programs"
                               " (noexec), set XDG_CACHE_HOME to another folder")
    return found


def _load(ffi: cffi.FFI, name: str, item: Any, folder: Path) -> tuple | None:
    """Return (object of FFCx, namespace, (None, None)) from the library of a form; None if it cannot be loaded."""
    kind, symbol = (("ufcx_form", naming.form_name(item, 0, name)) if isinstance(item, ufl.Form) else
                    ("ufcx_expression", naming.expression_name(item, name)))
    try:
        opened = ctypes.CDLL(str(folder / f"{name}.so"))
        pointer = ctypes.addressof(ctypes.c_char.in_dll(opened, symbol))
    except (OSError, ValueError):
        return None
    return ffi.cast(f"{kind} *", pointer)[0], SimpleNamespace(ffi=ffi, library=opened), (None, None)


@functools.cache
def _declarations(scalar: str) -> cffi.FFI:
    """Return the cffi interface with the declarations of the C structures of FFCx for a scalar type, such as "float64".

    Functions of complex numbers, which cffi cannot declare, take `void *`; Python never calls them.
    """
    text = (ffcx_jit.UFC_HEADER_DECL.format(scalar) + ffcx_jit.UFC_INTEGRAL_DECL + ffcx_jit.UFC_FORM_DECL
            + ffcx_jit.UFC_EXPRESSION_DECL)
    ffi = cffi.FFI()
    ffi.cdef(re.sub(r"\b(float|double) _Complex\b", "void", text))
    return ffi


def _build(items: dict[str, Any], folder: Path, jit_options: dict[str, Any], form_options: dict[str, Any]) -> None:
    """Build one library with all items, and link it in the cache under the name of each item."""
    code = "\n".join(_c_code(item, name, form_options) for name, item in items.items())
    files = [folder / f"{name}.so" for name in items]
    made, other = (folder / f"unfinished_{os.urandom(8).hex()}.so" for _ in range(2))
    try:
        compile_c([*_command(jit_options), "-o", str(made)], code)
        for file in files[1:]:
            try:
                os.link(made, other)
            except OSError:                                                    # a file system without links
                shutil.copyfile(made, other)
            os.replace(other, file)
        os.replace(made, files[0])
    finally:
        made.unlink(missing_ok=True)
        other.unlink(missing_ok=True)


def _c_code(item: Any, name: str, form_options: dict[str, Any]) -> str:
    """Return the C source that FFCx writes for a form or (expression, points); names begin with `name`."""
    write = ffcx.compiler.compile_ufl_objects
    if "namespace" in inspect.signature(write).parameters:                      # FFCx >= 0.11: (sources, suffixes)
        return write([item], namespace=name, options=form_options)[0][1]
    return write([item], prefix=name, options=form_options)[1]                 # (header, source)


def library(name: str, code: str, flags: tuple[str, ...]) -> Path:
    """Return the path of a cached or compiled library of C functions; InputError: no compiler, RuntimeError: failed."""
    compiler = _compiler()
    if compiler is None:
        raise InputError("formingx compiles its equations, and there is no C compiler: install Debian's packages gcc"
                         " and libc6-dev, or PyPI's by \"pip install 'formingx[compiler]'\"; CC=COMMAND names another")
    command = [*compiler, *flags, "-shared", "-fPIC", "-x", "c", "-", "-lm"]
    digest = hashlib.sha1(f"{code}{command}{_compiler_id()}".encode()).hexdigest()
    file = Path(jit.get_options()["cache_dir"]) / "formingx" / f"{name}_{digest}.so"
    if not file.exists():
        file = _writable(file.parent) / file.name
        made = file.with_name(f"unfinished_{os.urandom(8).hex()}.so")
        try:
            compile_c([*command, "-o", str(made)], code)
            os.replace(made, file)
        finally:
            made.unlink(missing_ok=True)
    return file


class CFunctions:
    """Functions of a C file of the package, as attributes; the file is compiled when one is first used.

    An argument is a number, an array, or None for no array. An array is copied if it is not contiguous or of another
    type, except where C writes into it: there it must be contiguous, of floats or of integers (long in C).
    """

    def __init__(self, file: str):
        self._file = Path(__file__).parent / file

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if "_opened" not in vars(self):
            for found, function in self._compiled().items():
                setattr(self, found, function)
        return self.__getattribute__(name)

    def _compiled(self) -> dict[str, Any]:
        """Compile the file, and return {name: function} of its functions that are not static."""
        ffi, code = cffi.FFI(), _with_included(self._file)
        heads = re.findall(r"^((?!static|typedef)\w+ (\w+)\(([^)]*)\))\s*\{", code, re.M)
        ffi.cdef("".join(head + ";" for head, _, _ in heads))
        self._opened = ffi.dlopen(str(library(self._file.stem, code, ("-O3", "-ffp-contract=off"))))
        return {name: _taking_arrays(getattr(self._opened, name), arguments.split(","))
                for _, name, arguments in heads}


def _with_included(file: Path) -> str:
    """Return the text of a C file with the files in place that it includes by "..."."""
    return re.sub(r'^#include "(.+)"$', lambda found: _with_included(file.parent / found[1]), file.read_text(),
                  flags=re.M)


def _taking_arrays(function: Any, arguments: list[str]) -> Any:
    """Return a C function that takes arrays; arguments: their declarations in C."""
    kinds = [None if "*" not in a else ("const" in a, *((_DOUBLES, float) if "double" in a else (_LONGS, int)))
             for a in arguments]

    def call(*values: Any) -> Any:
        return function(*[
            value if kind is None else _NULL if value is None else
            from_buffer(kind[1], np.ascontiguousarray(value, kind[2]) if kind[0] else value)
            for kind, value in zip(kinds, values, strict=True)])
    return call


def compile_c(command: list[str], code: str) -> None:
    """Run the compiler command on C code from standard input; RuntimeError if it fails or is missing."""
    try:
        result = subprocess.run(command, input=code, capture_output=True, text=True, check=False)
    except OSError as error:
        raise RuntimeError(f"the C compiler cannot be run: {error}") from None
    if result.returncode:
        raise RuntimeError(f"the C compiler failed, with status {result.returncode}: {shlex.join(command)}\n"
                           f"{result.stderr[-2000:]}")


def _command(jit_options: dict[str, Any]) -> list[str]:
    """Return the words of the command that compiles C from standard input; the name of the library is to be added."""
    flags = [*shlex.split(sysconfig.get_config_var("CFLAGS") or ""), "-fPIC", "-std=c17",
             *jit_options["cffi_extra_compile_args"], *shlex.split(os.environ.get("CFLAGS", ""))]    # the last one acts
    libraries = [*ffcx_jit._libraries, *(jit_options["cffi_libraries"] or ())]
    return [*(_compiler() or ()), *(flag for flag in flags if not flag.startswith("-W")), f"-I{get_include_path()}",
            "-shared", "-x", "c", "-", *(f"-l{name}" for name in libraries)]


@functools.cache
def _compiler() -> tuple[str, ...] | None:
    """Return the command of the C compiler as a tuple of words, or None if there is none."""
    for command in (os.environ.get("CC"), sysconfig.get_config_var("CC"), "cc", "gcc", "clang"):
        words = shlex.split(command or "")
        if words and shutil.which(words[0]):
            return tuple(words)
    package = importlib.util.find_spec("ziglang")      # from PyPI: clang with the headers and libraries of C
    if package is not None and package.origin:
        return str(Path(package.origin).with_name("zig")), "cc", "-mcpu=baseline"    # a shared cache
    return None


@functools.cache
def _compiler_id() -> str:
    """Return path, size and date of the C compiler as text, which changes with its version."""
    program = Path(shutil.which((_compiler() or ("cc",))[0]) or "").resolve()
    status = program.stat()
    return f"{program} {status.st_size} {status.st_mtime_ns}"


def _writable(folder: Path) -> Path:
    """Return a folder for new libraries: the cache `folder`, or a temporary folder if the cache is read-only."""
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return folder if os.access(folder, os.W_OK) else Path(_temporary_folder().name)


@functools.cache
def _temporary_folder() -> tempfile.TemporaryDirectory:
    """Return the temporary folder of this process, which is deleted at its end."""
    return tempfile.TemporaryDirectory(prefix="formingx_")


@contextlib.contextmanager
def _locked(folder: Path, name: str) -> Iterator[None]:
    """Lock the build of the form `name` in a folder within a block; a second process waits, then finds the library.

    The lock ends with its process. On a file system without locks both processes build.
    """
    import fcntl
    file = folder / f"{name}.lock"
    with open(file, "w") as lock:
        with contextlib.suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            yield
        finally:
            file.unlink(missing_ok=True)
