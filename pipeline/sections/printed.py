"""A publication's figures beside the computed ones."""

from __future__ import annotations

from pipeline.document.model import Block, Column, Notice, Paragraph, Section, Strong, Table, Text
from pipeline.sections.material import Material, Row
from pipeline.wording import counted


def section(material: Material) -> Section | None:
    """Printed and computed; None where the study has no printed.yaml."""
    rows = material.rows("printed")
    if not rows:
        return None
    figures = [row for row in rows if row["verdict"] in ("agrees", "differs", "undefined")]
    held = [row for row in rows if row["verdict"] in ("contradiction", "consistent")]
    agreeing = sum(row["verdict"] == "agrees" for row in figures)
    text: Text = (
        f"{rows[0]['source']} prints {counted(len(figures), 'figure')} of this study. ",
        Strong(f"{agreeing} of them come out to the last printed digit"),
        (
            f", {len(figures) - agreeing} not. Printed figures were also held against each other, in the room that"
            " rounding leaves."
        ),
    )
    blocks: list[Block] = [Paragraph(text)]
    contradictions: list[Text] = [
        (Strong(f"{row['what']}: "), f"{_printed(row)}; {row['explanation']}.")
        for row in held
        if row["verdict"] == "contradiction"
    ]
    if contradictions:
        blocks.append(Notice("Contradictions within the publication", tuple(contradictions)))
    blocks.append(
        Table(
            "table-printed",
            "Each printed figure with the computed one at as many digits. “Differs” names what no data can give"
            " together with the rest, or what these data do not give.",
            (Column("Figure", False), Column("Printed"), Column("Computed"), Column("Verdict", False)),
            tuple((row["what"], row["printed"], row["computed"], row["verdict"]) for row in figures),
        )
    )
    if held:
        blocks.append(
            Table(
                "table-held",
                "Printed figures held against each other.",
                (
                    Column("Statement", False),
                    Column("Printed", False),
                    Column("Follows", False),
                    Column("Verdict", False),
                ),
                tuple((row["what"], row["printed"], row["computed"], row["verdict"]) for row in held),
            )
        )
    return Section("printed", "Printed and computed", tuple(blocks))


def _printed(row: Row) -> str:
    text = str(row["printed"])
    return text if text.startswith("p =") else f"printed {text}"
