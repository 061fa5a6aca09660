"""A stage of a process as the user declares it, and the same stage with items given by their numbers in the scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, as_list, check_name, check_type, finite, positive
from ..measures.targets import Target
from ..scene import support_checks, target_checks
from ..scene.scene import Scene
from .equations import Array
from .stepping import StepControl

_OF_CONTROL = ("pressure", "travel")

AT_LIMIT_POINT = (None, "continue", "snap_through", "stop")
"""Rules for a run whose control reaches a limit point; None: the default of `formingx.trace`."""


class Stage:
    """One stage of a process: a control with its target, prescribed amplitudes, or only a change of the active items.

    Process time is 0 at the start of the process. It passes in stages with a table, a speed or a duration; other stages
    are instantaneous.

    Args:
        name: name of the stage in the record of the run.
        control: the load, support or contact whose amplitude the stage varies, itself or its name.
        until: the target that ends the stage, met exactly, from either side, such as `travel(6.0)`. A travel counts
            from the reference configuration. With `amplitudes` it is a `process_time`, or None for the end of the
            tables. With a `duration` and no control it ends the stage early, such as `sag(30.0)`.
        intermediate: further targets to meet exactly during the stage; targets that are not met are left out.
        inactive: items that are inactive during the stage, themselves or their names, such as a support, a tool or a
            load. Laws of heat take part by their names, such as the heater of an oven. A support that becomes active
            again constrains the body at its current position. A load that becomes active again has its last value; its
            column is 0 while it is inactive.
        amplitudes: instead of `control`: {item: [(time, value), ...]}, piecewise linear in time, values in the user's
            units; the last value stays. If a table begins later than the stage, the item changes linearly from its
            current value. With `control`, the key is not an item but a function that makes targets, such as
            `enclosed_volume`. The control is then adjusted so that this quantity follows the table. The table may be a
            function of time; then `until` is the `process_time` of its end.
        speed: rate of the control, in its unit per time, greater than 0. Process time then passes in the stage.
        duration: process time of the stage. With `control`, the control changes linearly to its target in this time.
            Without, only time passes, until the target `until` if there is one.
        constant: with `control` and `duration`: a target, such as `force(2.0)`. The control is adjusted so that the
            target stays met.
        step: step control of this stage; default: the step control of the run.
        at_limit_point: rule where the control has a limit point. "continue": follow the path beyond it.
            "snap_through": jump to the next equilibrium. "stop": end the run. None: the default of `formingx.trace`.

    Raises:
        InputError: no target, both `control` and `amplitudes`, a table that goes back in time, an argument not allowed.

    >>> air = scene.driven
    >>> blow = fx.Stage("blow", amplitudes={air: [(0.0, 0.0), (2.0, 0.02)]})                   # time, pressure
    >>> done = fx.Process(scene).run([blow], progress=False)
    >>> done.last.time, round(float(done.last.measures["pressure"]), 9)
    (2.0, 0.02)
    """

    def __init__(self, name: str, control: Any = None, until: Target | None = None,
                 intermediate: Sequence[Target] = (), inactive: Sequence[Any] = (), *,
                 amplitudes: Mapping[Any, Sequence[Any]] | None = None, step: StepControl | None = None,
                 at_limit_point: str | None = None, speed: float | None = None, duration: float | None = None,
                 constant: Target | None = None):
        if not isinstance(name, str) or not name:
            raise InputError(f"Stage: name = {name!r}: must be a word")
        caller = self.label = f"Stage {name!r}"
        self.name, self.control, self.until = name, control, until
        self.intermediate = as_list(f"{caller}: intermediate", intermediate, "targets, such as pole_stretch(3)")
        self.inactive = as_list(f"{caller}: inactive", inactive, "items of the scene")
        check_name(f"{caller}: at_limit_point =", at_limit_point, AT_LIMIT_POINT)
        self.at_limit_point = at_limit_point
        self.step = check_type(f"{caller}: step", step, StepControl | None, "a StepControl or None")
        for target in (*([] if until is None else [until]), *self.intermediate):
            check_type(f"{caller}: target", target, Target, "a target, such as pole_stretch(3)")
        self.speed = None if speed is None else positive(f"{caller}: speed", speed)
        self.duration = None if duration is None else positive(f"{caller}: duration", duration)
        self.constant = check_type(f"{caller}: constant", constant, Target | None,
                                 "a target, such as force(2.0), or None")
        self.prescribed: tuple[Any, Any] | None = None
        if control is not None and amplitudes is not None:
            self.prescribed = self._prescribed(amplitudes)
        self.tables = [] if amplitudes is None or self.prescribed else self._tables(amplitudes)
        self._check(amplitudes)

    @property
    def timed(self) -> bool:
        """True if process time passes during the stage."""
        return bool(self.tables or self.prescribed or self.speed or self.duration)

    @property
    def waits(self) -> bool:
        """True if only time passes in the stage, until the target `until` is met."""
        return self.until is not None and self.control is None and not self.tables

    @property
    def highest(self) -> Target | None:
        """Target of the output quantity that the stage prescribes, with the largest value in its table of amplitudes.

        None if the stage prescribes no output quantity, or prescribes it by a function of time.
        """
        if self.prescribed is None or callable(self.prescribed[1]):
            return None
        return self.prescribed[0](float(np.max(self.prescribed[1][:, 1])))

    def _check(self, amplitudes: Any) -> None:
        """Raise `InputError` if arguments of the stage contradict each other, or if one is missing."""
        caller, until = self.label, self.until
        if self.constant is not None and (self.control is None
                                          or self.duration is None or until or amplitudes is not None):
            raise InputError(f"{caller}: constant = {self.constant}: give it control=..., what is adjusted to hold"
                             f" it, and duration=..., and neither until nor amplitudes")
        if amplitudes is not None and (self.speed or self.duration):
            raise InputError(f"{caller}: amplitudes has times of its own: give no speed or duration")
        if self.speed and (self.control is None or self.duration):
            raise InputError(f"{caller}: speed = {self.speed:g}: of what? give it control=... and until=..., no"
                             f" duration")
        if self.control is not None and until is None and self.constant is None and self.prescribed is None:
            raise InputError(f"{caller}: drives {self.control!r} without a target: give it until=..., such as"
                             f" travel(3)")
        if self.control is not None and self.duration and until and until.name.split("_")[-1] not in _OF_CONTROL:
            raise InputError(f"{caller}: until = {until} with a duration: must be a target of what is driven; give a"
                             f" speed instead")
        if self.control is None and amplitudes is None and until is not None and self.duration is None:
            raise InputError(f"{caller}: has a target but drives nothing: give it control=..., amplitudes=..., or"
                             f" duration=..., the longest time that it is waited for")
        if self.control is None and amplitudes is None and self.duration is None and self.intermediate:
            raise InputError(f"{caller}: has targets but drives nothing: give it control=..., amplitudes=... or"
                             f" duration=...")
        if amplitudes is not None and until is not None and until.name != "process_time":
            raise InputError(f"{caller}: until = {until}: tables are followed until a process_time, or to their end")

    def _prescribed(self, amplitudes: Any) -> tuple[Any, Any]:
        """Return (function that makes targets, amplitude) of the quantity that the control follows.

        The amplitude is a table (time, value), shape (n, 2), or a function of time. Raise `InputError` if the argument
        has another form, or if a function of time has no end.
        """
        if not isinstance(amplitudes, Mapping) or len(amplitudes) != 1 or not callable(next(iter(amplitudes))):
            raise InputError(f"{self.label}: both control and amplitudes are given: then amplitudes must be {{measure:"
                             f" [(time, value), ...]}} with a function that makes targets, such as enclosed_volume")
        ((make_target, amplitude),) = amplitudes.items()
        if callable(amplitude):
            if self.until is None:
                raise InputError(f"{self.label}: follows a function of time: until when? give it"
                                 " until=process_time(...)")
        else:
            ((make_target, amplitude),) = self._tables(amplitudes)
            if len(amplitude) < 2:
                raise InputError(f"{self.label}: the table of {make_target!r} must have two points at least")
        first = amplitude(0.0) if callable(amplitude) else amplitude[0, 1]
        check_type(f"{self.label}: amplitudes", make_target(finite(f"{self.label}: amplitudes: value", first)), Target,
                 "made by its measure")
        return make_target, amplitude

    def _tables(self, amplitudes: Any) -> list[tuple[Any, Array]]:
        """Return [(key, knots (time, value) in the user's units, shape (n, 2))] of the user's amplitudes.

        A key is a load, support or contact or its name; with `control`, a function that makes targets. Raise
        `InputError` for another form, or for times that do not increase.
        """
        if not isinstance(amplitudes, Mapping) or not amplitudes:
            raise InputError(f"{self.label}: amplitudes = {amplitudes!r}: must be {{item: [(time, value), ...]}}")
        tables = []
        for item, knots in amplitudes.items():
            if callable(item) and self.control is None:
                raise InputError(f"{self.label}: amplitudes: {getattr(item, '__name__', item)} is an output quantity:"
                                 f" give control=..., the load or tool that changes so that it follows its table")
            table = f"{self.label}: the table of {item!r}"
            rows = [as_list(table, row, "two numbers") for row in as_list(table, knots, "(time, value)")]
            if not rows or any(len(row) != 2 for row in rows):
                raise InputError(f"{table}: must be [(time, value), ...]")
            numbers = [(finite(f"{table}: time", t), finite(f"{table}: value", v)) for t, v in rows]
            for (a, _), (b, _) in zip(numbers, numbers[1:]):
                if b <= a:
                    raise InputError(f"{table} goes back in time, or stands still: {b:g} after {a:g}; times must"
                                     f" grow")
            tables.append((item, np.array(numbers)))
        return tables

    def __repr__(self) -> str:
        return f"Stage({self.name!r})"


class Plan(NamedTuple):
    """Plan of a stage: the loads, supports and contacts that it names, as indices in `Scene.items`.

    Attributes:
        stage: the stage.
        numbers: indices of the controlled item and of the other contacts of the same tool, ascending; empty without
            `Stage.control`.
        tables: [(index of the item, knots (time, value), shape (n, 2))] of the argument `amplitudes` of the stage; a
            tool has an entry for each of its contacts.
        inactive: indices of the inactive items and laws of heat (`Scene.heat_laws`), ascending.
        names: all items of the scene, as text, in the order of `Scene.items`.
    """

    stage: Stage
    numbers: list[int]
    tables: list[tuple[int, Array]]
    inactive: list[int]
    names: list[str]

    @property
    def prescribes_quantity(self) -> bool:
        """True if the control is adjusted so that an output quantity follows an amplitude in time, or stays constant.
        """
        return bool(self.stage.prescribed or self.stage.constant)

    @property
    def by_time(self) -> bool:
        """True if process time is the control: items follow tables, or only time passes."""
        return bool(self.tables or self.stage.duration and not self.numbers)


def plan(scene: Scene, stage: Stage) -> Plan:
    """Return the plan of a stage: the loads, supports and contacts that it names, as indices in `Scene.items`.

    Raise `InputError` if an item cannot be controlled or is missing, if the body is free to move, or if a target cannot
    be met.
    """
    caller = stage.label
    laws = scene.heat_laws
    named = [item for item in stage.inactive if isinstance(item, str) and item in laws]
    inactive = sorted({i for item in named for i in laws[item]} | {
        i for item in stage.inactive if item not in named
        for i in scene.same_tool(scene.number(f"{caller}: inactive", item))})
    driven = [stage.control] if stage.control is not None else [item for item, _ in stage.tables]
    numbers = [scene.number(caller, item) for item in driven]
    for number in numbers:
        item = scene.items[number]
        if not item.driven:
            raise InputError(f"{caller}: {item!r} cannot be driven: a Pressure without value, a"
                             f" PrescribedDisplacement, or a Contact with a direction can")
        if number in inactive and item.direction is None:        # an inactive tool may return to its start
            raise InputError(f"{caller}: {item!r} is both driven and left out")
    if len({scene.same_tool(number)[0] for number in numbers}) < len(numbers):
        raise InputError(f"{caller}: one item has two tables")
    active = [item for i, item in enumerate(scene.items) if i not in inactive]
    try:
        supports = [item for item in active if item in scene.supports]
        support_checks.check_held(scene, supports, any(contact in active for contact in scene.contacts))
        support_checks.check_driven(supports)
        targets = [t for t in (stage.until, stage.constant, *stage.intermediate) if t is not None]
        target_checks.check(scene, targets, inactive)
    except InputError as error:
        raise InputError(f"{caller}: {error}") from None
    for number, (_, table) in zip(numbers, stage.tables):
        item, most = scene.items[number], float(np.abs(table[:, 1]).max())
        if (why := target_checks.implausible(scene, item.quantity, most)) is not None:
            raise InputError(f"{caller}: the table of {item!r} goes to {most:g}: {why}")
    tables = [(i, table) for number, (_, table) in zip(numbers, stage.tables) for i in scene.same_tool(number)]
    return Plan(stage, scene.same_tool(numbers[0]) if stage.control is not None else [], tables, inactive,
                list(map(repr, scene.items)))
