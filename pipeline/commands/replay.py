"""`replay`: estimators with other settings over one or many studies, and one report that ranks them."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from pipeline.analysis.ranking import ranked
from pipeline.commands import console
from pipeline.commands.publish import copy, publish_provenance, refuse_inputs, refuse_study
from pipeline.commands.studies import for_each_study, refuse_same_names
from pipeline.engine.cache import Entry
from pipeline.engine.folders import reports_folder
from pipeline.engine.messages import computed_message, session_messages
from pipeline.engine.resources import Resources
from pipeline.engine.result import Result
from pipeline.engine.run import bring_up_to_date, run_variants
from pipeline.engine.stage import Stage
from pipeline.errors import PipelineError
from pipeline.report.document import html, pdf
from pipeline.report.sections.replay import document, in_doubt
from pipeline.sessions.variants import Variant, read_changes, read_estimators, variants
from pipeline.stages import INGEST, REPLAY
from pipeline.study.folder import load_study
from pipeline.study.session import Session
from pipeline.tables import results
from pipeline.tables import table as tables
from pipeline.tables.catalogue import in_results_of, written_by
from pipeline.tables.table import Row
from pipeline.words.accuracy_reference import SMOOTHED, reference_phrase
from pipeline.words.numbers import interval, milliseconds, number

_PAGE, _PRINT, _RESULTS = "replay.html", "replay.pdf", "results.json"
_TABLES, _IN_RESULTS = written_by("replay"), in_results_of("replay")


@dataclass
class _Gathered:
    """The tables of all studies so far."""

    studies: list[Row] = field(default_factory=list)
    results: list[Result] = field(default_factory=list)
    accuracy: list[pd.DataFrame] = field(default_factory=list)
    trials: list[pd.DataFrame] = field(default_factory=list)
    exclusions: list[Row] = field(default_factory=list)


def replay(
    studies: Sequence[Path],
    changes: Sequence[str],
    estimators: Path | None,
    out: Path | None,
    jobs: int | None,
    cache: Path | None,
    executor: str,
) -> None:
    """Replay the studies and write the report; exit with the highest of their codes."""
    refuse_same_names(studies)
    folder = out or reports_folder() / "replay"
    refuse_study(folder)
    settings_to_try, further_estimators = read_changes(changes), read_estimators(estimators)
    gathered = _Gathered()

    def bring(study: Path, stages: Sequence[Stage], resources: Resources) -> Result:
        try:
            listed = variants(load_study(study), settings_to_try, further_estimators, estimators)
        except PipelineError as error:
            raise PipelineError(_in_study(study, str(error))) from None
        result = bring_up_to_date(study, stages, resources)
        sessions, excluded = _without_excluded(result)
        if not sessions:
            raise PipelineError(f"{study}: there is no session to replay")
        entries = run_variants(result, REPLAY, [variant.study for variant in listed], sessions, resources)
        _gather(gathered, result, listed, list(zip(sessions, entries, strict=True)), excluded)
        return result

    def then(_folder: Path, result: Result) -> int:
        for line in session_messages(result):
            console.warn(line)
        console.say(f"{result.name}: {computed_message(result)}")
        return result.exit_code

    code = for_each_study(studies, INGEST, jobs, cache, then, bring=bring, executor_name=executor)
    if gathered.results:
        further = () if estimators is None else ("--estimators", estimators.name)
        changed = [word for change in changes for word in ("--set", change)]
        _write(gathered, folder, ("replay", *(result.name for result in gathered.results), *changed, *further))
    sys.exit(code)


def _in_study(study: Path, message: str) -> str:
    return message if message.startswith(str(study)) else f"{study}/{message}".replace("/--", ": --")


def _without_excluded(result: Result) -> tuple[list[Session], list[Row]]:
    """The sessions to replay, and a row of exclusions for each that study.yaml excludes."""
    sessions, rows = [], []
    for session in result.sessions:
        decision = result.study.exclusion_of(session)
        if decision is None:
            sessions.append(session)
        else:
            rows.append({**session.ids, "what": "excluded in study.yaml", "reason": decision.reason})
    return sessions, rows


def _gather(
    gathered: _Gathered,
    result: Result,
    listed: Sequence[Variant],
    entries: Sequence[tuple[Session, list[Entry]]],
    excluded: list[Row],
) -> None:
    """Add a study's tables, with a row of exclusions for each session that failed with a variant."""
    rows: list[Row] = [
        *({**session.ids, "what": "session set aside", "reason": why} for session, why in result.set_aside),
        *({**session.ids, "what": "session read in part", "reason": why} for session, why in result.in_part),
        *({"session": name, "what": "file not used", "reason": why} for name, why in result.unused),
        *excluded,
    ]
    accuracy = _of_variants("accuracy", listed, entries)
    trials = _of_variants("trials", listed, entries).assign(study=result.name)
    gathered.accuracy.append(tables.as_table("accuracy", accuracy))
    gathered.trials.append(tables.as_table("replay_trials", trials))
    rows += _failures(result, listed, entries, set(zip(accuracy["session"], accuracy["place"], strict=True)))
    gathered.results.append(result)
    gathered.exclusions += [{"study": result.name, **row} for row in rows]
    gathered.studies.append(
        {
            "name": result.name,
            "title": result.study.title,
            "data_origin": result.study.data_origin,
            "sessions": len(entries),
            "sessions_in_doubt": _in_doubt(result, [session.id for session, _ in entries]),
            "variants": [_settings(variant) for variant in listed],
        }
    )


