"""Parameter studies: many runs of one script with different values."""

from collections.abc import Callable
from typing import Any

from ...run_hooks import dry_runs
from .study import Study, study
from .task import StudyRun
from .variables import sets_of_values


def _first_case(build: Callable[..., Any], variables: Any, *_: Any, **__: Any) -> None:
    """Build and run only the first set of values, for a check of a script, as `study` is called."""
    build(**sets_of_values(variables)[0])


dry_runs["study"] = _first_case
