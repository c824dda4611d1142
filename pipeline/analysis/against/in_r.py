"""The comparisons in R, as its users call it: the tables that `recompute.R` reads, and what it wrote.

All problems go to one process of R, which takes seconds to start. How that is started is a matter of the commands.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.analysis.against import long_tables
from pipeline.analysis.against.problems import P_ADJUSTED, Data, Family, Groups, Model, Paired, Problem, Within
from pipeline.analysis.against.theirs import Figure, Theirs, fitted
from pipeline.statistics.bayes import PRIOR_SCALE
from pipeline.statistics.mixed import Factor

SCRIPT = Path(__file__).with_name("recompute.R")
"""What R runs in a folder that holds `tables` as files; it writes `ANSWERS` there."""
ANSWERS = "answers.csv"
PROCEDURES = (
    "t_paired",
    "t_welch",
    "wilcoxon",
    "mann_whitney",
    "tost",
    "bayes_t",
    "friedman",
    "kruskal",
    "anova_welch",
    "rm_anova",
    "mixed_anova",
    "mixed_model",
    P_ADJUSTED,
)
"""What the script knows."""
_ADJUSTMENTS = {
    "holm": "holm",
    "bonferroni": "bonferroni",
    "hochberg": "hochberg",
    "hommel": "hommel",
    "benjamini_hochberg": "BH",
    "benjamini_yekutieli": "BY",
}
_SETTINGS: Mapping[str, Any] = dict.fromkeys(("factors", "terms", "effect", "method"), "") | dict.fromkeys(
    ("place", "low", "high", "scale")
)


def knows(problem: Problem) -> bool:
    """Does R have it? Its table of a mixed model tests terms, not two levels of several; p.adjust has no Šidák."""
    data = problem.data
    if isinstance(data, Family):
        return data.method in _ADJUSTMENTS
    if isinstance(data, Model) and data.levels is not None:
        column = data.columns[data.term]
        return isinstance(column, Factor) and len(column.levels) == 2
    return problem.procedure in PROCEDURES


def tables(problems: Sequence[Problem]) -> dict[str, str]:
    """The files that the script reads, by name: a row for each problem, and a row for each value of each."""
    rows = [{"problem": at, "procedure": one.procedure, **_settings(one)} for at, one in enumerate(problems)]
    values = pd.concat([_values(one.data).assign(problem=at) for at, one in enumerate(problems)], ignore_index=True)
    for name in ("participant", long_tables.GROUP):
        values[name] = values.get(name)
    return {
        "problems.csv": pd.DataFrame(rows).to_csv(index=False, na_rep="NA"),
        "values.csv": values.to_csv(index=False, na_rep="NA"),
    }


def _settings(problem: Problem) -> dict[str, Any]:
    """What the script must know of a problem beside its values."""
    data, entry, own = problem.data, problem.entry, dict(_SETTINGS)
    if isinstance(data, Within):
        own |= {"factors": " ".join(long_tables.factors_of(data)), "effect": ":".join(long_tables.effect_of(data))}
    if isinstance(data, Model):
        names = long_tables.names_of(data)
        factors = [names[name] for name, column in data.columns.items() if isinstance(column, Factor)]
        terms = long_tables.terms_of(data)
        effect = terms[list(data.terms).index(data.term)]
        own |= {"factors": " ".join(factors), "terms": " ".join(terms), "effect": effect}
    if isinstance(data, Family):
        own |= {"method": _ADJUSTMENTS[data.method], "place": data.place + 1}
    if problem.procedure == "tost" and entry.bounds is not None:
        own |= {"low": entry.bounds[0], "high": entry.bounds[1]}
    if problem.procedure == "bayes_t" and entry.prior_scale != PRIOR_SCALE:
        own |= {"scale": entry.prior_scale}
    return own


def _values(data: Data) -> pd.DataFrame:
    """A problem's values, one per row."""
    if isinstance(data, Paired):
        return long_tables.of_within(Within(np.stack([data.first, data.second], axis=1), (0,))).assign(
            g=lambda table: table["f1"]
        )
    if isinstance(data, Within):
        return long_tables.of_within(data)
    if isinstance(data, Groups):
        return long_tables.of_groups(data)
    if isinstance(data, Model):
        return long_tables.of_model(data)
    return pd.DataFrame({"value": data.p_values})


def read(answers: str) -> dict[int, list[Theirs]]:
    """What R wrote, by the number of the problem; a last line that was not finished does not count."""
    whole = answers[: answers.rfind("\n") + 1]
    found: dict[int, dict[str, Theirs]] = {}
    for problem, call, name, value, message in csv.reader(io.StringIO(whole)):
        calls = found.setdefault(int(problem), {})
        theirs = calls.get(call, Theirs(call))
        if message:
            calls[call] = replace(theirs, failure=message)
        else:
            figure = fitted(_number(value)) if "lmer" in call else Figure(_number(value))
            calls[call] = replace(theirs, figures={**theirs.figures, name: figure})
    return {problem: list(calls.values()) for problem, calls in found.items()}


def _number(text: str) -> float:
    return float("nan") if text == "NA" else float(text)
