"""The pages on theory name, below each equation, functions that exist."""

import pkgutil
import re

import pytest
from conftest import ROOT

PAGES = sorted((ROOT / "docs" / "theory").glob("*.md"))


def test_contents_page_lists_all():
    listed = re.findall(r"\]\(theory/(\w+)\.md\)", (ROOT / "docs" / "theory.md").read_text())
    assert sorted(listed) == [page.stem for page in PAGES]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_functions_of_equations_exist(page):
    text = page.read_text()
    shown = text.split("$$")[2::2]
    assert shown and all(after.startswith("\n\nCode: `formingx.") for after in shown)
    for name in re.findall(r"`(formingx\.[\w.]+)`", text):
        pkgutil.resolve_name(name)
