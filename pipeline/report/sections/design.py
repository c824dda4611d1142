"""How the study was done and who took part."""

from __future__ import annotations

from pipeline.report.document.model import Block, Folded, Notice, Paragraph, Section, Strong, Table, Text, columns
from pipeline.report.sections.material import ORIGINS, Material, conditions_text
from pipeline.words.names import measure_label
from pipeline.words.numbers import number
from pipeline.words.phrases import counted, listing, participants_counted


def section(material: Material) -> Section:
    """Design and participants."""
    study = material.study
    blocks: list[Block] = [Paragraph(_participants(material))]
    if len(study.conditions) > 1:
        text = f"{listing(list(study.conditions))}."
        if material.rows("comparisons"):
            text = f"{conditions_text(study.conditions)}. A difference is the first minus the second in this order."
        blocks.append(Paragraph((Strong("Conditions: "), text)))
    else:
        blocks.append(Paragraph((Strong("Condition: "), f"{study.conditions[0]}.")))
    if material.sessions:
        blocks.append(
            Paragraph((Strong("Sessions: "), f"{counted(len(material.sessions), 'log')} of raw sensor streams."))
        )
    if study.shown:
        displays = [f"{condition} displayed the estimator {name}" for condition, name in study.shown.items()]
        blocks.append(Paragraph((Strong("Display: "), f"{listing(displays)}.")))
    blocks += material.own_pictures
    blocks += _design_check(material)
    notes: list[Text] = [(ORIGINS[study.data_origin],)]
    if study.notes.strip():
        notes.append((study.notes.strip(),))
    if study.citation.strip():
        notes.append((Strong("Source: "), study.citation.strip()))
    blocks.append(Notice("Where the data come from", tuple(notes), "information"))
    return Section("design", "Design and participants", tuple(blocks))


def _participants(material: Material) -> Text:
    """Number, sex and age, as far as participants.csv states them."""
    facts = material.results["study"]["participants"]
    who = f" ({listing([f'{count} {name}' for name, count in facts['sex'].items()])})" if facts.get("sex") else ""
    if facts.get("age"):
        age = facts["age"]
        who += f", aged {number(age['min'], 0)} to {number(age['max'], 0)} years (mean {number(age['mean'], 1)})"
    text = participants_counted(facts, f"{who}," if who and facts["n"] != facts["listed"] else who)
    if material.study.participants is None:
        text += "; the study has no participants table, so age and sex are not known"
    return (Strong("Participants: "), text + ".")


def _design_check(material: Material) -> list[Block]:
    """The table of the design check, and a sentence on what needs attention."""
    rows = material.rows("design_check")
    if not rows:
        return []
    cells = tuple(
        (
            row["what"].capitalize(),
            " ".join(filter(None, (row["condition"], row["measure"] and measure_label(row["measure"])))),
            row["found"],
            row["expected"],
            row["remark"] or "",
        )
        for row in rows
    )
    remarked = [row["what"] for row in rows if row["remark"]]
    text = f"no problem found in {counted(len(rows), 'check')}."
    if remarked:
        text = f"{counted(len(remarked), 'remark')}, about {listing(list(dict.fromkeys(remarked)))}."
    note = (
        f"Effects of the period and carry-over are each tested at the {100 * material.study.alpha:g} % level; not "
        "finding one does not mean that there is none, least of all for carry-over with few people."
    )
    within = any(row["what"].startswith(("order of", "times")) for row in rows)
    fair = (
        " A comparison within people is fair if each condition comes equally often early and late, and equally often"
        " after every other condition."
        if within
        else ""
    )
    table = Table(
        "table-design",
        f"Design check: who met which condition when, and whether it mattered.{fair}",
        columns(("What", "Of", "Found", "Expected", "Remark"), 5),
        cells,
        note if any(row["expected"] == "none" for row in rows) else "",
    )
    remarks = [
        Paragraph((f"{cell[0]}{f' ({cell[1]})' if cell[1] else ''}: {cell[2]}; {cell[4]}.",))
        for cell in cells
        if cell[4]
    ]
    summary = f"The whole design check: {counted(len(rows), 'row')}"
    return [Paragraph((Strong("Design: "), text)), *remarks, Folded(summary, (table,))]
