"""Arrays as tables of one row per value, with neutral names: the form in which other programs take them.

Participants, groups and levels are numbers, factors are f1, f2, …: nothing that a study's files say reaches another
program as its formula or code.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.analysis.against.problems import Groups, Model, Within
from pipeline.statistics.mixed import Factor

GROUP = "g"


def of_within(data: Within) -> pd.DataFrame:
    """Columns participant, f1, f2, …, value, and g of a mixed design."""
    n, *levels = data.values.shape
    places = np.indices((n, *levels)).reshape(1 + len(levels), -1)
    table = pd.DataFrame({"participant": places[0]})
    for number, place in enumerate(places[1:], 1):
        table[f"f{number}"] = place
    if data.codes is not None:
        table[GROUP] = data.codes[places[0]]
    return table.assign(value=data.values.ravel())


def factors_of(data: Within) -> list[str]:
    """The names f1, f2, … of its factors."""
    return [f"f{number}" for number in range(1, data.values.ndim)]


def effect_of(data: Within) -> list[str]:
    """The names of the factors in the row's effect, the group first."""
    return [GROUP] * data.with_group + [f"f{place + 1}" for place in data.effect]


def of_groups(data: Groups) -> pd.DataFrame:
    """Columns g and value."""
    number = np.repeat(np.arange(len(data.groups)), [len(group) for group in data.groups])
    return pd.DataFrame({GROUP: number, "value": np.concatenate([*data.groups])})


def of_model(data: Model) -> pd.DataFrame:
    """Columns participant, f1, f2, … in the order of the model's columns, and value."""
    people = {name: number for number, name in enumerate(dict.fromkeys(data.participants))}
    table = pd.DataFrame({"participant": [people[name] for name in data.participants]})
    for name, column in zip(names_of(data).values(), data.columns.values(), strict=True):
        table[name] = column.codes if isinstance(column, Factor) else column.values
    return table.assign(value=data.values)


def names_of(data: Model) -> dict[str, str]:
    """The name f1, f2, … of each column."""
    return {name: f"f{number}" for number, name in enumerate(data.columns, 1)}


def terms_of(data: Model) -> list[str]:
    """Its terms in these names: `f1:f2`."""
    names = names_of(data)
    return [":".join(names[part] for part in term.split(":")) for term in data.terms]
