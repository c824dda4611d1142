"""What was preregistered beside what was done; empty where a study has no preregistered.yaml."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pipeline.analysis.preregistration.verdicts import ALTERED, DEVIATION, DEVIATIONS, EXPLORATORY, NOT_PLANNED
from pipeline.report.document.model import (
    Block,
    CrossReference,
    Notice,
    Paragraph,
    Section,
    Strong,
    Table,
    Text,
    columns,
)
from pipeline.report.sections.material import Material
from pipeline.report.traffic_lights import SYMBOLS
from pipeline.study.folder import PREREGISTERED
from pipeline.tables.table import Row
from pipeline.words.names import measure_label
from pipeline.words.phrases import counted

ANCHOR = "preregistration"
_DEVIATIONS_MAX = 6
_DIGEST_SHOWN = 12


def notice(material: Material) -> Iterator[Block]:
    """For the first page: every deviation in a line, or that there is none."""
    rows = material.rows("preregistration")
    if not rows:
        return
    deviating = [row for row in rows if row["verdict"] in (DEVIATION, EXPLORATORY)]
    digest = str(rows[0]["done"])[:_DIGEST_SHOWN]
    more = CrossReference("the whole comparison", ANCHOR)
    if not deviating:
        text = f"All that can be compared was done as preregistered ({PREREGISTERED}, SHA-256 {digest}…); see "
        yield Notice("Preregistered", ((text, more, "."),), "information")
        return
    lines: list[Text] = [_line(row) for row in deviating[:_DEVIATIONS_MAX]]
    beyond = len(deviating) - _DEVIATIONS_MAX
    lines.append((f"and {beyond} more: " if beyond > 0 else "See ", more, "."))
    yield Notice(f"Preregistered, with {counted(len(deviating), 'deviation')}", tuple(lines))


def caution(material: Material) -> Iterator[Text]:
    """For the first page: a warning where preregistered.yaml was changed after it was written."""
    for row in material.rows("preregistration"):
        if row["verdict"] == ALTERED:
            stated, has = row["planned"][:_DIGEST_SHOWN], row["done"][:_DIGEST_SHOWN]
            text = (
                f"{PREREGISTERED} states the SHA-256 {stated}… and has {has}…. What is called planned here may not"
                " be what was registered; put the file back as it was registered."
            )
            yield (Strong(f"{SYMBOLS['red']} red: the preregistration was altered after it was written: "), text)


def _line(row: Row) -> Text:
    """`Test (Completion time): planned Wilcoxon; done paired t.`"""
    of = f" ({_label(row['measure'])})" if row["measure"] else ""
    what = Strong(f"{row['what'].capitalize()}{of}: ")
    if row["verdict"] == EXPLORATORY:
        return (what, f"{row['done']} was not planned, so it is exploratory.")
    if row["planned"] == NOT_PLANNED:
        return (what, f"{row['done']} was not planned.")
    return (what, f"planned {row['planned']}; done {row['done']}.")


def _label(measures: str) -> str:
    """Measures for people; a pattern stays as study.yaml has it."""
    return ", ".join(name if "*" in name else measure_label(name) for name in measures.split(", "))


def section(material: Material) -> Section | None:
    """The whole comparison, deviations first; None without a preregistration."""
    rows = material.rows("preregistration")
    if not rows:
        return None
    deviating = [row for row in rows if row["verdict"] in DEVIATIONS]
    text = (
        f"Before the study, {PREREGISTERED} froze what study.yaml said then; its SHA-256 is {rows[0]['done']}, which"
        " the registered page should state too. "
        f"{counted(len(deviating), 'point')} of {len(rows)} {'differs' if len(deviating) == 1 else 'differ'}."
        " A comparison that was not planned is exploratory: its p says how surprising the data are, not that a"
        " hypothesis passed a test. Tests are two-sided, whatever direction was stated."
    )
    return Section(ANCHOR, "Preregistration", (Paragraph((text,)), _table(rows)))


def _table(rows: Sequence[Row]) -> Table:
    ranked = sorted(rows, key=lambda row: row["verdict"] not in DEVIATIONS)
    cells = tuple(
        (
            row["what"].capitalize(),
            _label(row["measure"]) if row["measure"] else "",
            row["planned"],
            row["done"],
            row["verdict"],
        )
        for row in ranked
        if row["what"] != PREREGISTERED or row["verdict"] == ALTERED
    )
    return Table(
        "table-preregistration",
        "What was preregistered, and what was done: deviations first.",
        columns(("What", "Of", "Planned", "Done", "Verdict"), 5),
        cells,
    )
