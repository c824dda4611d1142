"""`recording:` in study.yaml: how a study is run live, and which sender each stream comes from."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from pipeline.errors import did_you_mean
from pipeline.study.fields import Finite, Frozen, Id, Positive, Seconds, Vector, unique
from pipeline.study.measures import QUESTIONNAIRES
from pipeline.study.units import G_M_S2, RAD_PER_DEG

Port = Annotated[int, Field(ge=1, le=65535)]
SignedAxis = Literal["x", "y", "z", "-x", "-y", "-z"]
Unit = Literal["mm", "cm", "m", "g", "m_s2", "-g", "-m_s2", "deg_s", "rad_s"]

METRES: Mapping[str, float] = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
M_S2: Mapping[str, float] = {"g": G_M_S2, "m_s2": 1.0, "-g": -G_M_S2, "-m_s2": -1.0}
RAD_S: Mapping[str, float] = {"deg_s": RAD_PER_DEG, "rad_s": 1.0}
"""What one of a unit is in SI; with a minus where an accelerometer's axis that points up has −1 at rest, as in iOS."""

_TLX, WEIGHTED_TLX = "nasa_tlx", "weighted_tlx"

SENDERS = ("phone", "app", "udp_json", "osc", "lsl", "camera", "rosbridge", "foxglove", "demo")
"""The kinds of senders."""


class UdpJson(Frozen):
    """Datagrams of JSON. `source` is the address they must come from.

    While that is `any`, the operator may accept a sender of another computer that has no key.
    """

    port: Port
    source: str = "any"


class Osc(Frozen):
    """Open Sound Control: the arguments `fields` of messages to `address`.

    It has no key, so it is heard from this computer alone unless `source` names the sender's address (or `any`), or
    the operator accepts the sender.
    """

    port: Port
    address: str = Field(pattern="^/")
    source: str | None = None
    fields: tuple[Annotated[int, Field(ge=0, le=63)], ...] = (0, 1, 2)


class App(Frozen):
    """An app that sends a phone's motion by UDP in a form of its own: `zig_sim` (an iPhone's), or `hyperimu`.

    Neither has a key, so it is heard as `Osc` is.
    """

    name: Literal["zig_sim", "hyperimu"]
    port: Port
    source: str | None = None


class Lsl(Frozen):
    """A Lab Streaming Layer outlet by name."""

    name: str = Field(min_length=1)
    channels: tuple[Annotated[int, Field(ge=0, le=1023)], ...] = (0, 1, 2)


class Camera(Frozen):
    """A webcam that sees a printed ArUco marker.

    What its lens does comes from `calibration`, a file, or from `field_of_view_deg`, from its left edge to its right.
    `late_ms` is how long before it is handed over a picture was taken, if that is known.
    """

    device: Annotated[int, Field(ge=0, le=63)] = 0
    marker: Annotated[int, Field(ge=0, le=49)] = 7
    marker_mm: Positive = 50.0
    size: tuple[Annotated[int, Field(ge=160, le=7680)], Annotated[int, Field(ge=120, le=4320)]] = (1280, 720)
    calibration: str | None = Field(default=None, min_length=1)
    field_of_view_deg: Annotated[float, Field(ge=10, le=150)] | None = None
    late_ms: Annotated[float, Field(ge=0, le=1000)] = 0.0

    @model_validator(mode="after")
    def _one_lens(self) -> Camera:
        if self.calibration is not None and self.field_of_view_deg is not None:
            raise ValueError("calibration and field_of_view_deg both say what the lens does; keep one")
        return self


def _of_a_server(url: str) -> str:
    try:
        parts = urlsplit(url)
        host = (parts.hostname or "").encode("idna")
        is_one = bool(host) and parts.scheme in ("ws", "wss") and parts.port != 0
    except ValueError:
        is_one = False
    if not is_one:
        raise ValueError("is no address of a WebSocket; write ws://HOST:PORT")
    return url


Url = Annotated[str, AfterValidator(_of_a_server)]


class Rosbridge(Frozen):
    """A topic of a rosbridge server."""

    url: Url
    topic: str = Field(min_length=1)
    type: str = Field(min_length=1)


class Foxglove(Frozen):
    """A topic of a server that speaks Foxglove's WebSocket protocol."""

    url: Url
    topic: str = Field(min_length=1)


class Demo(Frozen):
    """A simulated sender."""


