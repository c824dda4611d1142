"""Checks one session's readings against each other and against study.yaml, to find mistakes in logging or settings.

Each check is a pure function of `Recorded` and yields findings; docs/checks.md says what each finds and what to do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from pipeline.sessions.checks import (
    agreement,
    clocks,
    counts,
    events,
    force,
    jumps,
    lost_orientation,
    noise,
    one_movement,
    orientation,
    publishers,
    reference,
    repeats,
    stamps,
)
from pipeline.sessions.checks.finding import Finding, Status, rows_of
from pipeline.sessions.checks.recorded import Recorded
from pipeline.tables.table import Row

Check = Callable[[Recorded], Iterable[Finding]]

CHECKS: tuple[Check, ...] = (
    stamps.rate,
    stamps.rounded,
    stamps.doubled,
    stamps.bursts,
    stamps.regular,
    stamps.clock,
    clocks.offset,
    clocks.together,
    counts.missing,
    counts.unusable,
    publishers.frame_ids,
    publishers.publishers,
    repeats.zeros,
    repeats.held,
    jumps.jumps,
    repeats.frozen,
    repeats.clipped,
    force.specific_force,
    force.gravity_length,
    force.mean_acceleration,
    orientation.length,
    lost_orientation.orientation_jumps,
    orientation.gyroscope,
    orientation.covariances,
    agreement.speed,
    one_movement.one_movement,
    agreement.lag,
    agreement.size,
    agreement.frame,
    reference.reference,
    noise.tracker_noise,
    noise.accelerometer_noise,
    events.targets,
    events.span,
    events.selections,
)
"""In the order of a report: checks of single streams first, then those that compare streams."""


def checked(recorded: Recorded) -> tuple[Finding, ...]:
    """The findings of all checks, in the order of CHECKS."""
    return tuple(finding for check in CHECKS for finding in check(recorded))


def check_rows(session: str, recorded: Recorded) -> list[Row]:
    """Rows of the table `checks`."""
    return rows_of(checked(recorded), session)


__all__ = ["CHECKS", "Check", "Finding", "Recorded", "Status", "check_rows", "checked"]
