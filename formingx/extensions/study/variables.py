"""Sets of values of the variables of a parameter study."""

import itertools
from collections.abc import Mapping
from typing import Any

from ...errors import InputError, as_list, finite


def sets_of_values(variables: Any) -> list[dict[str, float]]:
    """Return {name: value} of each run of a study: sets, or all combinations of values; others are an InputError."""
    if isinstance(variables, Mapping):
        levels = {str(name): [finite(f"study: {name}", v) for v in as_list(f"study: {name}", values, "numbers")]
                  for name, values in variables.items()}
        found = [dict(zip(levels, row)) for row in itertools.product(*levels.values())]
    else:
        found = [{str(k): finite(f"study: {k}", v) for k, v in dict(case).items()}
                 for case in as_list("study: variables", variables, "{name: value}")]
    if not found or not found[0] or any(set(case) != set(found[0]) for case in found):
        raise InputError("study: variables: must be {name: values}, with at least one value each, or a list of"
                         " {name: value} with the same names")
    return found