def _in_doubt(result: Result, sessions: Sequence[str]) -> list[str]:
    """The replayed sessions with a red check, whose readings contradict each other or study.yaml."""
    checks = tables.read("checks", [result.entries["ingest"][session].folder for session in sessions])
    red = set(checks.loc[checks["status"] == "red", "session"])
    return [session for session in sessions if session in red]


def _failures(
    result: Result,
    listed: Sequence[Variant],
    entries: Sequence[tuple[Session, list[Entry]]],
    with_accuracy: Collection[tuple[str, int]],
) -> Iterator[Row]:
    """A row of exclusions for each session and variant without accuracy; `result` takes the sessions set aside."""
    for session, of_session in entries:
        for place, (variant, entry) in enumerate(zip(listed, of_session, strict=True)):
            label, reason = variant.label or variant.estimator, entry.outcome["set_aside"]
            if reason is not None:
                result.set_aside.append((session, f"{label}: {reason}"))
                yield {**session.ids, "variant": label, "what": "session set aside", "reason": reason}
            elif (session.id, place) not in with_accuracy:
                missing = "no instant with both an estimate and a reference"
                yield {**session.ids, "variant": label, "what": "no accuracy", "reason": missing}


def _of_variants(name: str, listed: Sequence[Variant], entries: Sequence[tuple[Session, list[Entry]]]) -> pd.DataFrame:
    """A table of all sessions and variants, session by session, with each variant's label and `place` in the list."""
    parts = []
    for place, variant in enumerate(listed):
        of_variant = [of_session[place] for _, of_session in entries]
        folders = [entry.folder for entry in of_variant if entry.outcome["set_aside"] is None]
        parts.append(tables.read(name, folders).assign(variant=variant.label, place=place))
    order = {session.id: number for number, (session, _) in enumerate(entries)}
    return pd.concat(parts).sort_values("session", key=lambda ids: ids.map(order), kind="stable")


def _settings(variant: Variant) -> Row:
    """A variant with all settings that were stated for it."""
    settings = variant.study.estimators[variant.estimator].model_dump(mode="json", exclude_unset=True)
    return {"estimator": variant.estimator, "variant": variant.label, "settings": settings}


def _write(gathered: _Gathered, folder: Path, command: Sequence[str]) -> None:
    """Write replay.html, replay.pdf, results.json and the tables as Parquet, and print the ranking."""
    accuracy, trials = pd.concat(gathered.accuracy), pd.concat(gathered.trials)
    frames = {
        "accuracy": accuracy,
        "replay_trials": trials,
        "replay_means": tables.frame("replay_means", ranked(accuracy, trials)),
        "replay_exclusions": tables.frame("replay_exclusions", gathered.exclusions),
    }
    files = [_PAGE, _PRINT, _RESULTS, *(f"{name}.parquet" for name in _TABLES)]
    for result in gathered.results:
        refuse_inputs(result, folder, files)
    with tempfile.TemporaryDirectory() as filled, tempfile.TemporaryDirectory() as drawn:
        _fill(gathered.studies, frames, Path(drawn), Path(filled))
        for name in files:
            copy(Path(filled) / name, folder / name)
    publish_provenance(gathered.results, folder, command)
    _say(list(tables.records("replay_means", frames["replay_means"])), reference_phrase(accuracy["reference"]))
    for caution in in_doubt(gathered.studies):
        console.say(caution)
    console.say(f"Report: {console.short_path(folder / _PAGE)}  {console.short_path(folder / _PRINT)}")


def _fill(studies: Sequence[Row], frames: Mapping[str, pd.DataFrame], drawn: Path, folder: Path) -> None:
    """Write every file of the report into a folder of its own, and the figures it shows into `drawn`."""
    results.write_replay(folder / _RESULTS, studies, {name: frames[name] for name in _IN_RESULTS})
    for name in _TABLES:
        tables.write(name, frames[name], folder)
    pages = document(studies, frames, drawn)
    html.render(pages, drawn, folder / _PAGE)
    pdf.render(pages, drawn, folder / _PRINT)


def _say(rows: Sequence[Row], standard: str) -> None:
    """Print the means over all studies, or of the only one; ranked if there is a reference."""
    first = [row for row in rows if row["study"] == rows[0]["study"]]
    error = f"mm from {standard}" if SMOOTHED in standard else "RMSE mm"
    header = ("variant", "sessions", error, "95 % interval", "lag ms", "jitter mm")
    lines = [
        (
            row["variant"] or row["estimator"],
            str(row["n"]),
            number(row["rmse_mm"]),
            interval(row["rmse_low_mm"], row["rmse_high_mm"]),
            milliseconds(row["lag_s"]),
            number(row["jitter_mm"]),
        )
        for row in first
    ]
    console.table(header, lines)
