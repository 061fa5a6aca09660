"""Every code block of the guide runs, one after the other; Sphinx builds the pages without a warning."""

import re

import pytest
from conftest import ROOT, run

PAGES = sorted((ROOT / "docs").glob("*.md"))


@pytest.mark.parametrize("page", [p for p in PAGES if "```python" in p.read_text()], ids=lambda p: p.stem)
def test_blocks_run(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", page.read_text(), re.S):
        exec(compile(block, page.name, "exec"), names)
    assert capsys.readouterr().out


@pytest.mark.quick
def test_sphinx_warns_of_nothing(tmp_path):
    run("-m", "sphinx", "-W", "--keep-going", "-q", "docs", tmp_path / "html")
    assert "formingx.trace" in (tmp_path / "html" / "api.html").read_text()


def test_public_names_are_documented():
    import formingx as fx
    public = [getattr(fx, name) for name in dir(fx) if not name.startswith("_")]
    assert all(thing.__doc__ for thing in public if callable(thing))
