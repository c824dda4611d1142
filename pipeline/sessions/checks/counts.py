"""How much of a stream is not there, or of no use: counts that are harmless while they are small."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.sessions.checks.finding import Finding, graded, of
from pipeline.sessions.checks.recorded import Recorded
from pipeline.sessions.sampling import sampling

MISSING, UNUSABLE = "missing samples", "unusable samples"

_MISSING = (0.2, 0.5)  # a tenth lost at random does no harm: an estimator carries the hand over such gaps
_UNUSABLE = (0.01, 0.1)
_FEWEST = 50  # messages


def missing(recorded: Recorded) -> Iterator[Finding]:
    """Samples that the stream's own rate expects and the log does not have."""
    for one in recorded.streams:
        if len(one.times.stamp_ns) < _FEWEST:
            continue
        found = sampling(one.times.stamp_ns)
        if found.missing is None:  # `bursts` and `regular stamps` say why
            continue
        status = graded(found.share, *_MISSING)
        message = ""
        if status != "green":
            message = (
                f'{found.missing} of {found.expected} samples of "{one.name}" are missing ({found.share:.0%}), by its '
                "usual rate: the network or the recorder does not keep up; record on the machine that measures, or "
                "lower the rate"
            )
        yield Finding(of(MISSING, one.name), status, f"{found.share:.1%}", f"at most {_MISSING[0]:.0%}", message)


def unusable(recorded: Recorded) -> Iterator[Finding]:
    """Samples that were left out because they are no numbers, or of another day."""
    for one in recorded.streams:
        left_out = one.times.left_out
        share = left_out / (left_out + len(one.times.stamp_ns))
        status = graded(share, *_UNUSABLE)
        message = ""
        if status != "green":
            message = (
                f'{left_out} samples of "{one.name}" ({share:.0%}) are NaN, infinite or of another day, and were left '
                "out: the sensor or its driver fails now and then; send nothing while nothing is measured"
            )
        yield Finding(of(UNUSABLE, one.name), status, f"{share:.1%}", f"at most {_UNUSABLE[0]:.0%}", message)
