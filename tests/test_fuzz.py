"""Random calls of benchmarks/fuzz.py, and calls with one wrong argument: each gives a result or a clear error."""

import sys

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))
import fuzz  # noqa: E402
import reliability  # noqa: E402

pytestmark = pytest.mark.thorough


def test_random_calls_give_results_or_clear_errors():
    endings = fuzz.run(100, 0, ("constructors", "files", "fits", "mesh", "tools"))
    assert len(endings) == 100 and not [e for e in endings if e.bad]
    assert {"result", "InputError"} <= {e.how for e in endings}


def test_random_method_calls_give_results_or_clear_errors():
    """Of paths, scenes, materials, tools and what they give back: no traceback, nothing that is not a number."""
    endings = fuzz.run(150, 0, ("methods",))
    assert len(endings) == 150 and not [e for e in endings if e.bad]


def test_runs_of_random_scenes_end_or_name_the_failure():
    """Six of them; `python3 benchmarks/fuzz.py --kinds processes` makes others."""
    endings = fuzz.run(6, 9, ("processes",))
    assert len(endings) == 6 and not [e for e in endings if e.bad]


def test_a_call_that_ends_the_process_is_counted():
    """What ends the process counts as one bad call, and the calls after it are made all the same."""
    endings = fuzz.run(4, 0, ("itself",))
    assert [e.number for e in endings] == [0, 1, 2, 3] and all(e.bad for e in endings)
    assert {e.how.split(" (")[0] for e in endings} == {"the process died", "ZeroDivisionError"}


def test_every_wrong_argument_is_refused():
    """Of all public callables in the list of `reliability.calls`, with no argument of theirs left out."""
    found = reliability.bad_input()
    assert len(found) > 2000 and not [o for o in found if o.outcome != "right"]
