"""The tool of tests on several ranks: output of scripts, scripts that fail or never end."""

import pytest
from on_ranks import Ranks

pytestmark = pytest.mark.thorough

WHO = "from mpi4py import MPI; print(MPI.COMM_WORLD.rank, *__import__('sys').argv[1:])"
STUCK = "from mpi4py import MPI; MPI.COMM_WORLD.rank or MPI.COMM_WORLD.Barrier()"


def test_scripts_one_after_the_other_and_one_that_fails():
    two = Ranks(2)
    assert two.run(WHO, ["a"], 60) == ["0 a\n", "1 a\n"]
    assert two.run("x = 1", [], 60) == ["", ""]
    with pytest.raises(AssertionError, match="(?s)rank [01]:\n.*NameError: name 'x' is not defined"):
        two.run("print(x)", [], 60)
    assert not two.alive


def test_a_rank_that_waits_for_another_one():
    two = Ranks(2)
    with pytest.raises(AssertionError, match="no answer of all ranks for 1 s"):
        two.run(STUCK, [], 1)
    assert not two.alive


def test_a_rank_that_crashes():
    two = Ranks(2)
    with pytest.raises(AssertionError, match="a rank crashed\n(?s:.)*Aborted"):
        two.run("import os; os.abort()", [], 60)
    assert not two.alive
