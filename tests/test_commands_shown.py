"""Every command that README, docs and `make help` show runs: on copies of the bundled studies, in a folder of its own.

A name in a page, such as path/to/study, stands for the bundled study that suits the command, or for a part of it. What
takes minutes is marked as slow.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from pipeline.engine import folders
from tests.conftest import CLONE
from tests.pipeline.helpers import exit_code

PAGES = sorted([*CLONE.glob("*.md"), *CLONE.glob("docs/**/*.md"), CLONE / "studies" / "README.md"])
_COMMAND = re.compile(r"^\s*(?:\.venv/bin/)?steadyhand ((?:[^\n\\]|\\\n)+)", re.MULTILINE)
_BLOCK = re.compile(r"^```sh\n(.*?)^```|((?:^    \S[^\n]*\n)+)", re.MULTILINE | re.DOTALL)
_WITH_LOGS = ("replay", "fit", "simulate")
_WITH_JOBS = ("report", "compare", "check", "replay", "fit", "simulate", "explore")
_PLAYED = "record studies/peephole --demo --bots --participants 1 --out demo"
"""In the place of every `record`, which serves pages until somebody ends it."""
_HANDED_ON_BY_MAKE = ("MAKEFLAGS", "MFLAGS", "MAKEOVERRIDES", "MAKELEVEL", "ARGS", "STUDY")
_MINUTES = re.compile(r"studies/peephole")
# A contradiction among printed figures, and a difference between two results, are answers too.
_CODES = {"audit": (0, 3), "diff": (0, 3)}


def shown_in(page: Path) -> Iterator[str]:
    """The commands in the blocks of a page, without their remarks."""
    for block in _BLOCK.finditer(page.read_text(encoding="utf-8")):
        for command in _COMMAND.finditer(block.group(1) or block.group(2)):
            yield re.sub(r"\s+", " ", command.group(1).replace("\\\n", " ").split(" #")[0]).strip()


def shown_by_make() -> Iterator[str]:
    """What `make TARGET` runs, with the options that `make help` gives as an example for it.

    What a `make` of these tests was given is for their own run: it hands it on in the environment.
    """
    own = {name: value for name, value in os.environ.items() if name not in _HANDED_ON_BY_MAKE}
    help_of = re.compile(r"^([a-z-]+):.*?## (.*)$", re.MULTILINE)
    for target, text in help_of.findall((CLONE / "Makefile").read_text(encoding="utf-8")):
        example = re.search(r'ARGS="([^"]*)"', text)
        words = ["make", "-n", "--no-print-directory", target, *([f"ARGS={example[1]}"] if example else [])]
        printed = subprocess.run(words, cwd=CLONE, env=own, capture_output=True, text=True, check=True).stdout
        yield from (command.strip() for command in _COMMAND.findall(printed))


def every_command() -> list[ParameterSet]:
    """Each command once."""
    seen: dict[str, ParameterSet] = {}
    for command in (*(one for page in PAGES for one in shown_in(page)), *shown_by_make()):
        words = _PLAYED if command.startswith("record ") else shlex.join(shlex.split(command))
        seen[words] = pytest.param(words, marks=[pytest.mark.slow] if _MINUTES.search(words) else [], id=words)
    return list(seen.values())


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with copies of the bundled studies, in which commands write what they write."""
    root = tmp_path_factory.mktemp("place")
    for name in ("feng2016", "reach"):
        shutil.copytree(CLONE / "studies" / name, root / "studies" / name)
    most = shutil.ignore_patterns("R0[3-8]_reach.mcap")
    shutil.copytree(CLONE / "studies" / "reach", root / "two" / "reach", ignore=most)
    shutil.copytree(CLONE / "studies" / "feng2016", root / "one_scale" / "feng2016")
    fewer = (root / "one_scale" / "feng2016" / "study.yaml").read_text(encoding="utf-8")
    fewer = fewer.replace("nasa_tlx/*", "nasa_tlx/effort").replace("printed: printed.yaml\n", "")
    (root / "one_scale" / "feng2016" / "study.yaml").write_text(fewer, encoding="utf-8")
    (root / "studies" / "peephole").mkdir()
    settings = (CLONE / "studies" / "peephole" / "study.yaml").read_text(encoding="utf-8")
    (root / "studies" / "peephole" / "study.yaml").write_text(briefer(settings), encoding="utf-8")
    (root / "reports").mkdir()
    return root


