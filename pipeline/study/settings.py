"""study.yaml as frozen models, and the sessions it names. studies/README.md is the reference for its users."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from pipeline.errors import PipelineError, did_you_mean
from pipeline.study.fields import Finite, Frozen, Positive
from pipeline.study.simulation import Simulation, Task

SETTINGS_FILE = "study.yaml"
TABLE_FIELDS = ("participants", "trials", "questionnaires", "measures", "printed", "repeats")  # files of a study
_Model = TypeVar("_Model", bound=BaseModel)


def identifier(value: object) -> object:
    """An id as text in Unicode NFC: 7 and "7" are one, and so are the two ways to write "é"."""
    if isinstance(value, bool):
        raise ValueError(f'is read as true/false; put it in quotes: "{value}"')
    if isinstance(value, int | float):
        value = str(value)
    return unicodedata.normalize("NFC", value) if isinstance(value, str) else value


Id = Annotated[str, BeforeValidator(identifier), Field(min_length=1)]
Vector = tuple[Finite, Finite, Finite]
Seconds = Annotated[float, Field(ge=0, le=600, allow_inf_nan=False)]


class _Stream(Frozen):
    topic: str
    stamp: Literal["arrival", "measurement"] = "measurement"
    latency_s: Seconds = 0.0


Axis = Literal["x", "y", "z"]
Axes = Annotated[tuple[Axis, ...], Field(min_length=1)]


class _Sensor(_Stream):
    rate_hz: Positive | None = None


class PositionStream(_Sensor):
    """A tracker. `stamp: arrival` says that it stamps on delivery: measured at stamp − latency_s."""

    kind: Literal["position"]
    noise_sd_mm: Positive = 8.0
    axes: Axes | None = None


class VelocityStream(_Sensor):
    """A sensor of the hand's velocity, such as optical flow."""

    kind: Literal["velocity"]
    noise_sd_mm_s: Positive
    axes: Axes | None = None


class OperatorTerm(Frozen):
    """`weight` times a derivative of the position, `at_s` after the reading's own time."""

    weight: Finite
    derivative: Annotated[int, Field(ge=0, le=2)] = 0
    at_s: Finite = 0.0


class LinearStream(_Sensor):
    """A sensor of a sum of terms: an operator of the user's own."""

    kind: Literal["linear"]
    noise_sd: Positive
    operator: Annotated[tuple[OperatorTerm, ...], Field(min_length=1)]
    axes: Axes | None = None


class AccelerationStream(_Sensor):
    """A phone's IMU: body-frame specific force, turned into the tracker frame by its orientation.

    How it is mounted is given (`mounting_xyzw`, `lever_arm_mm`), or learned from each session's first `calibrate_s`.
    """

    kind: Literal["acceleration"]
    gravity_mm_s2: Vector
    noise_sd_mm_s2: Positive = 100.0
    mounting_xyzw: tuple[Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 1.0)
    lever_arm_mm: Vector = (0.0, 0.0, 0.0)
    calibrate_s: Seconds = 0.0

    @model_validator(mode="after")
    def _one_way(self) -> AccelerationStream:
        if not sum(part**2 for part in self.mounting_xyzw) > 0:
            raise ValueError("mounting_xyzw is all zeros; no rotation is [0, 0, 0, 1]")
        if not sum(part**2 for part in self.gravity_mm_s2) > 0:
            raise ValueError("gravity_mm_s2 is all zeros; at rest it is some 9807 mm/s² downwards")
        given = any(self.mounting_xyzw[:3]) or any(self.lever_arm_mm)
        if self.calibrate_s and given:
            raise ValueError("gives mounting_xyzw or lever_arm_mm, and calibrate_s to learn them; keep one")
        return self


class ReferenceStream(_Stream):
    """Ground truth, brought into the tracker's frame by a rotation and a translation."""

    kind: Literal["reference"]
    rotation_xyzw: tuple[Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 1.0)
    translation_mm: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _turns(self) -> ReferenceStream:
        if not sum(part**2 for part in self.rotation_xyzw) > 0:
            raise ValueError("rotation_xyzw is all zeros; no rotation is [0, 0, 0, 1]")
        return self


class DisplayStream(_Stream):
    """What the participant saw."""

    kind: Literal["display"]


