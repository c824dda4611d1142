"""study.yaml as frozen models, and the sessions it names. studies/README.md is the reference for its users."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from pipeline.study.comparison import Comparison
from pipeline.study.fields import Axes, Finite, Frozen, Id, Positive, known, unique
from pipeline.study.pictures import OwnPicture
from pipeline.study.preregistration_settings import Preregistration
from pipeline.study.recording import Recording
from pipeline.study.scoring_settings import Scoring
from pipeline.study.session import Session, check_pattern
from pipeline.study.simulation import Simulation, Task
from pipeline.study.streams import AccelerationStream, PositionStream, Sensing, Stream
from pipeline.study.table_parts import check_name, is_split
from pipeline.study.table_settings import Columns, Factor, Formats, Practice, Wide


class Events(Frozen):
    """The topic of events. `arrival: stamps` takes the times at which they were sent for those of their arrival."""

    topic: str
    arrival: Literal["log", "stamps"] = "log"


class LogLimits(Frozen):
    """How much a log may hold before it is refused as damaged or malicious."""

    unpacked_mib: Annotated[int, Field(gt=0, le=2**20)] = 64
    messages: Annotated[int, Field(gt=0, le=10**9)] = 500_000


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


class Exclusion(Frozen):
    """What the user excludes: a participant, a condition or trial of theirs, or a session, in one measure or in all.

    A trial alone is that number of everybody's.
    """

    participant: Id | None = None
    condition: Id | None = None
    session: Id | None = None
    trial: Annotated[int, Field(ge=-(2**53), le=2**53)] | None = None
    measure: Id | None = None
    reason: str = Field(min_length=1)

    @model_validator(mode="after")
    def _names_someone(self) -> Exclusion:
        if self.participant is None and self.session is None and self.trial is None:
            raise ValueError("needs a participant or a session to exclude, or a trial")
        return self

    @property
    def named(self) -> str:
        """What it names, for readers: `participant P01, trial 3`."""
        stated = self.model_dump(exclude={"reason"}, exclude_none=True)
        return ", ".join(f"{key} {value}" for key, value in stated.items())

    def covers(self, **ids: str | None) -> bool:
        """Whether it excludes all that has these ids: what it names is the same, and it is not one trial alone."""
        return self.trial is None and all(getattr(self, key) in (None, value) for key, value in ids.items())


_Bound = Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)]
_Share = Annotated[float, Field(ge=0, le=1)]
Limits = tuple[_Bound, _Bound]
Shares = tuple[_Share, _Share]


class QualityLimits(Frozen):
    """The limits (amber, red) of a session's quality figures, for the report's traffic lights.

    A figure above a limit has that colour; for `rate_share`, a figure below it.
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


