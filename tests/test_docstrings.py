"""Every example in a docstring runs, after the lines of `help(formingx)`, and gives what stands below it."""

import doctest
import importlib
import pkgutil
import re
from pathlib import Path

import pytest
from test_docs import public

import formingx as fx

MODULES = [m.name for m in pkgutil.walk_packages(fx.__path__, "formingx.") if not m.name.endswith("__main__")]


# bases, what calls give back (their examples are those of the calls), and an end by Ctrl-C
WITHOUT = {"Damping", "Interrupted", "Load", "Material", "Support", "tools.Pot", "tools.SolidTool"}


def examples(*modules):
    finder = doctest.DocTestFinder()
    return [t for name in modules for t in finder.find(importlib.import_module(name)) if t.examples]


def names_after(test, names):
    """What an example leaves behind that begins with these names alone."""
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS, verbose=False)
    test.globs = dict(names)
    runner.run(test, out=said.append, clear_globs=False)
    assert runner.failures == 0, "".join(said)
    return test.globs


@pytest.fixture(scope="module")
def begun():
    first, = (test for test in examples("formingx") if test.name == "formingx")
    return names_after(first, {})


@pytest.mark.parametrize("test", examples(*MODULES), ids=lambda test: test.name)
def test_example(test, begun, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names_after(test, begun)


def test_every_public_call_has_an_example():
    assert {name for name, thing in public().items() if ">>>" not in thing.__doc__} == WITHOUT


def test_references():
    """What a docstring calls by its full name is there."""
    for name in MODULES:
        source = Path(importlib.import_module(name).__file__).read_text()
        for reference in re.findall(r"`(formingx(?:\.\w+)+)`", source):
            pkgutil.resolve_name(reference)
