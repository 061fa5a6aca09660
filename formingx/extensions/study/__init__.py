"""Parameter studies."""

from collections.abc import Callable
from typing import Any

from ...run_hooks import dry_runs
from .study import Study, StudyRun, study
from .variables import design


def _first_case(build: Callable[..., Any], variables: Any, *_: Any, **__: Any) -> None:
    build(**design(variables)[0])


dry_runs["study"] = _first_case
