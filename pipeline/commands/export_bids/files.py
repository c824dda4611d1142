"""Tables and facts as BIDS has them in files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

NO_VALUE = "n/a"


def write_tsv(path: Path, table: pd.DataFrame, header: bool = True) -> None:
    """A table, separated by tabs, n/a where there is no value."""
    path.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(path, sep="\t", index=False, header=header, na_rep=NO_VALUE, lineterminator="\n")


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Facts, such as those beside a table."""
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def descriptions(columns: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """What columns hold, as the file beside their table says it."""
    return {name: {"Description": about} for name, about in columns.items()}
