"""A publication's figures beside the computed ones, and which of them contradict each other."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.analysis.audit.beside_computed import NOTE
from pipeline.analysis.audit.finding import AGREEMENT, CONTRADICTION, REMARK, UNCHECKED
from pipeline.report.document.model import Block, Column, Notice, Paragraph, Section, Strong, Table, Text, columns
from pipeline.report.sections.material import Material
from pipeline.tables.table import Row
from pipeline.words.phrases import counted

_VERDICTS = {AGREEMENT: "Agree", CONTRADICTION: "Contradict", REMARK: "Remarks", UNCHECKED: "Cannot be checked"}


def section(material: Material) -> Section | None:
    """Printed and computed; None where the study has no printed.yaml."""
    rows = material.rows("printed")
    if not rows:
        return None
    figures = [row for row in rows if row["check"] is None]
    held = [row for row in rows if row["check"] not in (None, NOTE)]
    blocks: list[Block] = []
    notes = tuple((str(row["printed"]),) for row in rows if row["check"] == NOTE)
    if notes:
        blocks.append(Notice("Before you compare", notes, "information"))
    if figures:
        blocks += _beside_computed(figures)
    if held:
        blocks += _against_each_other(rows[0]["source"], held)
    return Section("printed", "Printed and computed", tuple(blocks))


def _beside_computed(figures: Sequence[Row]) -> list[Block]:
    agreeing = sum(row["verdict"] == "agrees" for row in figures)
    others = len(figures) - agreeing
    reproduced = {0: "None of them is", len(figures): "All of them are", 1: "1 of them is"}.get(
        agreeing, f"{agreeing} of them are"
    )
    text: Text = (
        f"{figures[0]['source']} prints {counted(len(figures), 'figure')} that this study has too. ",
        Strong(f"{reproduced} reproduced to the last printed digit"),
        f", {others} {'is' if others == 1 else 'are'} not." if others and agreeing else ".",
    )
    table = Table(
        "table-printed",
        "Each printed figure beside the computed one, with as many digits as were printed. A figure “differs” if these"
        " data do not give it, or if no data can give it together with the others.",
        (Column("Figure", False), Column("Printed"), Column("Computed"), Column("Verdict", False)),
        tuple((row["what"], row["printed"], row["computed"], row["verdict"]) for row in figures),
    )
    return [Paragraph(text), table]


def _against_each_other(source: str, held: Sequence[Row]) -> list[Block]:
    """Contradictions and remarks in words, the others by number."""
    blocks: list[Block] = [
        Paragraph(
            (
                f"The printed figures of {source} were compared with each other in {counted(len(held), 'check')},"
                " allowing for rounding.",
            )
        )
    ]
    for verdict, title in (
        (CONTRADICTION, "Contradictions within the publication"),
        (REMARK, "What a reader of the publication should know"),
    ):
        texts = tuple(_sentence(row) for row in held if row["verdict"] == verdict)
        if texts:
            blocks.append(Notice(title, texts, "care" if verdict == CONTRADICTION else "information"))
    checks = dict.fromkeys(row["check"] for row in held)
    counts = tuple(
        (
            check,
            *(str(sum((row["check"], row["verdict"]) == (check, verdict) for row in held)) for verdict in _VERDICTS),
        )
        for check in checks
    )
    blocks.append(
        Table(
            "table-held",
            "Printed figures compared with each other: how many statements agree with the others. results.json lists"
            " each of them.",
            columns(("Check", *_VERDICTS.values()), 1),
            counts,
        )
    )
    return blocks


def _sentence(row: Row) -> Text:
    text = str(row["printed"])
    printed = text if not text[:1].isdigit() else f"printed {text}"
    return (Strong(f"{row['what']}: "), f"{printed}; {row['explanation']}.")
