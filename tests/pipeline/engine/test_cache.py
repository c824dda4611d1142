"""A cache that is killed, filled, shared, damaged and tidied: the next run is right, and the user is told."""

from __future__ import annotations

import errno
import os
import random
import resource
import shutil
import signal
import sys
import time
from collections.abc import Callable
from multiprocessing.process import BaseProcess
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from pipeline.__main__ import main
from pipeline.engine.cache import Cache
from pipeline.engine.housekeeping import items_in, prune
from pipeline.sessions import fuse
from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.forked import FORKED
from tests.pipeline.helpers import Ran, Steadyhand, run

pytestmark = pytest.mark.forks

SETTINGS = (
    "conditions: [a, b]\nsessions: data/{participant}_{condition}.mcap\nestimators: {raw: {type: raw}}\n" + STREAMS
)
SESSIONS = ("P1_a", "P1_b")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sessions, which no test changes."""
    root = tmp_path_factory.mktemp("shared") / "study"
    root.mkdir()
    (root / "study.yaml").write_text(SETTINGS, encoding="utf-8")
    for seed, session in enumerate(SESSIONS):
        write_session(root / "data" / f"{session}.mcap", session_messages(2.5, seed=seed))
    return root


def _compare(study: Path, out: Path, cache: Path, jobs: int, die_at: int | None, most_bytes: int | None) -> None:
    """`steadyhand compare`, killed at a touch of the cache's files, or with a limit to a file's size."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores Ctrl-C for what runs in the background
    touched = 0

    def watch(event: str, arguments: tuple[object, ...]) -> None:
        nonlocal touched
        if event in ("open", "os.mkdir", "os.rename", "os.rmdir", "os.remove", "os.utime") and arguments:
            touched += str(arguments[0]).startswith(str(cache))
            if touched == die_at:
                os.kill(os.getpid(), signal.SIGKILL)

    if die_at is not None:
        sys.addaudithook(watch)
    if most_bytes is not None:
        quiet = os.open(os.devnull, os.O_WRONLY)  # what the test captures stands in a file too
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, resource.RLIM_INFINITY))
    sys.argv = ["steadyhand", "compare", str(study), "--out", str(out), "--cache", str(cache), "--jobs", str(jobs)]
    main()


def apart(
    study: Path, out: Path, cache: Path, *, jobs: int = 1, die_at: int | None = None, most_bytes: int | None = None
) -> BaseProcess:
    """A run in a process of its own, begun."""
    process = FORKED.Process(target=_compare, args=(study, out, cache, jobs, die_at, most_bytes))
    process.start()
    return process


def code_of(process: BaseProcess) -> int | None:
    """The exit code, or minus the signal."""
    process.join(60)
    return process.exitcode


