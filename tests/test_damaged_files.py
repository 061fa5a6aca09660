"""Some of the damaged files of benchmarks/damaged_files.py: each is read correctly, or refused with a message."""

import sys

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))
import damaged_files  # noqa: E402

pytestmark = pytest.mark.thorough

KINDS = ("msh22", "msh41", "msh22b", "msh41b", "text", "geo", "dxf", "mshtool", "csv", "tests", "heat", "checkpoint")


def test_damaged_files_are_read_right_or_refused():
    found = damaged_files.run(20, 0, KINDS)
    assert list(found) and all(endings["bad"] == 0 and endings["InputError"] > 5 for endings in found.values()), found


def test_a_reader_that_drops_data_is_detected(monkeypatch):
    """A reader that leaves out what it does not understand."""
    good = damaged_files.sources
    monkeypatch.setattr(damaged_files, "sources", lambda folder: {"text": (good(folder)["text"][0], lambda file: [
        len(file.read_bytes())])})
    assert damaged_files.run(20, 0)["text"]["bad"] > 3


@pytest.mark.slow
def test_damaged_cad_files():
    found = damaged_files.run(50, 0, ("step", "brep"))
    assert all(endings["bad"] == 0 for endings in found.values()), found