TABLE_FIELDS = ("participants", "trials", "questionnaires", "measures", "printed", "repeats")
"""The keys that name a table of the study, or its printed figures."""


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
    log_limits: LogLimits = LogLimits()
    display: Display | None = None
    estimators: Mapping[str, Estimator] = {}
    shown: Mapping[Id, str] = {}
    trials: str | None = None
    questionnaires: str | None = None
    measures: str | None = None
    printed: str | None = None
    repeats: str | None = None
    factors: Mapping[Id, Factor] = {}
    format: Formats = Formats()
    columns: Columns = Columns()
    wide: Wide = Wide()
    missing: tuple[Finite | str, ...] = ()
    practice: Practice | None = None
    scoring: Mapping[Id, Scoring] = {}
    comparisons: tuple[Comparison, ...] = ()
    question: tuple[tuple[Id, Id], ...] = ()
    alpha: Annotated[float, Field(gt=0, lt=1)] = 0.05
    exclusions: tuple[Exclusion, ...] = ()
    quality_limits: QualityLimits = QualityLimits()
    preregistration: Preregistration = Preregistration()
    task: Task | None = None
    simulation: Simulation | None = None
    recording: Recording | None = None
    pictures: tuple[OwnPicture, ...] = ()

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
        if "condition" in self.factors and self.factors["condition"] != Factor(kind="between"):
            raise ValueError("factors: condition can be between alone; its levels and their order are `conditions`")
        self._comparisons_fit()
        self._question_fits()
        self._families_fit()
        self._sensors_fit()
        self._names_of_tables_fit()
        for name in self.recording.senders if self.recording is not None else ():
            known("recording: senders", name, self.streams)
        for kind in ("reference", "display"):
            named = [name for name, stream in self.streams.items() if stream.kind == kind]
            if len(named) > 1:
                raise ValueError(f"streams: {' and '.join(named)} are both of kind {kind}; keep one")
        if self.sessions is not None:
            check_pattern(self.sessions, self.conditions)
        if not (self.sessions or self.trials or self.questionnaires or self.measures):
            raise ValueError("has no data; add sessions, trials, questionnaires or measures")
        return self

    def _comparisons_fit(self) -> None:
        """Raise ValueError where a comparison is for another number of conditions."""
        for comparison in self.comparisons:
            if comparison.test == "crossover" and len(self.conditions) != 2:
                raise ValueError(
                    f"comparisons: crossover is for two conditions, and there are {len(self.conditions)}; mixed_model"
                    " with fixed: [condition, period] takes more"
                )
            if comparison.direction is not None and comparison.is_within and len(self.conditions) > 2:
                raise ValueError(
                    f"comparisons: direction says which of two conditions has the greater values, and there are"
                    f" {len(self.conditions)}; say it in hypothesis"
                )

    def _question_fits(self) -> None:
        """Raise ValueError where a pair that is asked about is not of two conditions."""
        for pair in self.question:
            unique("question", pair)
            for condition in pair:
                known("question", condition, self.conditions)

    def _families_fit(self) -> None:
        """Raise ValueError where the tests of one family are adjusted in different ways."""
        ways: dict[str, str] = {}
        for comparison in self.comparisons:
            if (
                comparison.family is not None
                and ways.setdefault(comparison.family, comparison.adjust) != comparison.adjust
            ):
                ways_named = f"{ways[comparison.family]} and {comparison.adjust}"
                raise ValueError(f'comparisons: family "{comparison.family}" is adjusted by {ways_named}; keep one')

    def _names_of_tables_fit(self) -> None:
        made = self.simulation is not None or self.recording is not None
        for key in TABLE_FIELDS:
            name = getattr(self, key)
            if name is not None:
                check_name(key, name)
                if is_split(name) and (key in ("printed", "repeats") or made):
                    raise ValueError(f'{key}: "{name}" has a placeholder, and is one file here')

    @property
    def files(self) -> dict[str, str]:
        """The files of the study that its keys name, beside the logs: tables and pictures, each by its key."""
        tables = {key: getattr(self, key) for key in TABLE_FIELDS}
        pictures = {f"pictures.{place}.file": picture.file for place, picture in enumerate(self.pictures)}
        return {key: name for key, name in {**tables, **pictures}.items() if name is not None}

    @property
    def asked_pairs(self) -> tuple[tuple[str, str], ...]:
        """The pairs of conditions to answer for, in their order in `conditions`: by default the baseline with each."""
        if not self.question:
            return tuple((self.conditions[0], other) for other in self.conditions[1:])
        pairs = (sorted(pair, key=self.conditions.index) for pair in self.question)
        return tuple(dict.fromkeys((first, second) for first, second in pairs))

    @property
    def between_factors(self) -> tuple[str, ...]:
        """The columns that tell groups of participants apart."""
        return tuple(name for name, factor in self.factors.items() if factor.kind == "between")

    def exclusion_of(self, session: Session) -> Exclusion | None:
        """The first decision by which a session is left out as a whole."""
        whole = (each for each in self.exclusions if each.measure is None and each.covers(**session.ids))
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