@pytest.fixture(scope="module")
def alone(study: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Cache and output of a run that nothing disturbs."""
    root = tmp_path_factory.mktemp("alone")
    assert code_of(apart(study, root / "out", root / "cache")) == 0
    return root


@pytest.fixture
def undisturbed(alone: Path) -> bytes:
    """Its results.json."""
    return (alone / "out" / "results.json").read_bytes()


@pytest.fixture
def filled(alone: Path, steadyhand: Steadyhand) -> Steadyhand:
    """The command with a copy of its cache."""
    shutil.copytree(alone / "cache", steadyhand.cache)
    return steadyhand


def test_a_run_killed_at_any_moment_leaves_the_next_one_right(study: Path, tmp_path: Path, undisturbed: bytes) -> None:
    chance, killed = random.Random(7), 0  # noqa: S311 - where to kill, not a secret
    out, cache = tmp_path / "out", tmp_path / "cache"
    for _ in range(8):
        killed += code_of(apart(study, out, cache, die_at=chance.randrange(1, 40))) == -signal.SIGKILL
    assert killed >= 4  # the later ones may find little to do
    assert code_of(apart(study, out, cache)) == 0
    assert (out / "results.json").read_bytes() == undisturbed


def test_a_pool_killed_at_work_leaves_the_next_run_right(study: Path, tmp_path: Path, undisturbed: bytes) -> None:
    out, cache = tmp_path / "out", tmp_path / "cache"
    process = apart(study, out, cache, jobs=2)
    _until(lambda: any(cache.glob("ingest/*/*")))
    process.kill()
    assert code_of(process) == -signal.SIGKILL
    assert code_of(apart(study, out, cache)) == 0
    assert (out / "results.json").read_bytes() == undisturbed


def test_ctrl_c_stops_with_a_message_and_the_next_run_goes_on(study: Path, tmp_path: Path, undisturbed: bytes) -> None:
    out, cache = tmp_path / "out", tmp_path / "cache"
    process = apart(study, out, cache, jobs=2)
    _until(lambda: any(cache.glob("ingest/*/*")))
    assert process.pid is not None
    os.kill(process.pid, signal.SIGINT)
    assert code_of(process) == 130
    assert not any((cache / "new").iterdir())
    kept = {path: path.stat().st_ino for path in cache.glob("ingest/*/*/entry.json")}
    assert kept
    assert code_of(apart(study, out, cache)) == 0
    assert {path: path.stat().st_ino for path in kept} == kept
    assert (out / "results.json").read_bytes() == undisturbed


def test_ctrl_c_is_answered_with_what_to_do(
    study: Path, steadyhand: Steadyhand, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_work: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(fuse, "run", interrupted)
    ran = steadyhand("compare", study)
    assert ran.code == 130
    assert ran.err.endswith("steadyhand: interrupted. Finished work is cached: run the command again to continue\n")
    assert not any((steadyhand.cache / "new").iterdir())


def _until(seen: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not seen():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_two_runs_at_once_on_one_cache(study: Path, tmp_path: Path, undisturbed: bytes) -> None:
    cache = tmp_path / "cache"
    for damage in (False, True):
        if damage:
            for path in cache.glob("*/*/*/*.parquet"):
                path.write_bytes(b"half")
        outs = [tmp_path / f"{name}-{damage}" for name in ("one", "two")]
        runs = [apart(study, out, cache) for out in outs]
        assert [code_of(process) for process in runs] == [0, 0]
        for out in outs:
            assert (out / "results.json").read_bytes() == undisturbed
    assert not any((cache / "new").iterdir())


@pytest.mark.parametrize("most_bytes", [300, 5000])
def test_a_disk_without_room_leaves_the_next_run_right(
    study: Path, tmp_path: Path, undisturbed: bytes, most_bytes: int
) -> None:
    out, cache = tmp_path / "out", tmp_path / "cache"
    assert code_of(apart(study, out, cache, most_bytes=most_bytes)) == 2
    assert not (out / "results.json").exists()
    assert code_of(apart(study, out, cache)) == 0
    assert (out / "results.json").read_bytes() == undisturbed


def test_a_full_disk_is_said_and_is_no_sessions_fault(
    study: Path, steadyhand: Steadyhand, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_work: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(fuse, "run", full)
        ran = steadyhand("compare", study)
    assert ran.code == 2
    assert (
        "cannot be written: No space left on device; free some space (perhaps with `steadyhand cache prune`)" in ran.err
    )
    assert "set aside" not in ran.err
    assert steadyhand("compare", study).code == 0


def _without(name: str) -> Callable[[Path], None]:
    return lambda entry: (entry / name).unlink()


def _with(name: str, text: str) -> Callable[[Path], object]:
    return lambda entry: (entry / name).write_text(text, encoding="utf-8")


def _set_aside(entry: Path) -> None:
    manifest = entry / "entry.json"
    manifest.write_text(manifest.read_text().replace('"set_aside": null', '"set_aside": "no"'))


def test_a_damaged_entry_is_computed_again_and_said(study: Path, undisturbed: bytes, filled: Steadyhand) -> None:
    harms: list[tuple[Callable[[Path], object], str]] = [
        (_with("tracks.parquet", "half"), "tracks.parquet has changed since it was written"),
        (_without("tracks.parquet"), "tracks.parquet is missing"),
        (_without("entry.json"), "entry.json is missing"),
        (_with("entry.json", "{"), "entry.json cannot be read"),
        (_with("entry.json", "[]"), "entry.json cannot be read"),
        (_set_aside, "entry.json has changed since it was written"),
    ]
    for harm, said in harms:
        harm(next(filled.cache.glob("fuse/*/*")))
        ran = filled("compare", study)
        assert ran.code == 0
        assert '"fuse" of session P1_' in ran.err
        assert f"was damaged ({said}) and has been computed again" in ran.err
        assert "Computed: fuse 1 (" in ran.out
        assert (filled.out / "results.json").read_bytes() == undisturbed
    assert "damaged" not in filled("compare", study).err


def _decay(path: Path) -> None:
    """Flip a bit of what the file holds, as a disk does: the file's time stays."""
    sealed, content = path.stat(), bytearray(path.read_bytes())
    place = len(content) // 3
    if path.suffix == ".parquet":
        column = pq.ParquetFile(path).metadata.row_group(0).column(0)
        place = column.data_page_offset + column.total_compressed_size - 1
    content[place] ^= 4
    path.write_bytes(content)
    os.utime(path, ns=(sealed.st_atime_ns, sealed.st_mtime_ns))


@pytest.mark.parametrize("jobs", [1, 2])
def test_decay_that_no_time_tells_of_is_computed_again_when_it_is_read(
    study: Path, undisturbed: bytes, filled: Steadyhand, tmp_path: Path, jobs: int
) -> None:
    root = shutil.copytree(study, tmp_path / "study")
    for path in filled.cache.glob("ingest/*/*/positions.parquet"):
        _decay(path)
    _decay(next(filled.cache.glob("assess/*/*/trials.parquet")))
    shutil.rmtree(filled.cache / "fuse")  # so that both sessions are read again
    shutil.rmtree(filled.cache / "measure")
    ran = filled("compare", root, "--jobs", str(jobs))
    assert ran.code == 0
    for session in SESSIONS:
        said = f'"ingest" of session {session} was damaged (positions.parquet has changed since it was written)'
        assert ran.err.count(said) == 1
    assert (
        ran.err.count("was damaged (trials.parquet has changed since it was written) and has been computed again") == 1
    )
    assert "Computed: ingest 2, fuse 4, " in ran.out
    assert (filled.out / "results.json").read_bytes() == undisturbed
    assert "Nothing had changed" in filled("compare", root).out


def test_decay_of_what_is_copied_to_the_user_is_seen(study: Path, undisturbed: bytes, filled: Steadyhand) -> None:
    _decay(next(filled.cache.glob("compare/*/*/results.json")))
    ran = filled("compare", study)
    assert "was damaged (results.json has changed since it was written) and has been computed again" in ran.err
    assert (filled.out / "results.json").read_bytes() == undisturbed


@pytest.fixture
def cache(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, steadyhand: Steadyhand
) -> Callable[..., Ran]:
    return lambda *words: run(capsys, monkeypatch, "cache", *words, "--cache", steadyhand.cache)


def test_a_cache_that_is_not_there_is_said(cache: Callable[..., Ran]) -> None:
    for words in (["show"], ["verify"], ["prune", "--older-than", "1"]):
        ran = cache(*words)
        assert ran.code == 2
        assert "there is no cache here; name its folder with --cache" in ran.err


@pytest.mark.usefixtures("filled")
def test_cache_shows_entries_of_replay_and_what_a_killed_run_left(
    cache: Callable[..., Ran], steadyhand: Steadyhand
) -> None:
    """Neither is of a stage of the report; they come last."""
    kept = next(steadyhand.cache.glob("fuse/*/*"))
    shutil.copytree(kept, steadyhand.cache / "replay" / kept.parent.name / kept.name)
    (steadyhand.cache / "new" / "left").mkdir(parents=True)
    ran = cache("show")
    assert ran.code == 0
    assert [line.split()[0] for line in ran.out.splitlines()[-2:]] == ["replay", "(unfinished)"]


@pytest.mark.usefixtures("filled")
def test_cache_shows_what_is_kept(cache: Callable[..., Ran]) -> None:
    lines = [line.split() for line in cache("show").out.splitlines()]
    assert [(line[0], line[1]) for line in lines[2:]] == [
        ("ingest", "2"),
        ("fuse", "2"),
        ("assess", "2"),
        ("measure", "1"),
        ("compare", "1"),
    ]


def test_verify_removes_what_is_damaged(filled: Steadyhand, cache: Callable[..., Ran]) -> None:
    ran = cache("verify")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out.startswith("8 entries (")
    entry = next(filled.cache.glob("fuse/*/*"))
    path = entry / "tracks.parquet"
    path.write_bytes(bytes(byte ^ (place == 100) for place, byte in enumerate(path.read_bytes())))
    ran = cache("verify")
    assert ran.code == 1
    assert f"{entry.relative_to(filled.cache)}: damaged, removed: tracks.parquet has changed" in ran.err
    assert not entry.exists()
    assert cache("verify").code == 0


def test_prune_keeps_what_a_study_as_it_is_now_uses(
    study: Path, tmp_path: Path, filled: Steadyhand, cache: Callable[..., Ran]
) -> None:
    ran = cache("prune")
    assert ran.code == 2
    assert "say what to remove: --older-than DAYS, --keep-current STUDY, or both" in ran.err
    root = shutil.copytree(study, tmp_path / "study")
    assert "Removed 0 entries" in cache("prune", "--keep-current", root).out
    settings = (root / "study.yaml").read_text()
    (root / "study.yaml").write_text(settings.replace("raw: {type: raw}", "euro: {type: one_euro}"))
    assert filled("compare", root).code == 0
    # Reading the logs has nothing to do with the estimators; everything after it has.
    assert "Removed 6 entries" in cache("prune", "--keep-current", root).out
    assert "Nothing had changed" in filled("compare", root).out
    assert "Removed 0 entries" in cache("prune", "--older-than", "1").out
    assert "Removed 8 entries" in cache("prune", "--older-than", "0").out
    assert cache("show").out.endswith("0 entries (0.0 MB)\n")


def test_prune_goes_by_the_last_use(filled: Steadyhand) -> None:
    cache, long_ago = Cache(filled.cache), time.time() - 100
    for one in items_in(cache):
        os.utime(one.folder / "entry.json", (long_ago, long_ago))
    used = next(one for one in items_in(cache) if one.stage == "fuse")
    assert cache.get("fuse", used.folder.name) is not None
    gone = prune(cache, time.time(), 50, None)
    assert [one.folder for one in gone.left] == [used.folder]
    assert list(items_in(cache)) == list(gone.left)


def test_what_killed_runs_left_goes_after_a_day(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    left = tmp_path / "new" / "fuse-x"
    left.mkdir(parents=True)
    assert prune(cache, time.time() + 3600, 0, None).removed == ()
    assert [one.folder for one in prune(cache, time.time() + 25 * 3600, 1e9, None).removed] == [left]
    assert not left.exists()
