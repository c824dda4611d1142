"""`record`: run a study live, or play it as a demo."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.commands import console
from pipeline.errors import PipelineError
from pipeline.study.folder import SETTINGS_FILE, load_study

if TYPE_CHECKING:
    from pipeline.live.access import Access
    from pipeline.live.certificates import Certificates
    from pipeline.live.setup import Setup

_EXTRA = ("starlette", "uvicorn", "websockets", "segno", "cryptography", "pythonosc")
_NOT_IN_A_DEMO = ("simulation", "repeats", "printed", "trials", "measures", "preregistration", "exclusions")
_OF_A_MOUNTING = ("mounting_xyzw", "lever_arm_mm", "calibrate_s")  # a simulated phone is where the tracker looks


@dataclass(frozen=True)
class Options:
    """How a study is served. `goes_on`: even if study.yaml has changed since the first session."""

    host: str | None = None
    port: int = 8443
    demo: bool = False
    goes_on: bool = False
    lan: bool = False
    plain: bool = False
    operator_lan: bool = False
    certificate: Path | None = None
    key: Path | None = None


def record(folder: Path, options: Options, out: Path | None, bots: int | None) -> None:
    """Serve a study's pages until Ctrl-C; with `bots`, let so many simulated participants play it at once instead."""
    missing = [name for name in _EXTRA if find_spec(name) is None]
    if missing and bots is None:
        raise PipelineError('record: serving pages needs a few more packages: pip install "steadyhand[live]"')
    if options.demo:
        folder = _demo_folder(folder, out, bots is not None)
    elif bots is not None or out is not None:
        raise PipelineError("--bots and --out are for a demo: add --demo")
    study = load_study(folder, to_be_made=True)
    if bots is not None:
        _play(folder, bots)
        return
    from pipeline.live.record import Serving
    from pipeline.live.record import record as serve

    serving = Serving(**vars(options))
    serve(folder, study, serving, say_where(folder), lambda: console.say("Warming up the estimators …"))
    console.say(f"Recorded into {console.short_path(folder)}. Report: steadyhand report {console.short_path(folder)}")


def say_where(folder: Path) -> Any:
    """What prints where the operator and the phone find their pages, once they are served."""
    from pipeline.live.lens import USUAL_FIELD_OF_VIEW_DEG

    def say(setup: Setup, access: Access, certificates: Certificates | None) -> None:
        console.say(f"{setup.study.title}: into {console.short_path(folder)}. End with Ctrl-C.")
        console.say(f"Operator       {access.address('operator')}")
        console.say(f"Phone          {access.address('phone')}")
        if setup.recording.questionnaires:
            console.say(f"Questionnaire  {access.address('questionnaire')}")
        if any(sender.udp_json is not None for sender in setup.recording.senders.values()):
            console.say(f'Senders        "key": "{access.sensors}"')
        for name, sender in setup.recording.senders.items():
            if sender.port is not None:
                console.say(f"{name}: by UDP to {access.host}, port {sender.port}")
            if sender.camera is not None and not (sender.camera.calibration or sender.camera.field_of_view_deg):
                usual = f"{USUAL_FIELD_OF_VIEW_DEG:.0f}°"
                console.say(f"{name}: no field_of_view_deg: {usual} is assumed, so z may be a third off (docs/live.md)")
        if access.in_network and certificates is None:
            console.say(
                "Without TLS a phone gives its pages no motion, and all that they say can be read in the network."
            )
        if certificates is not None and certificates.authority is not None:
            console.say(f"Phones trust these pages once they trust this computer: {access.origin}/ca says how.")
            console.say(f"Its certificate's SHA-256: {certificates.fingerprint()}")

    return say


def _play(folder: Path, participants: int) -> None:
    """Simulated participants play the study, faster than it would take."""
    from pipeline.live import bots, setup
    from pipeline.live.journal import Journal, known_plan
    from pipeline.live.loop import Clock

    study = load_study(folder, to_be_made=True)
    made = setup.set_up(study, folder)
    journal = Journal(folder, study)
    journal.hold()
    try:
        known = known_plan(made.empty_plan(), journal, made.digest, False)
        players = bots.Players(bots.as_simulated(made), folder, journal, known, Clock()())
        players.play(participants, lambda file: console.say(f"played {file}"))
    finally:
        journal.release()
    console.say(f"Report: steadyhand report {console.short_path(folder)}")


def _demo_folder(folder: Path, out: Path | None, with_bots: bool) -> Path:
    """A folder of its own for a demo, with the study's settings and simulated senders; the study is not touched."""
    import yaml

    from pipeline.study.yaml_text import read_yaml

    study = load_study(folder, to_be_made=True)
    target = out or Path("demo") / folder.resolve().name
    if target.resolve() == folder.resolve():
        raise PipelineError(f"{target}: is the study itself; a demo needs a folder of its own, see --out")
    content = read_yaml(folder / SETTINGS_FILE)
    senders: dict[str, Any] = {name: {"demo": {}} for name in study.sensor_streams}
    recording = {"questionnaires": ["nasa_tlx"], **(content.get("recording") or {}), "senders": senders}
    kept = {key: value for key, value in content.items() if key not in _left_out(with_bots)}
    kept["streams"] = {
        name: {key: value for key, value in one.items() if key not in _OF_A_MOUNTING}
        for name, one in content["streams"].items()
        if one.get("kind") != "reference"
    }
    kept |= {"data_origin": "simulated", "recording": recording}
    kept["notes"] = "A demo, played live: simulated sensors, and a simulated hand or the pointer of a mouse."
    text = yaml.safe_dump(kept, sort_keys=False, allow_unicode=True, width=110)
    _write_once(target / SETTINGS_FILE, text)
    return target


def _left_out(with_bots: bool) -> tuple[str, ...]:
    return tuple(key for key in _NOT_IN_A_DEMO if not (with_bots and key == "simulation"))


def _write_once(path: Path, text: str) -> None:
    """Write the settings of a demo, unless there are others already."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists() and path.read_text(encoding="utf-8") != text:
        raise PipelineError(f"{path}: is of another demo or study; remove its folder, or name another one with --out")
    path.write_text(text, encoding="utf-8")