def briefer(settings: str) -> str:
    """The simulated study with three participants in the place of twelve, and with the first of their six targets."""
    for words, instead in (
        (r"  participants: 12\n", "  participants: 3\n"),
        (r"  repeats: 20\n", "  repeats: 1\n"),
        (r"(  path_mm:.*\n(?:    - .*\n){2})(?:    - .*\n)+", r"\1"),
        (r"  targets_mm: \[((?:\[[^]]*\], ){1}).*\]\n", r"  targets_mm: [\1]\n"),
    ):
        settings, times = re.subn(words, instead, settings)
        assert times == 1, words
    return settings


def in_place_of_names(command: str, place: Path) -> list[str]:
    """The words of a command with the bundled studies in the place of a page's examples."""
    copies = {
        "path/to/study": _suits(command),
        "path/to/another": "another/reach_again",
        "path/to/folder": "folder",
        "path/to/empty": "empty",
        "path/to/log.mcap": "studies/reach/data/R01_reach.mcap",
        "path/to/printed.yaml": "studies/feng2016/printed.yaml",
        "printed.yaml": "studies/feng2016/printed.yaml",
    }
    words = [copies.get(word, word) for word in shlex.split(command)]
    if words[0] == "explore":  # the same options of fewer people and trackers: one figure of each list is enough
        words = [word.split(",")[0] if re.fullmatch(r"[\d.]+(,[\d.]+)+", word) else word for word in words]
        words += ["--participants", "2", "--repeats", "1", *([] if "--rate" in words else ["--rate", "30"])]
    if words[0] in _WITH_JOBS:  # what processes compute is for tests/pipeline/engine
        words += ["--jobs", "1"]
    return words


def _suits(command: str) -> str:
    """Two logs of the reach, or the paper's study; with one scale in the place of six where others compute it too."""
    if command.split(maxsplit=1)[0] in _WITH_LOGS:
        return "two/reach"
    return "one_scale/feng2016" if "--against" in command else "studies/feng2016"


def prepared(words: list[str], place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make what the command is about to read, and take away what an earlier one wrote and is never overwritten."""
    shutil.rmtree(place / "empty", ignore_errors=True)
    shutil.rmtree(place / "folder", ignore_errors=True)
    shutil.rmtree(place / "demo", ignore_errors=True)
    for name in ("preregistered.yaml", "preregistration.md"):
        (place / "studies" / "feng2016" / name).unlink(missing_ok=True)
    for word in ("participants.csv", "blocks.csv"):
        (place / word).unlink(missing_ok=True)
    if words[0] == "new":
        shutil.copytree(CLONE / "studies" / "feng2016", place / "folder", ignore=shutil.ignore_patterns("*.yaml"))
    if "another/reach_again" in words and not (place / "another").exists():
        shutil.copytree(place / "two" / "reach", place / "another" / "reach_again")
    for word in words[1:3] if words[0] == "diff" else ():
        if not (place / word).exists():
            run = ("compare", place / "studies" / "feng2016", "--out", place / word, "--jobs", "1")
            assert exit_code(monkeypatch, *run) == 0


@pytest.mark.usefixtures("blank_figures", "blank_print")
@pytest.mark.parametrize("command", every_command())
def test_it_runs(
    command: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    monkeypatch.setattr(folders, "reports_folder", lambda: place / "reports")
    words = in_place_of_names(command, place)
    prepared(words, place, monkeypatch)
    code = exit_code(monkeypatch, *words)
    assert code in _CODES.get(words[0], (0,)), capsys.readouterr().err


def test_commands_are_found() -> None:
    """The search above finds what the pages show; a page whose blocks it does not understand would be left out."""
    shown = {page.relative_to(CLONE).as_posix(): list(shown_in(page)) for page in PAGES}
    assert len(shown["README.md"]) > 30
    assert shown["docs/against.md"]
    assert shown["docs/audit.md"]
    assert len(list(shown_by_make())) > 6
