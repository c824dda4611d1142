"""Nothing is believed that the data contradict: one session's readings against each other and against study.yaml.

Each check is a pure function of `Recorded` and yields findings; docs/checks.md says what each sees and what to do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict

from pipeline.sessions.checks import agreement, events, force, noise, orientation, publishers, repeats, stamps
from pipeline.sessions.checks.finding import Finding, Status
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
    publishers.frame_ids,
    publishers.publishers,
    repeats.zeros,
    repeats.held,
    repeats.frozen,
    repeats.clipped,
    force.specific_force,
    force.gravity_length,
    force.mean_acceleration,
    orientation.length,
    orientation.gyroscope,
    orientation.covariances,
    agreement.speed,
    agreement.lag,
    agreement.size,
    agreement.frame,
    noise.tracker_noise,
    noise.accelerometer_noise,
    events.targets,
    events.span,
    events.selections,
)
"""In the order of a report: what a stream is by itself, then what streams say of each other."""


def checked(recorded: Recorded) -> tuple[Finding, ...]:
    """What every check finds, in their order."""
    return tuple(finding for check in CHECKS for finding in check(recorded))


def check_rows(session: str, recorded: Recorded) -> list[Row]:
    """Rows of the table `checks`."""
    return [{"session": session, **asdict(one), "message": one.message or None} for one in checked(recorded)]


__all__ = ["CHECKS", "Check", "Finding", "Recorded", "Status", "check_rows", "checked"]