class Sender(Frozen):
    """Where a stream's readings come from, and how they are turned into SI in the tracker's frame.

    `axes` permutes and flips, then `rotation_xyzw` turns and `translation_mm` moves (positions only).
    """

    phone: Literal["motion"] | None = None
    app: App | None = None
    udp_json: UdpJson | None = None
    osc: Osc | None = None
    lsl: Lsl | None = None
    camera: Camera | None = None
    rosbridge: Rosbridge | None = None
    foxglove: Foxglove | None = None
    demo: Demo | None = None
    axes: tuple[SignedAxis, SignedAxis, SignedAxis] = ("x", "y", "z")
    unit: tuple[Unit, ...] | Unit = ()
    rotation_xyzw: tuple[Finite, Finite, Finite, Finite] = (0.0, 0.0, 0.0, 1.0)
    translation_mm: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _one_kind(self) -> Sender:
        kinds = [kind for kind in SENDERS if getattr(self, kind) is not None]
        if len(kinds) != 1:
            found = " and ".join(kinds) if kinds else "none"
            raise ValueError(f"needs one of {', '.join(SENDERS)}; found {found}")
        if {axis[-1] for axis in self.axes} != {"x", "y", "z"}:
            raise ValueError(f"axes needs each of x, y and z once, found {list(self.axes)}")
        if not sum(part**2 for part in self.rotation_xyzw) > 0:
            raise ValueError("rotation_xyzw is all zeros; no rotation is [0, 0, 0, 1]")
        for table in (METRES, M_S2, RAD_S):
            if sum(unit in table for unit in self.units) > 1:
                raise ValueError(f"unit names the same quantity twice: {', '.join(self.units)}")
        return self

    @property
    def kind(self) -> str:
        """Which of the kinds it is."""
        return next(kind for kind in SENDERS if getattr(self, kind) is not None)

    @property
    def port(self) -> int | None:
        """The UDP port that it sends to, if it does."""
        listened = self.udp_json or self.osc or self.app
        return None if listened is None else listened.port

    @property
    def units(self) -> tuple[str, ...]:
        """Its units, as a tuple."""
        return (self.unit,) if isinstance(self.unit, str) else self.unit


class Phone(Frozen):
    """`window: true_size` shows millimetres as they are in the hand, `fit` scales the window to the screen."""

    frame: Literal["screen"] = "screen"
    window: Literal["fit", "true_size"] = "fit"


class Practice(Frozen):
    """How many targets are practised before each task; they are not logged as trials."""

    targets: Annotated[int, Field(ge=0, le=99)] = 0


class Selection(Frozen):
    """The button on the phone: on which side, how large, and how long it confirms a press."""

    button: Literal["left", "right"] = "right"
    mm: Annotated[float, Field(ge=5, le=60)] = 12.0
    confirm_ms: Annotated[float, Field(ge=0, le=2000)] = 150.0


class Item(Frozen):
    """One line of a questionnaire: `steps` + 1 marks from `low` to `high`."""

    id: Id
    text: str = Field(min_length=1)
    low: str = Field(min_length=1)
    high: str = Field(min_length=1)
    steps: Annotated[int, Field(ge=1, le=100)] = 20


Pair = tuple[str, str]


class Questionnaire(Frozen):
    """A questionnaire of the study's own; ratings are 0 … steps, from left to right.

    With `compared`, each pair of items is held against each other too, as NASA-TLX's weights want it.
    """

    id: Id
    title: str = ""
    items: Annotated[tuple[Item, ...], Field(min_length=1, max_length=60)]
    compared: bool = False

    @model_validator(mode="after")
    def _each_once(self) -> Questionnaire:
        unique("items", tuple(item.id for item in self.items))
        if self.compared and self.id != _TLX:
            raise ValueError(f'compared: only {_TLX} has a rule for what is made of pairs; name it "{WEIGHTED_TLX}"')
        return self

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """The pairs of items that are compared."""
        return tuple(combinations((item.id for item in self.items), 2)) if self.compared else ()


def pair_id(pair: Pair) -> str:
    """By what name the answer to a pair is kept: 0 for the first, 1 for the second."""
    return "-".join(pair)


def _nasa_tlx(compared: bool = False) -> Questionnaire:
    """NASA-TLX (Hart and Staveland 1988); its definitions are among the pages' texts, in their languages."""
    known = QUESTIONNAIRES[_TLX]
    own_ends = {"performance": ("perfect", "failure")}
    ends = {name: own_ends.get(name, ("very low", "very high")) for name in known.scales}
    items = tuple(Item(id=name, text=name, low=low, high=high) for name, (low, high) in ends.items())
    return Questionnaire(id=known.name, title=known.label, items=items, compared=compared)


BUILT_IN: Mapping[str, Questionnaire] = {_TLX: _nasa_tlx(), WEIGHTED_TLX: _nasa_tlx(compared=True)}
"""Questionnaires that need no definition in study.yaml."""


def _built_in(value: object) -> object:
    """A built-in questionnaire stands by its name alone."""
    if not isinstance(value, str):
        return value
    if value not in BUILT_IN:
        raise ValueError(f"there is no questionnaire of that name{did_you_mean(value, BUILT_IN)}")
    return BUILT_IN[value]


class Recording(Frozen):
    """How a study is run live. `language` is that of the participants' pages; None: that of their browser."""

    phone: Phone = Phone()
    language: Annotated[str, Field(pattern="^[a-z]{2,3}$")] | None = None
    blind: Literal["participant", "both"] = "participant"
    practice: Practice = Practice()
    selection: Selection = Selection()
    advance: Literal["selection"] = "selection"
    abort_after_s: Annotated[Seconds, Field(ge=10, le=600)] = 240.0
    questionnaires: tuple[Annotated[Questionnaire, BeforeValidator(_built_in)], ...] = ()
    countdown_s: Annotated[float, Field(ge=0, le=60)] = 3.0
    senders: Annotated[Mapping[Id, Sender], Field(min_length=1)]

    @model_validator(mode="after")
    def _fits_together(self) -> Recording:
        unique("questionnaires", tuple(one.id for one in self.questionnaires))
        ports: dict[int, str] = {}
        for name, sender in self.senders.items():
            kind = f"the app of {name}" if sender.app is not None else sender.kind
            if sender.port is not None and ports.setdefault(sender.port, kind) != kind:
                raise ValueError(
                    f"senders.{name}: port {sender.port} is that of {ports[sender.port]} already; choose another"
                )
        return self
