"""Descriptives, the study's comparisons, and everything a report shows as tables and results.json."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.analysis.audit.beside_computed import compare_printed
from pipeline.analysis.comparisons import answered, compared, people_of
from pipeline.analysis.complete_cases import People, read_values
from pipeline.analysis.descriptives import descriptives, differences, intervals_within, means_of_measures
from pipeline.analysis.design_check import findings
from pipeline.analysis.fitts_law import fitts_law
from pipeline.analysis.group_descriptives import by_group, group_members
from pipeline.analysis.measure import ALL_DATA
from pipeline.analysis.normality import normality_rows
from pipeline.analysis.practice import learning_rows
from pipeline.analysis.preregistration.hypotheses import Done
from pipeline.analysis.preregistration.plan_and_done import plan_and_done
from pipeline.analysis.scores import UNDEFINED, refuse_undefined
from pipeline.analysis.simulated_reductions import reductions
from pipeline.engine.stage import Outcome, Work
from pipeline.errors import PipelineError
from pipeline.sessions.estimators import build_estimator
from pipeline.study import given_tables
from pipeline.study.measures import measure_order
from pipeline.study.preregistration import read_preregistered
from pipeline.study.pseudonyms import exclusions_under
from pipeline.study.settings import Study
from pipeline.study.simulation import SelectionSimulation
from pipeline.study.table_file import TableFile, table_file
from pipeline.tables import results
from pipeline.tables import table as tables
from pipeline.tables.catalogue import GATHERED, TABLES
from pipeline.tables.table import Row
from pipeline.words.phrases import listing


def run(work: Work) -> Outcome:
    """Write the study's descriptives, comparisons, exclusions and other tables, and results.json."""
    study = work.study
    for name in study.estimators:
        build_estimator(study, name)  # so that a misspelt estimator is an error even where there is no log to run it on
    measured = work.entry("measure")
    values = read_values(measured, people_of(study, work.folder, work.pseudonyms))
    measures, observations = values.measures, values.observations
    means = means_of_measures(study, measures)
    frames: dict[str, pd.DataFrame] = {
        "trials": tables.read("trials", measured),
        "measures": measures,
        "reliability": tables.read("reliability", measured),
        "descriptives": tables.frame("descriptives", descriptives(means, observations)),
    }
    written = {  # what nothing here looks at is never a frame, which takes most of the time for few rows
        "intervals_within": tables.of_rows("intervals_within", intervals_within(means, observations)),
        "differences": tables.of_rows("differences", differences(means)),
    }
    refuse_undefined(study, list(measures["measure"].unique()), tables.read("exclusions", measured))
    answers = answered(study, values)
    rows, left_out = compared(answers)
    frames["comparisons"] = tables.frame("comparisons", rows)
    rows, uncomparable = _comparisons_of_all_data(study, measured / ALL_DATA, values.people)
    written["comparisons_all_data"] = tables.of_rows("comparisons_all_data", rows)
    left_out += uncomparable
    requests = [answer.request for answer in answers]
    written["group_members"] = tables.of_rows("group_members", group_members(requests))
    written["normal_quantiles"] = tables.of_rows("normal_quantiles", normality_rows(requests))
    written["descriptives_by_group"] = tables.of_rows("descriptives_by_group", by_group(requests))
    design_rows = findings(study, requests, tables.read("orders", measured), frames["trials"], work.sessions)
    written["design_check"] = tables.of_rows("design_check", design_rows)
    movements = tables.read("movements", measured)
    written["learning"] = tables.of_rows("learning", learning_rows(movements, study.conditions))
    fitts = fitts_law(movements, study.conditions)
    written["fitts"] = tables.of_rows("fitts", fitts.lines)
    written["fitts_points"] = tables.of_rows("fitts_points", fitts.points)
    gathered = {name: tables.read(name, work.entries[stage]) for name, stage in GATHERED.items()}
    gathered["checks"] = pd.concat([tables.read("checks", work.entries[name]) for name in TABLES["checks"].stages[:-1]])
    left_out += _without_accuracy(work, gathered["quality"], gathered["accuracy"])
    frames["exclusions"] = pd.concat(
        [
            tables.frame("exclusions", _session_exclusions(work)),
            tables.read("exclusions", work.entries["ingest"]),
            tables.read("exclusions", measured),
            tables.frame("exclusions", left_out),
        ]
    )
    for name, table in gathered.items():
        frames[name] = _without_excluded(study, work, table)
    frames["accuracy_means"] = tables.frame("accuracy_means", accuracy_means(frames["accuracy"]))
    written["shown_at_selection"] = tables.of_rows("shown_at_selection", shown_at_selection(study, frames["trials"]))
    if study.printed is not None:
        path = work.folder / study.printed
        frames["printed"] = compare_printed(
            path, frames["descriptives"], frames["comparisons"], frames["accuracy_means"]
        )
    if isinstance(study.simulation, SelectionSimulation) and study.repeats is not None:
        file = TableFile(work.folder / study.repeats, "repeats", study.conditions)
        repeats = given_tables.read_repeats(file)
        rows = list(reductions(study.simulation, study.conditions, repeats))
        written["simulated_reductions"] = tables.of_rows("simulated_reductions", rows)
    facts = _participant_facts(work, measures, tables.read("exclusions", measured))
    written["preregistration"] = tables.of_rows("preregistration", _beside_plan(work, frames))
    written |= {name: tables.as_arrow(name, table) for name, table in frames.items()}
    for name, whole in written.items():
        tables.write(name, whole, work.out)
    results.write(work.out / "results.json", work.study_name, study, written, facts)
    return Outcome()


