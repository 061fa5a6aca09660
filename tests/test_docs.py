"""Every code block of the pages runs, one after the other, and prints what stands below it; Sphinx builds them all."""

import re

import pytest
from conftest import ROOT, run
from printed import assert_shows

DOCS = ROOT / "docs"
PAGES = [p for p in sorted(DOCS.rglob("*.md")) if "_build" not in p.parts and "```python" in p.read_text()]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(DOCS).with_suffix("").as_posix())
def test_blocks_run(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block, shown in re.findall(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", page.read_text(), re.S):
        exec(compile(block, page.name, "exec"), names)
        assert_shows(shown, capsys.readouterr().out)


@pytest.mark.quick
def test_sphinx_warns_of_nothing(tmp_path):
    run("-m", "sphinx", "-W", "--keep-going", "-q", "docs", tmp_path / "html")
    page = (tmp_path / "html" / "api.html").read_text()
    assert [name for name in public() if f'id="formingx.{name}"' not in page] == []


def test_public_names_are_documented():
    assert all(thing.__doc__ for thing in public().values())


def public():
    """{name: class or function} of `formingx` itself."""
    import formingx as fx
    return {name: getattr(fx, name) for name in dir(fx) if not name.startswith("_") and callable(getattr(fx, name))}
