"""Which edits reach which stages: a digest follows code, the files beside it, and nothing else."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

from fusion_core.window import gp
from pipeline import commands, live, report
from pipeline.analysis import against
from pipeline.engine import code_digest as code_digests
from pipeline.engine.code_digest import Code, code_digest, imports
from pipeline.report import document
from pipeline.sessions import ingest
from pipeline.sessions.logs.mcap import container, protobuf_template
from pipeline.stages import STAGES
from pipeline.statistics import wilcoxon
from pipeline.words import numbers
from tests.conftest import CLONE

PACKAGES = ("pipeline", "fusion_core")


def listed_by_git() -> list[str]:
    """The files of our packages that git lists, committed or new."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", *PACKAGES]
    done = subprocess.run(command, cwd=CLONE, capture_output=True, text=True, check=True)
    return [name for name in done.stdout.splitlines() if (CLONE / name).is_file()]


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages as a wheel installs them: what git lists, without git. Each test leaves them as they were."""
    root = tmp_path_factory.mktemp("installed")
    for name in listed_by_git():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(CLONE / name, root / name)
    return root


@pytest.fixture(autouse=True, scope="module")
def imports_found_once() -> Iterator[None]:
    """What a text imports is the same each time; the packages are gone through anew for every edit of a file."""
    once = cache(lambda source: tuple(imports(source)))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(code_digests, "imports", once)
        yield


def place(module: ModuleType) -> str:
    """Where a module is in the clone, and in a copy of it; of a package its folder."""
    path = Path(str(module.__file__)).relative_to(CLONE)
    return f"{path.parent.as_posix()}/" if path.name == "__init__.py" else path.as_posix()


def digests(root: Path) -> dict[str, str]:
    code = Code(root)
    return {stage.name: code.digest(stage.module) for stage in STAGES}


@pytest.fixture(scope="module")
def before(copied: Path) -> dict[str, str]:
    """The digests of the packages as they are between tests."""
    return digests(copied)


def reached_by(root: Path, before: dict[str, str], path: str, content: bytes | None = None) -> set[str]:
    """The stages whose digest another content of a file changes; the file is put back."""
    target = root / path
    original = target.read_bytes() if target.exists() else None
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(content if content is not None else (original or b"") + b"\n# edited\n")
    after = digests(root)
    if original is None:
        target.unlink()
    else:
        target.write_bytes(original)
    return {name for name in before if before[name] != after[name]}


def test_a_module_reaches_the_stages_that_import_it(copied: Path, before: dict[str, str]) -> None:
    """However indirectly, and also where it is named as text."""
    assert reached_by(copied, before, place(gp)) == {"fuse", "assess", "compare", "report"}
    assert reached_by(copied, before, place(container)) == {"ingest"}
    assert reached_by(copied, before, place(protobuf_template)) == {"ingest"}
    assert reached_by(copied, before, place(wilcoxon)) == {"compare"}
    assert reached_by(copied, before, place(numbers)) >= {"compare", "report"}


def test_a_new_import_is_followed(copied: Path) -> None:
    path = place(ingest)
    importing = (copied / path).read_bytes() + f"\nimport {wilcoxon.__name__}\n".encode()
    original = (copied / path).read_bytes()
    (copied / path).write_bytes(importing)
    assert reached_by(copied, digests(copied), place(wilcoxon)) == {"ingest", "compare"}
    (copied / path).write_bytes(original)


def parsed(source: str) -> set[tuple[str, str]]:
    """What Python's own parser finds: (module, name) of every import, and the modules that strings begin with."""
    found: set[tuple[str, str]] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {(alias.name, "") for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None and node.level == 0, "a relative import is not followed"
            found |= {(node.module, alias.name) for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = re.match(r"(pipeline|fusion_core)(\.\w+)+", node.value)
            found |= {(named.group(), "")} if named else set()
    return found


ODDLY_WRITTEN = """
import a, b.c as d
import e; from f.g import h
if a: import i
def one():
	from j import (  # a comment (in two halves), no name
		k as kk,
		l,  # with, commas
	)
from m import *
from n \\
    import o, \\
    p
try: from q import(r)
except ImportError: pass
STAGE = 'pipeline.stages.one', f"{a}pipeline.two:{b}fusion_core.three", '''pipeline.four'''
"""


def test_an_import_is_found_however_it_is_written() -> None:
    assert set(imports(ODDLY_WRITTEN)) == parsed(ODDLY_WRITTEN)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_that_pythons_parser_finds_is_found(package: str) -> None:
    for path in (CLONE / package).rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        assert set(imports(source)) >= parsed(source), path


def test_every_file_that_is_no_python_reaches_the_stages_of_its_folder(copied: Path, before: dict[str, str]) -> None:
    """Templates, scripts, styles, references: whatever git lists below the packages."""
    no_stages = (f"{place(against)}recompute.R", place(commands), place(live))  # no stage runs them
    others = [name for name in listed_by_git() if not name.endswith(".py") and not name.startswith(no_stages)]
    assert {Path(name).suffix for name in others} >= {".js", ".css", ".jinja", ".typ", ".bib"}
    for name in others:
        reached = reached_by(copied, before, name)
        assert reached >= ({"report"} if name.startswith(place(report)) else {"fuse"}), name
        assert not name.startswith(place(report)) or reached == {"report"}, name


def test_a_kind_of_file_that_nobody_has_thought_of_counts(copied: Path, before: dict[str, str]) -> None:
    assert reached_by(copied, before, f"{place(document)}icons.woff2") == {"report"}
    assert reached_by(copied, before, f"{place(document)}fonts/sans.ttf") == {"report"}


@pytest.mark.parametrize(
    "name",
    ["__pycache__/html.cpython-311.pyc", ".style.css.swp", "style.css~", "#style.css#", ".DS_Store", "html.pyc"],
)
def test_what_python_and_editors_leave_does_not_count(copied: Path, before: dict[str, str], name: str) -> None:
    assert reached_by(copied, before, f"{place(document)}{name}", b"left behind") == set()


def test_installed_packages_have_the_digests_of_the_clone(copied: Path) -> None:
    """So that workers of a cluster may be installed from a wheel."""
    assert digests(copied) == {stage.name: code_digest(stage.module) for stage in STAGES}