Sensing = PositionStream | VelocityStream | LinearStream | AccelerationStream
Stream = Annotated[
    PositionStream | VelocityStream | LinearStream | AccelerationStream | ReferenceStream | DisplayStream,
    Field(discriminator="kind"),
]
KINDS: dict[object, type[Frozen]] = {
    "position": PositionStream,
    "velocity": VelocityStream,
    "linear": LinearStream,
    "acceleration": AccelerationStream,
    "reference": ReferenceStream,
    "display": DisplayStream,
}


SIMULATIONS = ("reach", "selection")


class Events(Frozen):
    topic: str


class Display(Frozen):
    px_per_mm: Positive
    unit: Literal["px", "mm"] = "px"


class Estimator(BaseModel):
    """`type` names one of fusion_core.ESTIMATORS, `use` its streams; the other keys are its parameters."""

    model_config = ConfigDict(frozen=True, extra="allow")
    type: str
    use: tuple[str, ...] | None = None

    @property
    def parameters(self) -> dict[str, Any]:
        """The keys that are the estimator's own."""
        return dict(self.model_extra or {})


class Estimators(Frozen):
    """A file of further estimators, as they stand in study.yaml."""

    estimators: Mapping[str, Estimator]


Adjustment = Literal["holm", "bonferroni", "benjamini_hochberg"]


class Comparison(Frozen):
    """What to test. A key that the test has no use for is an error, for something else was meant."""

    measure: Id
    test: Literal[
        "rm_anova",
        "t_paired",
        "wilcoxon",
        "friedman",
        "art_anova",
        "mixed_model",
        "crossover",
        "tost",
        "bayes_t",
    ]
    within: tuple[Id, ...] = ("condition",)
    adjust: Literal["none"] | Adjustment = "none"
    follow_up: Literal["none"] | Adjustment = "holm"
    zeros: Literal["dropped", "pratt"] = "dropped"
    bounds: tuple[Finite, Finite] | None = None
    prior_scale: Annotated[float, Field(gt=0, le=100, allow_inf_nan=False)] = 0.707
    fixed: tuple[Id, ...] = ("condition",)

    @model_validator(mode="after")
    def _fits_the_test(self) -> Comparison:
        for key, tests in _ONLY_FOR.items():
            if getattr(self, key) != type(self).model_fields[key].default and self.test not in tests:
                raise ValueError(f"{self.test} does not take {key}; it is for {' and '.join(tests)}")
        if self.test == "tost" and self.bounds is None:
            raise ValueError("tost needs bounds, in the unit of the measure, such as bounds: [-5, 5]")
        if self.bounds is not None and self.bounds[0] >= self.bounds[1]:
            raise ValueError(f"bounds need the lower one first, found {list(self.bounds)}")
        for key, names in (("within", self.within), ("fixed", self.terms)):
            if "condition" not in names or len(set(names)) < len(names):
                raise ValueError(f'{key} of "{self.measure}" needs "condition", and no name twice')
        if len(self.within) > 3:
            raise ValueError(f"{self.test} does not take within: {list(self.within)}; three factors are the most")
        for term in self.terms:
            parts = term.split(":")
            for name in parts:
                if len(parts) > 1 and name not in self.terms:
                    raise ValueError(f'fixed: "{term}" needs "{name}" as a term too')
            if len(parts) > 1 and "period" in parts and self.period_is_slope:
                raise ValueError(f'fixed: "{term}" needs factor(period) in the place of period')
        return self

    @property
    def terms(self) -> tuple[str, ...]:
        """The names in `fixed`; factor(period) is the period too."""
        return tuple(term.replace(_PERIOD_AS_FACTOR, "period") for term in self.fixed)

    @property
    def period_is_slope(self) -> bool:
        """Is the period a number, each counting as much more as the last one?"""
        return _PERIOD_AS_FACTOR not in self.fixed


_PERIOD_AS_FACTOR = "factor(period)"
_ONLY_FOR = {
    "within": ("rm_anova", "art_anova"),
    "follow_up": ("rm_anova", "mixed_model"),
    "zeros": ("wilcoxon",),
    "bounds": ("tost",),
    "prior_scale": ("bayes_t",),
    "fixed": ("mixed_model",),
}


