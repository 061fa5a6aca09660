"""Ten tasks of a new user, each found from the README in at most three clicks; every page is that near.

When the list was first followed, four tasks failed: terms of another program (no link to the page), own tests (behind
"shapes"), files for other programs (no page), a free inflation (its link led to validation).
"""

import re

import pytest
from conftest import ROOT

pytestmark = pytest.mark.thorough

LINK = re.compile(r"(?<!!)\[((?:!\[[^\]]*\]\([^)]*\)|[^\[\]])*)\]\(([^)\s]+)\)")
README = ROOT / "README.md"
CLICKS = 3

TASKS = {
    "install it on Windows": (["Install"], "WSL 2"),
    "inflate a sheet through its pressure maximum": (["free inflation"], "path.limit_points"),
    "read a mould from a drawing": (["how-to guides", "... bring in shapes and test data?"], "fx.tools.read("),
    "fit a material to my own tests": (["how-to guides", "... turn tests of my polymer into a material?"], "fx.fit("),
    "programme the wall of a parison": (["blow moulding"], "fx.mesh.parison("),
    "find the force on a plug with friction": (["tutorials", "3. Push a plug, with friction"], "plug_force"),
    "form a tray from an STL file": (["trays"], 'fx.tools.solid("tray.stl")'),
    "understand why a run ended": (["error messages"], "ConvergenceError"),
    "hand the part to a structural code": (["how-to guides", "... write files for other programs?"], "path.to_inp("),
    "translate my Abaqus input": (["terms of other programs"], "*VISCOELASTIC"),
}


def links(page):
    """{text: page} of the links of a page to other pages."""
    found = ((text, (page.parent / target.split("#")[0]).resolve()) for text, target in LINK.findall(page.read_text())
             if not target.startswith("http"))
    return {text: file for text, file in found if file.suffix == ".md"}


@pytest.mark.parametrize("task", TASKS)
def test_task_is_found(task):
    clicks, phrase = TASKS[task]
    page = README
    for text in clicks:
        page = links(page)[text]
    assert len(clicks) <= CLICKS and phrase in page.read_text()


def test_every_page_is_three_clicks_from_the_readme():
    near = {README}
    for _ in range(CLICKS):
        near |= {file for page in near if page.is_file() for file in links(page).values()}
    assert [page for page in near if not page.is_file()] == []
    pages = {page for page in (ROOT / "docs").rglob("*.md") if not {"_build", "notebooks"} & {*page.parts}}
    assert pages - near == set()
