"""The README's script runs as printed, and gives the number that it prints."""

import re
import subprocess
import sys

import pytest
from conftest import ROOT


@pytest.mark.quick
def test_script(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.S)
    assert len(blocks) == 1
    done = subprocess.run([sys.executable, "-c", blocks[0]], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("0.493271")
    assert {f.name for f in tmp_path.iterdir()} == {"treloar.csv", "treloar.png", "treloar_3d.png"}
