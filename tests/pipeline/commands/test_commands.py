"""The command line: what is printed, where it goes, and the exit code."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

from tests.conftest import CLONE, session_messages, write_session
from tests.pipeline.helpers import Steadyhand, run

Folder = Callable[..., Path]
SETTINGS = "conditions: [a, b]\nmeasures: measures.csv\ncomparisons: [{measure: m, test: wilcoxon}]\n"
MEASURES = "participant,condition,measure,value\n" + "".join(
    f"P{p},{c},m,{p + (c == 'b') * (p % 3 - 1) * p}\n" for p in range(1, 9) for c in "ab"
)


def test_help_imports_no_heavy_library() -> None:
    """What `--help` answers with; how fast that is stands in the benchmarks."""
    code = (
        "import sys; sys.argv = ['steadyhand', '--help']\nimport pipeline.__main__ as m\ntry: m.main()\nexcept"
        " SystemExit: pass\n"
    )
    code += (
        "print(sorted({'numpy', 'pandas', 'scipy', 'matplotlib', 'pydantic', 'numba', 'pyarrow'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=CLONE)
    assert done.stdout.splitlines()[-1] == "[]"
    for command in (
        "report",
        "compare",
        "check",
        "diff",
        "fit",
        "simulate",
        "inspect",
        "power",
        "plan",
        "audit",
        "cache",
    ):
        assert command in done.stdout


def test_check_says_which_numbers_moved(
    folder: Folder, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    root = folder(SETTINGS, **{"measures.csv": MEASURES})
    options = ("--cache", str(tmp_path / "cache"), "--jobs", "1")
    ran = run(capsys, monkeypatch, "check", root, *options)
    assert ran.code == 2
    assert "write it with: steadyhand check" in ran.err
    assert run(capsys, monkeypatch, "check", root, "--accept", *options).code == 0
    assert run(capsys, monkeypatch, "check", root, *options).code == 0
    (root / "measures.csv").write_text(MEASURES.replace("P3,a,m,3", "P3,a,m,30"))
    ran = run(capsys, monkeypatch, "check", root, *options)
    assert ran.code == 3
    assert "descriptives | m | a | mean 4.5 7.875 +3.375 +75 %" in " ".join(ran.out.split())


def test_several_studies_get_a_folder_each(
    folder: Folder, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    one = folder(SETTINGS, name="one", **{"measures.csv": MEASURES})
    two = folder(SETTINGS, name="two", **{"measures.csv": MEASURES})
    options = ("--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache"), "--jobs", "1")
    assert run(capsys, monkeypatch, "compare", one, str(two), *options).code == 0
    assert (tmp_path / "out" / "one" / "results.json").is_file()
    assert (tmp_path / "out" / "two" / "results.json").is_file()


def test_results_hold_the_lists_of_the_contract(folder: Folder, steadyhand: Steadyhand) -> None:
    from pipeline.tables.catalogue import TABLES

    assert steadyhand("compare", folder(SETTINGS, **{"measures.csv": MEASURES})).code == 0
    results = steadyhand.results()
    for name in ("descriptives", "comparisons", "accuracy", "replay_agreement", "quality", "exclusions"):
        assert isinstance(results[name], list)
        for row in results[name]:
            assert list(row) == TABLES[name].names
    assert results["schema_version"] == 1
    assert results["study"]["name"] == "study"


def test_inspect_prints_the_rows_of_quality(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_session(tmp_path / "a.mcap", session_messages())
    ran = run(capsys, monkeypatch, "inspect", path, "--json")
    assert ran.code == 0
    rows = {row["stream"]: row for row in json.loads(ran.out)}
    assert rows["/phone/imu"]["messages_read"] == 360
    assert rows["/phone/imu"]["rate_hz"] == pytest.approx(90, abs=0.01)
    ran = run(capsys, monkeypatch, "inspect", path)
    assert "/phone/imu: 360 messages, 0 lost, 90.0 Hz" in ran.out
    path.write_bytes(path.read_bytes()[:-5000])
    assert run(capsys, monkeypatch, "inspect", path).code == 1
    path.write_text("no log")
    ran = run(capsys, monkeypatch, "inspect", path)
    assert ran.code == 2
    assert "not an MCAP file" in ran.err


def test_inspect_counts_every_message_and_says_which_a_study_would_lose(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    position = b'{"header": {"stamp": {"sec": 1, "nanosec": 2}}, "point": {"x": 1, "y": 2, "z": 3}}'
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for topic, schema, payloads in (
            ("/position", "geometry_msgs/msg/PointStamped", [position] * 3 + [b"{}"] + [position] * 2),
            ("/events", "steadyhand.Event", [b'{"type": "selection"}'] * 6),
            ("/other", "something.Else", [b"{}"] * 6),
        ):
            channel = writer.register_channel(topic, "json", writer.register_schema(schema, "jsonschema", b"{}"))
            for time, payload in zip((0, 1, 2, 3, 4, 50), payloads, strict=True):
                writer.add_message(channel, time * 10**9, payload, time * 10**9)
        writer.finish()  # type: ignore[no-untyped-call]
    rows = {row["stream"]: row for row in json.loads(run(capsys, monkeypatch, "inspect", path, "--json").out)}
    assert {name: (row["messages_read"], row["messages_lost"]) for name, row in rows.items()} == dict.fromkeys(
        ("/position", "/events", "/other"), (6, 0)
    )
    assert rows["/position"]["note"] == (
        "counted, but a study would lose them: 1 messages cannot be read: it has no header.stamp or timestamp or"
        " stamp; 45 samples missing (88.2%)"
    )
    assert rows["/events"]["note"] is None  # they come as they come, and none is missing
    assert rows["/other"]["note"] is None


def test_simulate_writes_the_same_messages_from_the_same_seed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipeline.sessions.logs import read_log
    from pipeline.sessions.logs.log import Wanted

    study = tmp_path / "reach"
    study.mkdir()
    (study / "study.yaml").write_text((CLONE / "studies" / "reach" / "study.yaml").read_text())
    assert run(capsys, monkeypatch, "simulate", study).code == 0
    bundled = sorted((CLONE / "studies" / "reach" / "data").iterdir())
    assert [path.name for path in sorted((study / "data").iterdir())] == [path.name for path in bundled]
    wanted = [
        Wanted("/tracker/position", "position"),
        Wanted("/phone/imu", "acceleration"),
        Wanted("/reference/position", "position"),
    ]
    for path in bundled[:2]:
        ours, theirs = read_log(study / "data" / path.name, wanted), read_log(path, wanted)
        for topic in ours.topics:
            assert (ours.topics[topic].arrival_ns == theirs.topics[topic].arrival_ns).all()
            assert ours.topics[topic].values == pytest.approx(theirs.topics[topic].values, abs=1e-12, nan_ok=True)


def test_nothing_to_simulate_is_said(
    folder: Folder, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ran = run(capsys, monkeypatch, "simulate", folder(SETTINGS, **{"measures.csv": MEASURES}))
    assert ran.code == 2
    assert "has no `simulation:` block" in ran.err