class Exclusion(Frozen):
    """What is left out by decision: a participant, or one of their conditions, or a session, in one measure or all."""

    participant: Id | None = None
    condition: Id | None = None
    session: Id | None = None
    measure: Id | None = None
    reason: str = Field(min_length=1)

    @model_validator(mode="after")
    def _names_someone(self) -> Exclusion:
        if self.participant is None and self.session is None:
            raise ValueError("names neither a participant nor a session")
        return self

    def covers(self, **ids: str | None) -> bool:
        """Does it name nothing that differs from these ids?"""
        return all(getattr(self, key) in (None, value) for key, value in ids.items())


_Bound = Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)]
_Share = Annotated[float, Field(ge=0, le=1)]
Limits = tuple[_Bound, _Bound]
Shares = tuple[_Share, _Share]


class QualityLimits(Frozen):
    """From where a figure of a session's quality is amber, and from where red; the report's traffic lights.

    Beyond is more, except for `rate_share`, where it is less.
    """

    rate_share: Shares = (0.8, 0.5)
    gap_s: Limits = (0.2, 1.0)
    latency_s: Limits = (0.25, 0.5)
    jitter_ms: Limits = (20.0, 100.0)
    out_of_order_share: Shares = (0.001, 0.01)
    lost_share: Shares = (0.01, 0.05)
    agreement_mm: Limits = (1e-6, 1.0)

    @model_validator(mode="after")
    def _amber_before_red(self) -> QualityLimits:
        for name in type(self).model_fields:
            amber, red = getattr(self, name)
            if (amber < red) if name == "rate_share" else (amber > red):
                raise ValueError(f"{name} needs the limit of amber first, then that of red; found {[amber, red]}")
        return self


class Study(Frozen):
    """A study folder's settings. A contrast is first − second in the order of `conditions`."""

    title: str = ""
    notes: str = ""
    citation: str = ""
    data_origin: Literal["recorded", "simulated", "reconstructed"] = "recorded"
    conditions: Annotated[tuple[Id, ...], Field(min_length=1)]
    participants: str | None = None
    sessions: str | None = None
    axes: Axes = ("x", "y", "z")
    streams: Mapping[str, Stream] = {}
    events: Events | None = None
    display: Display | None = None
    estimators: Mapping[str, Estimator] = {}
    shown: Mapping[Id, str] = {}
    trials: str | None = None
    questionnaires: str | None = None
    measures: str | None = None
    printed: str | None = None
    repeats: str | None = None
    comparisons: tuple[Comparison, ...] = ()
    alpha: Annotated[float, Field(gt=0, lt=1)] = 0.05
    exclusions: tuple[Exclusion, ...] = ()
    quality_limits: QualityLimits = QualityLimits()
    task: Task | None = None
    simulation: Simulation | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> Study:
        unique("conditions", self.conditions)
        unique("axes", self.axes)
        for condition, shown in self.shown.items():
            known("shown", condition, self.conditions)
            known(f"shown.{condition}", shown, self.estimators)
        for excluded in self.exclusions:
            if excluded.condition is not None:
                known("exclusions: condition", excluded.condition, self.conditions)
        for name, estimator in self.estimators.items():
            for stream in estimator.use or ():
                known(f"estimators.{name}.use", stream, self.sensor_streams)
        for comparison in self.comparisons:
            if comparison.test == "crossover" and len(self.conditions) != 2:
                raise ValueError(
                    f"comparisons: crossover is for two conditions, and there are {len(self.conditions)}; mixed_model"
                    " with fixed: [condition, period] takes more"
                )
        self._sensors_fit()
        for kind in ("reference", "display"):
            named = [name for name, stream in self.streams.items() if stream.kind == kind]
            if len(named) > 1:
                raise ValueError(f"streams: {' and '.join(named)} are both of kind {kind}; there can be one")
        if self.sessions is not None:
            _check_pattern(self.sessions, self.conditions)
        if not (self.sessions or self.trials or self.questionnaires or self.measures):
            raise ValueError("names no data; give sessions, trials, questionnaires or measures")
        return self

    def exclusion_of(self, session: Session) -> Exclusion | None:
        """The first decision by which a session is left out as a whole."""
        whole = (one for one in self.exclusions if one.measure is None and one.covers(**session.ids))
        return next(whole, None)

    def _sensors_fit(self) -> None:
        for name, stream in self.sensor_streams.items():
            axes = None if isinstance(stream, AccelerationStream) else stream.axes
            if axes is not None:
                unique(f"streams.{name}.axes", axes)
                for axis in axes:
                    known(f"streams.{name}.axes", axis, self.axes)
            if isinstance(stream, AccelerationStream) and stream.calibrate_s and self.tracker is None:
                raise ValueError(f"streams.{name}: calibrate_s needs a stream of kind position to learn from")

    @property
    def sensor_streams(self) -> dict[str, Sensing]:
        """The streams an estimator may use."""
        return {n: s for n, s in self.streams.items() if isinstance(s, Sensing)}

    @property
    def tracker(self) -> str | None:
        """The name of the first stream of whole positions."""
        whole = (n for n, s in self.streams.items() if isinstance(s, PositionStream) and s.axes is None)
        return next(whole, None)

    def axes_of(self, name: str) -> tuple[str, ...]:
        """The analysed axes that a sensor's stream sees."""
        stream = self.sensor_streams[name]
        return self.axes if isinstance(stream, AccelerationStream) else stream.axes or self.axes

    def stream_of_kind(self, kind: str) -> str | None:
        """The name of the first stream of a kind."""
        return next((name for name, stream in self.streams.items() if stream.kind == kind), None)


