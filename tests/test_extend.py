"""Methods that extensions attach to results: `formingx.results.extend`."""

import pytest

import formingx as fx
from formingx.results.extend import method_of


class Result:
    """A result with one method of its own."""

    def own(self):
        return "own"


def test_a_function_becomes_a_method_under_its_name():
    @method_of(Result)
    def doubled(result, number):
        """Double a number."""
        return result.own(), 2 * number

    assert Result().doubled(3) == doubled(Result(), 3) == ("own", 6)
    assert Result.doubled.__doc__ == "Double a number."


def test_extensions_replace_no_existing_member():
    def own(result):
        return "another"

    own.__module__ = "somewhere"
    with pytest.raises(TypeError, match="Result.own is defined already"):
        method_of(Result)(own)
    assert Result().own() == "own"


def test_wrong_calls_of_attached_methods_are_explained():
    """`path.springback(...)` says what it takes, as a method of the class does."""
    from formingx import _calls

    class Other:
        pass
    Other.__module__ = "formingx.results"

    @method_of(Other)
    def halved(result, number: float):
        return number / 2

    _calls._explain_methods(Other)
    assert Other().halved(3.0) == 1.5
    with pytest.raises(fx.InputError, match="Other.halved: number = 'three': must be a number"):
        Other().halved("three")
