"""`new`: writes a study.yaml for what a folder holds, or an empty study with example tables to fill in."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.commands import console
from pipeline.commands.new.draft import draft, written
from pipeline.commands.new.found import Found, Stated, look
from pipeline.commands.new.plan import plan
from pipeline.commands.new.questions import Questions, of_terminal
from pipeline.commands.new.templates import write_template
from pipeline.errors import PipelineError, did_you_mean
from pipeline.study import given_tables
from pipeline.study.folder import SETTINGS_FILE
from pipeline.study.guessing.headers import EVERY, LENGTHS, plain
from pipeline.study.session_files import find_sessions
from pipeline.study.settings import Study
from pipeline.study.statistical_tests import TESTS
from pipeline.study.table_file import table_file
from pipeline.study.units import G_MM_S2
from pipeline.study.yaml_text import parse, read_yaml
from pipeline.words.phrases import counted, listing

_BASELINES = ("baseline", "control", "kontrolle", "kontrollbedingung", "standard", "temoin", "none", "raw", "ohne")
_AXES = ("x", "y", "z")


def stated_by(
    title: str | None,
    conditions: str | None,
    columns: Sequence[str],
    unit: str | None,
    px_per_mm: float | None,
    gravity: str | None,
) -> Stated:
    """What the options say. Raises PipelineError for one that cannot be understood."""
    meant: dict[str, str] = {}
    for given in columns:
        header, equals, column = given.rpartition("=")
        if not equals or not header or column not in EVERY:
            raise PipelineError(
                f'--column: "{given}" should be a header and the column it means, such as --column Code=participant'
            )
        meant[header] = column
    if unit is not None and unit not in LENGTHS:
        raise PipelineError(f'--unit: there is no "{unit}"{did_you_mean(unit, LENGTHS)}')
    named = tuple(name.strip() for name in conditions.split(",")) if conditions else ()
    return Stated(title, named, meant, unit, px_per_mm, gravity)


def run(folder: Path, template: str | None, stated: Stated) -> None:
    """Write the study and say what was found, what was guessed, and what `report` would do.

    Raises PipelineError where study.yaml exists already, since nothing is ever overwritten, or where nothing can be
    guessed.
    """
    path = folder / SETTINGS_FILE
    if path.exists() or path.is_symlink():
        raise PipelineError(f"{path}: already exists, and is never overwritten; move it away to start anew")
    if template is not None:
        write_template(folder, template)
        console.say(f"{path}: written, with example tables beside it; put your own data in their place")
        console.say(f"Next: steadyhand report {folder}")
        return
    if not folder.is_dir():
        raise PipelineError(f"{folder}: there is no such folder; with --template one is made")
    questions = of_terminal()
    text, found, study = proposed(folder, stated, questions)
    _write(path, text)
    for line in _said(folder, found, study, questions):
        console.say(line)


def proposed(folder: Path, stated: Stated, questions: Questions) -> tuple[str, Found, Study]:
    """The text of study.yaml, what it is made of, and the settings that it states, checked with their tables."""
    found = look(folder, stated, questions)
    conditions = _conditions(found, stated, questions)
    found = _with_gravity(found, stated, questions)
    planned = plan(found, conditions)
    extra = _display(found, stated, questions)
    text = written(draft(stated.title or folder.resolve().name, conditions, found, planned, extra))
    return text, found, _checked(folder, text)


def _conditions(found: Found, stated: Stated, questions: Questions) -> tuple[str, ...]:
    """The conditions of tables and logs, the baseline first. Raises PipelineError for none, and for two alike."""
    of_logs = found.names.conditions if found.names is not None else ()
    facts = found.streams.condition_facts if found.streams is not None else ()
    of_tables = (condition for table in found.tables.values() for condition in table.conditions)
    conditions = list(dict.fromkeys((*of_tables, *(of_logs or facts))))
    _refuse_alike(conditions)
    if stated.conditions:
        for name in conditions:
            if name not in stated.conditions:
                raise PipelineError(f'--conditions: the data have "{name}" too; name it, or leave it out of the data')
        return stated.conditions
    if not conditions:
        raise PipelineError(
            "nothing names the conditions: no table has a column for them, and no name of a log has a part that differs"
            " within a participant; say them with --conditions kinect,fusion (the headers of a table with one column"
            " each), or name the logs P01_kinect.mcap"
        )
    if len(conditions) == 1:
        return tuple(conditions)
    likely = next((name for name in conditions if plain(name) in _BASELINES), conditions[0])
    baseline = questions.choose("Which condition is the baseline?", likely, "--conditions", conditions)
    return (baseline, *(name for name in conditions if name != baseline))


def _refuse_alike(conditions: Sequence[str]) -> None:
    seen: dict[str, str] = {}
    for name in conditions:
        other = seen.setdefault(plain(name), name)
        if other != name:
            raise PipelineError(f'the conditions "{other}" and "{name}" look alike; give them one name in the data')


def _with_gravity(found: Found, stated: Stated, questions: Questions) -> Found:
    """The streams with the direction of gravity that was stated or asked, where the logs do not show it."""
    streams = found.streams
    if streams is None or not streams.gravity_guessed:
        return found
    axes = tuple(f"{sign}{axis}" for axis in _AXES for sign in "+-")
    question = "The logs have no orientation of the phone. Along which of the tracker's axes does gravity point?"
    answer = stated.gravity or questions.choose(question, "-z", "--gravity", axes)
    if answer not in axes:
        raise PipelineError(f'--gravity: "{answer}" is none of {", ".join(axes)}')
    vector = [0.0, 0.0, 0.0]
    vector[_AXES.index(answer[1])] = G_MM_S2 if answer[0] == "+" else -G_MM_S2
    changed = {
        name: {**stream, "gravity_mm_s2": vector} if name in streams.gravity_guessed else stream
        for name, stream in streams.streams.items()
    }
    return replace(found, streams=replace(streams, streams=changed))


def _display(found: Found, stated: Stated, questions: Questions) -> dict[str, object]:
    """`display`, where positions are in pixels."""
    trials = found.tables.get("trials")
    in_px = trials is not None and any(name.endswith("_px") for name in trials.header)
    if not in_px and stated.px_per_mm is None:
        return {}
    answer = stated.px_per_mm or questions.choose(
        "How many pixels are a millimetre of the display?", "4", "--px-per-mm"
    )
    try:
        return {"display": {"px_per_mm": float(answer), "unit": "px"}}
    except ValueError:
        raise PipelineError(f'px_per_mm should be a number such as 4.3, found "{answer}"') from None


def _checked(folder: Path, text: str) -> Study:
    """The settings of the text, after all its tables were read as a report reads them."""
    with tempfile.TemporaryDirectory() as place:
        draft_file = Path(place) / SETTINGS_FILE
        draft_file.write_text(text, encoding="utf-8")
        study = parse(Study, read_yaml(draft_file), folder / SETTINGS_FILE)
    for table, read in (
        ("participants", given_tables.read_participants),
        ("trials", given_tables.read_trials),
        ("questionnaires", given_tables.read_questionnaires),
        ("measures", given_tables.read_measures),
    ):
        file = table_file(study, folder, table)
        if file is not None:
            read(file)
    return study


def _write(path: Path, text: str) -> None:
    """Write a new file; one that appeared in the meantime is not overwritten either."""
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        raise PipelineError(f"{path}: already exists, and is never overwritten") from None


def _said(folder: Path, found: Found, study: Study, questions: Questions) -> Iterator[str]:
    """What was found, what was taken without asking, what is not used, and what a report would do."""
    for kind, table in found.tables.items():
        yield f"{table.written.name}: read as the {kind}"
    if found.logs:
        yield f"{counted(len(found.logs), 'log')}: {study.sessions}"
    for contradiction in found.streams.contradictions if found.streams is not None else ():
        yield f"Look at this: {contradiction}"
    for taken in questions.taken:
        yield f"Taken for granted: {taken}"
    for name, reason in found.not_used:
        yield f"Not used: {name}: {reason}"
    yield f"{folder / SETTINGS_FILE}: written; read its comments and change what is not so"
    yield f"Next: steadyhand report {folder}"
    yield f"  which would {'; '.join(_would_do(folder, found, study))}"


def _would_do(folder: Path, found: Found, study: Study) -> Iterator[str]:
    if study.sessions is not None:
        sessions = find_sessions(folder, study).sessions
        run_on = f" and run {listing(list(study.estimators))} on each" if study.estimators else ""
        yield f"read {counted(len(sessions), 'session')}{run_on}"
    people = {person for table in found.tables.values() for person in table.column("participant")}
    people |= set(found.names.participants) if found.names is not None else set()
    yield f"describe {counted(len(people), 'participant')} under {listing(list(study.conditions))}"
    for entry in study.comparisons:
        yield f"compare {listing(list(entry.measures))} by {TESTS[entry.test].label}"