def unique(field: str, values: tuple[str, ...]) -> None:
    """ValueError where one of the values stands there twice."""
    for value in values:
        if values.count(value) > 1:
            raise ValueError(f'{field}: "{value}" stands there twice')


def known(field: str, value: str, names: Mapping[str, object] | tuple[str, ...]) -> None:
    """ValueError where a value is none of the names, with the one that was meant."""
    if value not in names:
        raise ValueError(f'{field}: "{value}" is not known{did_you_mean(value, names)}')


_PLACEHOLDER = re.compile(r"\{(\w+)\}")
_PLACEHOLDERS = ("participant", "condition", "session")


def _check_pattern(pattern: str, conditions: tuple[str, ...]) -> None:
    names = _PLACEHOLDER.findall(pattern)
    for name in names:
        if name not in _PLACEHOLDERS:
            raise ValueError(f'sessions: placeholder "{{{name}}}" is not known{did_you_mean(name, _PLACEHOLDERS)}')
    unique("sessions: placeholder", tuple(names))
    if not names:
        raise ValueError("sessions: needs a placeholder, such as data/{participant}_{condition}.mcap")
    for condition in conditions:
        if "condition" in names and ("_" in condition or "/" in condition):
            raise ValueError(
                f'sessions: {{condition}} stands for text without "_" and "/", so no log can be of "{condition}"; '
                "rename the condition, or use {session} and let the logs' metadata say it"
            )


@dataclass(frozen=True)
class Session:
    """One participant in one condition, one log. Null where the file's name does not say."""

    id: str
    participant: str | None
    condition: str | None
    path: Path

    @property
    def ids(self) -> dict[str, str | None]:
        """Its columns in tables: participant, condition, session."""
        return {"participant": self.participant, "condition": self.condition, "session": self.id}


