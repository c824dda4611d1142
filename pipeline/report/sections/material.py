"""The material of sections: a study's settings, results and tables; and helpers that they share."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import matplotlib.figure
import pandas as pd

from pipeline.analysis.person_means import person_means
from pipeline.engine.jobs import Jobs
from pipeline.report import figures
from pipeline.report.document.model import Figure
from pipeline.report.figures import Drawing
from pipeline.statistics import NONE_OF_ALIKE, T_OF_SHARES
from pipeline.study.session import Session
from pipeline.study.settings import Study
from pipeline.tables import table as tables
from pipeline.tables.catalogue import TABLES
from pipeline.tables.table import Row
from pipeline.words.phrases import listing

_NAME_LENGTH = 60

ORIGINS = {
    "recorded": "Recorded data: measured with people and devices.",
    "simulated": "Simulated data: made by a model, not measured with people.",
    "reconstructed": "Reconstructed data: invented to fit printed figures, not anybody's measurements.",
}


@dataclass(frozen=True)
class Material:
    """What a study's report is made from: its settings, its results, and every table that its stages wrote.

    `entries` has the folders of each stage: one per session, in their order, or a single one. `figures` is the folder
    for the figures of the report, and `jobs` draws them.
    """

    name: str
    study: Study
    results: Mapping[str, Any]
    sessions: tuple[Session, ...]
    entries: Mapping[str, tuple[Path, ...]]
    figures: Path
    inputs: Mapping[str, str]
    jobs: Jobs = field(default_factory=Jobs)
    own_pictures: tuple[Figure, ...] = ()
    _means: dict[str, pd.DataFrame] = field(default_factory=dict, init=False)

    @cached_property
    def measures(self) -> pd.DataFrame:
        """The table `measures`, read once."""
        return self.table("measures")

    def rows(self, table: str) -> list[Row]:
        """The rows of a table of results.json."""
        return list(self.results[table])

    def table(self, name: str) -> pd.DataFrame:
        """Any table by name; one that is kept for each session is read for all of them."""
        return tables.read(name, self.entries[TABLES[name].stage])

    def table_of(self, name: str, places: Iterable[int]) -> pd.DataFrame:
        """A table that is kept for each session, read for those at these places in `sessions`."""
        folders = self.entries[TABLES[name].stage]
        return tables.read(name, [folders[place] for place in places])

    def thinned(self, name: str, place: int) -> pd.DataFrame:
        """The same of one session, for what is looked at; of a long one every n-th row."""
        return tables.read_thinned(name, self.entries[TABLES[name].stage][place])

    def used(self) -> list[int]:
        """The places in `sessions` of those that are not excluded as a whole."""
        return [place for place, session in enumerate(self.sessions) if not self.study.exclusion_of(session)]

    def comparisons_of(self, measure: str) -> list[Row]:
        """The comparisons of one measure."""
        return [row for row in self.rows("comparisons") if row["measure"] == measure]

    def measured(self) -> list[str]:
        """Every measure that has descriptives, in their order."""
        return list(dict.fromkeys(row["measure"] for row in self.rows("descriptives")))

    def participant_means(self, measure: str) -> pd.DataFrame:
        """One row per participant and one column per condition, as the descriptives count them; made once."""
        if measure not in self._means:
            self._means[measure] = person_means(self.study, self.measures, measure)
        return self._means[measure]

    def of_shares(self, measure: str) -> bool:
        """Is each value of a measure a participant's share of answers 0 or 1?"""
        intervals = (row["interval"] for row in self.rows("descriptives") if row["measure"] == measure)
        return not {T_OF_SHARES, NONE_OF_ALIKE}.isdisjoint(intervals)

    def figure(
        self,
        name: str,
        drawing: Callable[..., matplotlib.figure.Figure],
        caption: str,
        alt: str,
        *arguments: Any,
    ) -> Figure:
        """Have a figure drawn into the report's figures, under words of the section's own."""
        self.jobs.add(figures.draw, drawing, self.figures / f"{name}.svg", *arguments)
        return Figure(f"figure-{name}", f"{name}.svg", caption, alt)

    def drawn(self, name: str, drawing: Drawing[...], *arguments: Any, more: str = "") -> Figure:
        """A figure with its own words, and more, such as what is left out."""
        caption, alt = drawing.words(*arguments)
        return self.figure(name, drawing, f"{caption}{more}", alt, *arguments)


def draw_now(path: Path, drawing: Drawing[...], *arguments: Any) -> Figure:
    """Draw a figure into a file, for a report that is not a study's, and name it in the text with its words."""
    figures.draw(drawing, path, *arguments)
    return Figure(f"figure-{path.stem}", path.name, *drawing.words(*arguments))


def safe_name(text: str) -> str:
    """A file name of letters, digits and dashes, different for different texts."""
    plain = "-".join("".join(c if c.isalnum() and c.isascii() else " " for c in text).split()).lower()
    if plain == text.replace("_", "-").replace("/", "-") and len(plain) <= _NAME_LENGTH:
        return plain
    return f"{plain[:_NAME_LENGTH]}-{hashlib.sha256(text.encode()).hexdigest()[:6]}".lstrip("-")


def first_of(shown: int, total: int, what: str) -> str:
    """A sentence that a figure shows only the first of many; nothing if it shows all."""
    return f" The first {shown} of {total} {what}." if total > shown else ""


def conditions_text(conditions: Sequence[str]) -> str:
    """The conditions in a sentence, with the baseline named."""
    return f"{listing(list(conditions))} ({conditions[0]} is the baseline)" if len(conditions) > 1 else conditions[0]
