"""Machine code that is kept between runs is never that of other sources."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numba
import pytest

import fusion_core
from tests.conftest import CLONE

# A function in a file of its own calls the process noise, in another: the least there is to compile.
SECOND = """
from fusion_core.compilation import compiled
from fusion_core.kalman.motion import add_wiener_noise

@compiled
def add_a_second(covariance):
    add_wiener_noise(1.0, 1.0, covariance, 1, 0)
"""
# For each line a fork runs that prints the noise that a second adds to the position, and how often the function was
# taken from kept machine code. Before it Numba has begun its work, half a second of it, and seen nothing of ours.
RUNS = """
import os, sys
import numba, numpy as np

numba.njit(lambda numbers: numbers[0])(np.zeros(1))
for _ in sys.stdin:
    assert not any(name.startswith("fusion_core") for name in sys.modules)
    child = os.fork()
    if not child:
        from fusion_core.kalman.second import add_a_second

        covariance = np.zeros((3, 3))
        add_a_second(covariance)
        print(covariance[0, 0], sum(add_a_second.stats.cache_hits.values()), flush=True)
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        sys.exit("the run failed")
"""
NOISE = "squared * squared * dt / 20.0"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of fusion_core without compiled code."""
    source = Path(fusion_core.__file__).parent
    copy = tmp_path / "sources" / "fusion_core"
    shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "kalman" / "second.py").write_text(SECOND)
    return copy


@contextmanager
def running(package: Path, **environment: str) -> Iterator[Callable[[], tuple[float, int]]]:
    """Runs of the package in processes of their own, each of which gives the noise and the number of hits."""
    others = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment = {**others, "HOME": str(package.parent), "PYTHONDONTWRITEBYTECODE": "1", **environment}
    command = [sys.executable, "-c", RUNS]  # Python finds the package first, since it is started beside it
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=package.parent, env=environment, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        asked, answers = process.stdin, process.stdout

        def noise_and_hits() -> tuple[float, int]:
            asked.write("once more\n")
            asked.flush()
            noise, hits = answers.readline().split()
            return float(noise), int(hits)

        yield noise_and_hits
        asked.close()
    assert process.returncode == 0


def edit(file: Path, old: str, new: str) -> None:
    """The file is as long as before and no newer: neither tells that it changed."""
    before = file.stat()
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1
    assert len(old) == len(new)
    file.write_text(text.replace(old, new), encoding="utf-8")
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.mark.parametrize("users_folder", [False, True], ids=["beside the sources", "in NUMBA_CACHE_DIR"])
def test_an_edit_of_a_nested_file_is_never_answered_by_code_compiled_before(package: Path, users_folder: bool) -> None:
    """And code of earlier sources is removed, unless the folder is the user's."""
    environment = {"NUMBA_CACHE_DIR": str(package.parent / "kept")} if users_folder else {}
    with running(package, **environment) as noise_and_hits:
        assert noise_and_hits() == pytest.approx((1 / 20, 0))
        assert noise_and_hits() == pytest.approx((1 / 20, 1))
        edit(package / "kalman" / "motion.py", NOISE, NOISE.replace("20.0", "10.0"))
        assert noise_and_hits() == pytest.approx((1 / 10, 0))
    assert len(list(package.parent.rglob("compiled-*"))) == (2 if users_folder else 1)


def test_a_package_that_cannot_be_written_to_compiles_in_memory(package: Path) -> None:
    """And leaves nothing in the user's own cache, where it could go stale."""
    (package / "__pycache__").write_text("no folder can be made here, not even by root")
    before = sorted(package.parent.rglob("*"))
    with running(package) as noise_and_hits:
        for _ in range(2):
            assert noise_and_hits() == pytest.approx((1 / 20, 0))
    assert sorted(package.parent.rglob("*")) == before


def options_of(function: ast.FunctionDef) -> set[str] | None:
    """Those of `@compiled` that are true; None for a function that is not compiled."""
    for mark in function.decorator_list:
        name = mark.func if isinstance(mark, ast.Call) else mark
        if isinstance(name, ast.Name) and name.id == "compiled":
            return {str(option.arg) for option in mark.keywords} if isinstance(mark, ast.Call) else set()
    return None


def functions_in(tree: ast.Module) -> Iterator[tuple[ast.FunctionDef, bool, bool]]:
    """Each function, whether it is compiled, and whether it has no entry from Python."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            options = options_of(node)
            compiled = options is not None
            yield node, compiled, compiled and (node.name.startswith("_") or "inner" in (options or ()))


SOURCES = {
    ".".join(path.relative_to(CLONE).with_suffix("").parts).removesuffix(".__init__"): path
    for package in ("fusion_core", "pipeline", "tests")
    for path in sorted((CLONE / package).rglob("*.py"))
}


def test_python_calls_no_function_that_has_no_entry_from_python() -> None:
    """That would end the process: an inner compiled function is for compiled ones."""
    texts = {module: path.read_text(encoding="utf-8") for module, path in SOURCES.items()}
    compiling = ("fusion_core", "pipeline.simulation")  # the packages with compiled functions
    trees = {module: ast.parse(text) for module, text in texts.items() if any(package in text for package in compiling)}
    inner = {
        (module, function.name)
        for module, tree in trees.items()
        for function, _, is_inner in functions_in(tree)
        if is_inner
    }
    assert ("fusion_core.kalman.event_steps", "insert") in inner
    assert ("fusion_core.kalman.event_steps", "_subtract_constants") in inner
    calls = []
    for module, tree in trees.items():
        names = {name: (of, name) for of, name in inner if of == module}
        imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        names |= {one.asname or one.name: (str(node.module), one.name) for node in imports for one in node.names}
        for function, compiled, _ in functions_in(tree):
            for node in ast.walk(function) if not compiled else ():
                if isinstance(node, ast.Name):
                    used = names.get(node.id, ("", ""))
                elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                    used = ".".join(names.get(node.value.id, ("", ""))), node.attr
                else:
                    continue
                calls += [(module, function.name, used)] if used in inner else []
    assert calls == []


def test_numbas_own_setting_stays_the_users() -> None:
    assert os.environ.get("NUMBA_CACHE_DIR", "") == numba.config.CACHE_DIR  # type: ignore[attr-defined]