class _UniqueKeyLoader(yaml.SafeLoader):
    """A key that stands twice in one mapping is an error, not the last one's victory."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """No aliases: a few lines of them can stand for gigabytes."""
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem="aliases (*name) are not understood; write it out", problem_mark=mark)
        return super().compose_node(parent, index)


def _mapping(loader: _UniqueKeyLoader, node: yaml.MappingNode) -> dict[object, object]:
    seen: set[str] = set()
    for key, _ in node.value:
        if isinstance(key, yaml.ScalarNode):
            if key.value in seen:
                raise yaml.MarkedYAMLError(problem=f'"{key.value}" stands there twice', problem_mark=key.start_mark)
            seen.add(key.value)
    return dict(loader.construct_mapping(node, deep=True))


_UniqueKeyLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping)


class _TextLoader(_UniqueKeyLoader):
    """Numbers stay text: 0.050 keeps its last digit."""


_TextLoader.yaml_implicit_resolvers = {}


def read_yaml(path: Path, as_text: bool = False) -> dict[str, Any]:
    """A YAML file that holds a mapping; PipelineError that names the file and line where it does not.

    `as_text` leaves every value as it is written, numbers too.
    """
    loader = _TextLoader if as_text else _UniqueKeyLoader
    try:
        content = yaml.load(path.read_text(encoding="utf-8-sig"), Loader=loader)  # noqa: S506 - safe
    except FileNotFoundError:
        raise PipelineError(f"{path}: there is no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise PipelineError(f"{path}: cannot be read: {error}") from None
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise PipelineError(f"{path}{line}: not valid YAML: {error.problem}") from None
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise PipelineError(f"{path}: not valid YAML: {error}") from None
    try:
        json.dumps(content, ensure_ascii=False, default=str).encode("utf-8")
    except UnicodeEncodeError:
        raise PipelineError(
            f"{path}: holds half of a surrogate pair (\\ud800 and the like); write the character"
        ) from None
    if not isinstance(content, dict) or not all(isinstance(key, str) for key in content):
        raise PipelineError(f"{path}: holds no settings; it needs lines like `title: My study`")
    return content


def load_study(folder: Path, *, to_be_made: bool = False) -> Study:
    """The settings of a study folder; PipelineError that names the file, the field, the fault and the remedy.

    With `to_be_made` its tables need not be there yet.
    """
    if not folder.is_dir():
        raise PipelineError(f"{folder}: there is no such folder; a study is a folder with a {SETTINGS_FILE} in it")
    path = folder / SETTINGS_FILE
    if not path.is_file():
        raise PipelineError(f"{folder}: holds no {SETTINGS_FILE}; studies/README.md shows what goes into one")
    inside(folder, SETTINGS_FILE, str(folder))
    content = read_yaml(path)
    content.setdefault("title", folder.resolve().name)
    study = parse(Study, content, path)
    for field in TABLE_FIELDS:
        name = getattr(study, field)
        if name is not None:
            file = inside(folder, name, f"{path}: {field}", must_exist=False)
            if not file.is_file() and not to_be_made:
                made = f"; it is made by: steadyhand simulate {folder}" if study.simulation is not None else ""
                raise PipelineError(f'{path}: {field}: there is no file "{name}" in the study folder{made}')
    if study.sessions is not None:
        inside(folder, study.sessions, f"{path}: sessions", must_exist=False)
    return study


def read_values(text: str) -> list[Any]:
    """A list in YAML without its brackets, "3, 5"; ValueError where it is none."""
    try:
        found = yaml.load(f"[{text}]", Loader=_UniqueKeyLoader)  # noqa: S506 - safe
    except (yaml.YAMLError, RecursionError) as error:
        fault = error.problem if isinstance(error, yaml.MarkedYAMLError) else error
        raise ValueError(f"not a list of values: {fault}") from None
    if not isinstance(found, list) or any(value is None for value in found):
        raise ValueError("a value is missing")
    return found


def parse(model: type[_Model], content: dict[str, Any], path: Path | str) -> _Model:
    """Content as a model; every fault in one PipelineError, a line each."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise PipelineError("\n".join(f"{path}: {_explained(fault, model)}" for fault in error.errors())) from None


def _explained(fault: Any, model: type[BaseModel]) -> str:
    """One fault of pydantic's in the user's words."""
    location = [part for part in fault["loc"] if part not in (*KINDS, *SIMULATIONS) or part is fault["loc"][0]]
    field = ".".join(str(part) for part in location)
    if fault["type"] == "extra_forbidden":
        return f'unknown key "{field}"{did_you_mean(str(location[-1]), _keys_at(model, fault["loc"][:-1]))}'
    if fault["type"] == "missing":
        return f'"{field}" is missing'
    if fault["type"] in ("union_tag_invalid", "union_tag_not_found"):
        kinds = SIMULATIONS if location[:1] == ["simulation"] else KINDS
        return f'"{field}" needs a kind: {", ".join(str(kind) for kind in kinds)}'
    message = fault["msg"].removeprefix("Value error, ")
    message = message[0].lower() + message[1:]
    found = fault.get("input")
    shown = f" (found {found!r})" if isinstance(found, str | int | float | bool) else ""
    return f'"{field}": {message}{shown}' if field else f"{message}{shown}"


def _keys_at(model: type[BaseModel], location: tuple[object, ...]) -> list[str]:
    """The keys that are known where an unknown one stood."""
    models = [model]
    for part in location:
        inner = [kind for outer in models for kind in _models_of(outer, part)]
        models = inner or [kind for kind in models if part in _kinds(kind)] or models
    return [field.alias or name for name, field in models[0].model_fields.items()]


