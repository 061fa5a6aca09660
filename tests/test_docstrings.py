"""Every example in a docstring runs, and gives what stands below it."""

import doctest
import importlib
import pkgutil
import re
from pathlib import Path

import pytest

import formingx as fx

MODULES = [m.name for m in pkgutil.walk_packages(fx.__path__, "formingx.") if not m.name.endswith("__main__")]


def examples():
    finder = doctest.DocTestFinder()
    return [t for name in MODULES for t in finder.find(importlib.import_module(name)) if t.examples]


@pytest.mark.parametrize("test", examples(), ids=lambda test: test.name)
def test_example(test, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE, verbose=False)
    runner.run(test, out=said.append)
    assert runner.failures == 0, "".join(said)


def test_references():
    """What a docstring calls by its full name is there."""
    for name in MODULES:
        source = Path(importlib.import_module(name).__file__).read_text()
        for reference in re.findall(r"`(formingx(?:\.\w+)+)`", source):
            pkgutil.resolve_name(reference)
