"""The README's script runs as printed, and prints what stands below it; the README's links lead somewhere."""

import re
import subprocess
import sys

import pytest
from conftest import ROOT
from printed import assert_shows

README = (ROOT / "README.md").read_text()


@pytest.mark.quick
def test_script(tmp_path):
    (script,) = re.findall(r"```python\n(.*?)```", README, flags=re.S)
    (printed,) = re.findall(r"```text\n(.*?)```", README, flags=re.S)
    script += "\nimport sys\nprint(*{'IPython', 'matplotlib.figure', 'scipy'}.intersection(sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    *lines, slow = done.stdout.splitlines()
    assert slow == ""                                        # none of the modules that take long to import
    assert_shows(printed, "\n".join(lines), rel=5e-3)
    assert {f.name for f in tmp_path.iterdir()} == {"pot.csv", "pot.png", "pot.html"}


def test_links_lead_somewhere():
    links = [link for link in re.findall(r"\]\(([^)]+)\)", README) if not link.startswith("http")]
    assert links and all((ROOT / link).exists() for link in links)


def test_ci_runs_the_command_of_the_tests():
    assert "./fx python3 -m pytest " in README
    assert "./fx python3 -m pytest\n" in (ROOT / ".ci" / "run").read_text()