def _beside_plan(work: Work, frames: Mapping[str, pd.DataFrame]) -> list[Row]:
    """What was done beside what was preregistered; nothing where nothing was.

    Who stands in participants.csv and has no value was planned and did not take part.
    """
    frozen = read_preregistered(work.folder)
    if frozen is None:
        return []
    if work.pseudonyms is not None:
        exclusions = exclusions_under(work.pseudonyms, frozen.registered.exclusions)
        frozen = replace(frozen, registered=frozen.registered.model_copy(update={"exclusions": exclusions}))
    comparisons = list(tables.records("comparisons", frames["comparisons"]))
    details = [json.loads(row["details"]) if row["details"] else None for row in comparisons]
    rows = [{**row, "details": detail} for row, detail in zip(comparisons, details, strict=True)]
    measures = frames["measures"]
    known = sorted(set(measures["measure"]), key=measure_order)
    return plan_and_done(frozen, work.study, Done(known, measures["participant"].nunique(), rows))


def _comparisons_of_all_data(study: Study, folder: Path, people: People) -> tuple[list[Row], list[Row]]:
    """The comparisons as they would be without the exclusions of study.yaml, and rows that say why there are none.

    Both are empty where nothing is excluded. The excluded values may be ones that no test can take, which is no error.
    """
    if not study.exclusions:
        return [], []
    try:
        return compared(answered(study, read_values(folder, people)))[0], []
    except PipelineError as error:
        return [], [{"what": "no comparison without the exclusions", "reason": str(error)}]


def _without_accuracy(work: Work, quality: pd.DataFrame, accuracy: pd.DataFrame) -> list[Row]:
    """Sessions without accuracy, and estimators that have none in a session where others do, with the reason."""
    study = work.study
    if not study.estimators:
        return []
    reference = study.stream_of_kind("reference")
    with_reference = set(quality.loc[quality["stream"] == reference, "session"])
    rows: list[Row] = []
    for session in work.sessions:
        rated = set(accuracy.loc[accuracy["session"] == session.id, "estimator"])
        lacking = [name for name in study.estimators if name not in rated]
        if not lacking or (reference is not None and session.id not in with_reference):
            continue  # a session without its reference is listed as read in part, with the reason
        if study.tracker is None:
            reason = "study.yaml names no stream of kind position with all axes"
        elif not rated:
            reason = "the reference has no sample from 1 s after the first frame onwards"
        else:
            reason = f"{listing(lacking)}: no estimate from 1 s after the first frame onwards"
        rows.append({**session.ids, "what": "no accuracy", "reason": reason})
    return rows


def _participant_facts(work: Work, measures: pd.DataFrame, exclusions: pd.DataFrame) -> Row:
    """The number of participants with a value or a session that counts, and the facts of participants.csv about them.

    Who is listed there and has neither was not analysed, nor who has nothing but scores that are undefined.
    """
    counting = (session for session in work.sessions if not work.study.exclusion_of(session))
    people = set(measures["participant"]) | {str(session.participant) for session in counting}
    file = table_file(work.study, work.folder, "participants", work.pseudonyms)
    if file is None:
        unscored = exclusions.loc[exclusions["what"] == UNDEFINED, "participant"].dropna()
        everybody = people | set(unscored)
        return {"n": len(people)} if everybody == people else {"n": len(people), "listed": len(everybody)}
    return given_tables.participant_facts(given_tables.read_participants(file), people)


def _session_exclusions(work: Work) -> list[Row]:
    """The sessions that were set aside or read in part."""
    rows: list[Row] = []
    for what, sessions in (("session set aside", work.set_aside), ("session read in part", work.in_part)):
        rows += [{**session.ids, "what": what, "reason": reason} for session, reason in sessions]
    return rows + [{"session": name, "what": "file not used", "reason": reason} for name, reason in work.unused]


def _without_excluded(study: Study, work: Work, table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table without those of sessions that study.yaml excludes as a whole, which the exclusions list."""
    excluded = {session.id for session in work.sessions if study.exclusion_of(session)}
    return table[~table["session"].isin(excluded)] if excluded else table


def accuracy_means(accuracy: pd.DataFrame) -> list[Row]:
    """Each estimator's accuracy: means over the sessions that have the figure."""
    columns = [name for name in TABLES["accuracy_means"].names if name not in ("estimator", "n")]
    return [
        {"estimator": str(estimator), "n": len(rows), **{column: float(rows[column].mean()) for column in columns}}
        for estimator, rows in accuracy.groupby("estimator", sort=False)
    ]


def shown_at_selection(study: Study, trials: pd.DataFrame) -> list[Row]:
    """What each estimator would have shown when people selected: √(mean over participants of their MSEs)."""
    if set(trials["estimator"]) <= {"recorded"}:
        return []
    known = trials[trials["squared_error_mm2"].notna()]
    cell = ["condition", "estimator"]
    per_person = known.groupby([*cell, "participant"])["squared_error_mm2"].mean().reset_index()
    errors = {key: rows["squared_error_mm2"] for key, rows in per_person.groupby(cell)}
    return [
        {
            "condition": condition,
            "estimator": estimator,
            "n": len(errors[condition, estimator]),
            "rmse_mm": float(np.sqrt(errors[condition, estimator].mean())),
        }
        for condition in study.conditions
        for estimator in dict.fromkeys(known["estimator"])
        if (condition, estimator) in errors
    ]