def _models_of(model: type[BaseModel], key: object) -> list[type[BaseModel]]:
    """The models that a key of a model holds, in a list or a mapping or by itself."""
    field = next((field for name, field in model.model_fields.items() if key in (name, field.alias)), None)
    pending, found = [] if field is None else [field.annotation], []
    while pending:
        annotation: Any = pending.pop()
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            found.append(annotation)
        pending += get_args(annotation)
    return found


def _kinds(model: type[BaseModel]) -> tuple[object, ...]:
    """The kinds by which a union of models tells this one."""
    field = model.model_fields.get("kind")
    return get_args(field.annotation) if field else ()


def inside(folder: Path, name: str, field: str, must_exist: bool = True) -> Path:
    """A path of the study, refused if it leads out of its folder by `..`, a root or a link."""
    root = folder.resolve()
    path = root / name
    try:
        leads_out = Path(name).is_absolute() or ".." in Path(name).parts or not path.resolve().is_relative_to(root)
        exists = path.is_file()
    except (OSError, ValueError, RuntimeError) as error:
        raise PipelineError(f"{field}: {name!r} cannot be a path: {error}") from None
    if leads_out:
        raise PipelineError(f'{field}: "{name}" leads out of the study folder; put the file into it')
    if must_exist and not exists:
        raise PipelineError(f'{field}: there is no file "{name}" in the study folder')
    return path


@dataclass(frozen=True)
class Found:
    """A study's logs by id; what has a log's name and cannot be read; what lies beside them and has not."""

    sessions: list[Session]
    set_aside: list[tuple[Session, str]]
    unused: list[tuple[str, str]]


def find_sessions(folder: Path, study: Study) -> Found:
    """The logs that match the study's pattern, sorted by id, and what is there beside them, with the reason.

    Two equal ids, or a link that leads out of the folder, are a PipelineError.
    """
    if study.sessions is None:
        return Found([], [], [])
    root = folder.resolve()
    pieces = _PLACEHOLDER.split(Path(study.sessions).as_posix())
    pattern = "".join(
        re.escape(piece) if index % 2 == 0 else f"(?P<{piece}>[^_/]+)" for index, piece in enumerate(pieces)
    )
    fixed = Path(pieces[0]).parent if not pieces[0].endswith("/") else Path(pieces[0])
    sessions: dict[str, Session] = {}
    set_aside: list[tuple[Session, str]] = []
    unused: list[tuple[str, str]] = []
    for path in sorted((root / fixed).rglob("*")):
        relative = unicodedata.normalize("NFC", path.relative_to(root).as_posix())
        match = re.fullmatch(pattern, relative)
        reason = _cannot_be_a_log(path, relative, match is not None, Path(study.sessions).suffix)
        if reason is not None:
            name = relative.encode("utf-8", "backslashreplace").decode()
            if match is None:
                unused.append((name, reason))
            else:
                set_aside.append((Session(name, None, None, path), reason))
        if match is None or reason is not None:
            continue
        inside(folder, path.relative_to(root).as_posix(), f"{folder / SETTINGS_FILE}: sessions")
        found = match.groupdict()
        session = Session(Path(relative).stem, found.get("participant"), found.get("condition"), path)
        if session.id in sessions:
            other = sessions[session.id].path.relative_to(root)
            raise PipelineError(
                f'{folder / SETTINGS_FILE}: sessions: "{other}" and "{path.relative_to(root)}" are both session '
                f"\"{session.id}\"; a session's id is its file's name, rename one"
            )
        sessions[session.id] = session
    return Found([sessions[key] for key in sorted(sessions)], set_aside, unused)


def _cannot_be_a_log(path: Path, relative: str, matches: bool, suffix: str) -> str | None:
    """Why a file among the sessions is not used; None for one that is, or that has nothing to do with them."""
    if path.is_symlink() and path.is_dir():
        return "a link to a folder is not followed"
    if path.is_dir() and not matches:
        return None
    if not matches:
        near = Path(relative).suffix.casefold() == suffix.casefold()
        return "its name does not fit the pattern of study.yaml" if near else None
    if not path.is_file():
        return "it is not a file that can be read"
    try:
        relative.encode("utf-8")
    except UnicodeEncodeError:
        return "its name is not UTF-8; rename it"
    return None
