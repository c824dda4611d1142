"""Workbooks give what their tables would give as CSV."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import openpyxl  # type: ignore[import-untyped]
import pandas as pd
import pytest

from tests.pipeline.helpers import Steadyhand
from tests.pipeline.study.kept_tables import CASES, Folder, add, copied, means, squared_errors


def workbook(path: Path, sheets: dict[str, list[list[Any]]]) -> None:
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)


def test_a_workbook_gives_the_same_as_its_table_in_csv(tmp_path: Path, steadyhand: Steadyhand) -> None:
    trials = pd.read_csv(CASES / "cp1252" / "trials.csv", encoding="cp1252")
    study = copied("cp1252", tmp_path)
    (study / "trials.csv").unlink()
    settings = (study / "study.yaml").read_text(encoding="utf-8").replace("trials.csv", "trials.xlsx")
    (study / "study.yaml").write_text(settings, encoding="utf-8")
    rows = [list(trials.columns), *trials.astype(object).to_numpy().tolist()]
    workbook(study / "trials.xlsx", {"Daten": rows, "leer": []})
    assert steadyhand("compare", study).code == 0
    assert means(steadyhand, "selection_mse_mm2") == pytest.approx(squared_errors(trials).to_dict(), rel=1e-12)


def test_a_sheet_among_several_a_title_above_the_header_and_numbers_kept_as_text(
    folder: Folder, steadyhand: Steadyhand
) -> None:
    settings = "conditions: [a, b]\nmeasures: data.xlsx\n"
    rows: list[list[Any]] = [
        ["Studie 3"],
        [],
        ["participant", "condition", "measure", "value"],
        [1, "a", "m", "2,5"],
        [1, "b", "m", 3.5],
    ]
    study = folder(settings)
    workbook(study / "data.xlsx", {"Notizen": [["nichts"]], "Werte": rows})
    refused = steadyhand("compare", study)
    assert refused.code == 2
    assert "has 2 sheets with something in them (Notizen, Werte)" in refused.err
    add(study, 'format: {decimal: ",", measures: {sheet: Wrte, header_row: 3}}')
    assert 'there is no sheet "Wrte"; did you mean "Werte"?' in steadyhand("compare", study).err
    add(study)
    text = (study / "study.yaml").read_text(encoding="utf-8").replace("Wrte", "Werte")
    (study / "study.yaml").write_text(text, encoding="utf-8")
    assert steadyhand("compare", study).code == 0
    assert means(steadyhand, "m") == {"a": 2.5, "b": 3.5}


def test_a_file_that_only_has_a_workbooks_name_is_said_to_be_none(folder: Folder, steadyhand: Steadyhand) -> None:
    study = folder("conditions: [a, b]\nmeasures: data.xlsx\n", **{"data.xlsx": "PK not really"})
    ran = steadyhand("compare", study)
    assert ran.code == 2
    assert "data.xlsx: is not a workbook that can be read" in ran.err
    assert "save it as .xlsx or as CSV in UTF-8" in ran.err
