"""Where compiled code is kept if the program's own folder cannot be written. `.ci/elsewhere` runs a whole report so."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pipeline.engine.machine_code import keep_machine_code_in


@pytest.fixture(autouse=True)
def read_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")  # so that it is put back to what it was
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setattr(os, "access", lambda *_: False)


def test_it_is_kept_with_the_cache_for_its_user_alone(tmp_path: Path) -> None:
    keep_machine_code_in(tmp_path / "cache")
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.is_relative_to(tmp_path / "cache")
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_may_write_to_or_a_link_is_not_taken(tmp_path: Path) -> None:
    folder = tmp_path / "compiled" / f"user-{os.getuid()}"
    folder.mkdir(parents=True)
    folder.chmod(0o777)
    keep_machine_code_in(tmp_path)
    assert "NUMBA_CACHE_DIR" not in os.environ
    folder.rmdir()
    folder.symlink_to(tmp_path)
    keep_machine_code_in(tmp_path)
    assert "NUMBA_CACHE_DIR" not in os.environ


def test_the_users_own_choice_stands_and_so_does_a_program_that_can_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "mine")
    keep_machine_code_in(tmp_path)
    assert os.environ["NUMBA_CACHE_DIR"] == "mine"
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setattr(os, "access", lambda *_: True)
    keep_machine_code_in(tmp_path)
    assert not list(tmp_path.iterdir())
