"""The other programs by the names that `--against` takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pipeline.analysis.against import in_pingouin, in_scipy, in_statsmodels
from pipeline.analysis.against.theirs import Calls
from pipeline.errors import PipelineError, did_you_mean


@dataclass(frozen=True)
class Library:
    """A library of Python: its name with its version, and its functions for each procedure."""

    version: Callable[[], str]
    calls: Calls


LIBRARIES: Mapping[str, Library] = {
    "scipy": Library(in_scipy.version, in_scipy.CALLS),
    "pingouin": Library(in_pingouin.version, in_pingouin.CALLS),
    "statsmodels": Library(in_statsmodels.version, in_statsmodels.CALLS),
}
R = "r"
"""The one program that is not of this process."""


def named(text: str) -> list[str]:
    """The programs that `pingouin,r` names, in order; PipelineError for one that is not known."""
    known = (*LIBRARIES, R)
    names = list(dict.fromkeys(name.strip().lower() for name in text.split(",") if name.strip()))
    if not names:
        raise PipelineError(f"--against: names no program{did_you_mean('', known)}")
    for name in names:
        if name not in known:
            raise PipelineError(f'--against: there is no program "{name}"{did_you_mean(name, known)}')
    return names
