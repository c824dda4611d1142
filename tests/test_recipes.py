"""The recipes of CONTRIBUTING.md, walked in a copy of the packages: what they add works, and touches no other files."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import CLONE, EMPTY_FIGURE, STREAMS, session_messages, write_session

PAGE = (CLONE / "CONTRIBUTING.md").read_text(encoding="utf-8")

Edit = Callable[[str], str]


def after(anchor: str, addition: str) -> Edit:
    """Insert behind the first place where `anchor` stands."""

    def edit(text: str) -> str:
        assert anchor in text, anchor
        return text.replace(anchor, anchor + addition, 1)

    return edit


ESTIMATOR = '''

@dataclass(frozen=True)
class Halfway:
    """Midway between the last two frames."""

    sensors: Mapping[str, Sensor]

    def start(self) -> tuple[Sample, ...]:
        """No frame yet."""
        return ()

    def update(self, state: tuple[Sample, ...], sensor: str, sample: Sample) -> tuple[Sample, ...]:
        """The last two frames."""
        return (*state, sample)[-2:] if sensor == position_sensor(self.sensors) else state

    def predict(self, state: tuple[Sample, ...], time: float) -> tuple[FloatArray, FloatArray]:
        """Their middle."""
        tracker = self.sensors[position_sensor(self.sensors)]
        if not state:
            return unknown(tracker.dimension)
        return np.mean([frame.value for frame in state], axis=0), np.full(tracker.dimension, tracker.noise_sd)

    def replay(self, samples: Mapping[str, Samples], times: FloatArray) -> Track:
        """One frame after the other."""
        return replay_loop(self, samples, times)
'''
MEASURE = """
    yield values(moved.assign(paused=moved["duration_s"] / 2), "pause_s", "paused", "the trials")
"""
TEST = '''

def sign_of_means(first: FloatArray, second: FloatArray) -> Result:
    """How many of the differences are positive."""
    return Result("condition", "k", "counted", "estimate", len(first), statistic=float(np.sum(first > second)), p=0.5)
'''
RECORD = """
        StatisticalTest(
            "count_signs", "counted signs", "count of signs", "counts of the signs of differences", cite=("holm1979",)
        ),
"""
SECTION = '''"""How many rows there are."""

from __future__ import annotations

from pipeline.report.document.model import Section, Table, columns
from pipeline.report.sections.material import Material


def section(material: Material) -> Section:
    """A table of counts."""
    rows = tuple((name, str(len(material.rows(name)))) for name in ("descriptives", "comparisons"))
    return Section("counts", "How many rows", (Table("table-counts", "Rows.", columns(("Table", "Rows"), 1), rows),))
'''
COMMAND = '''"""Says hello."""

from pipeline.commands import console


def greet(name: str) -> None:
    """A line."""
    console.say(f"hello {name}")
'''
ENTRY = '''@app.command()
def greet(name: str) -> None:
    """Say hello."""
    from pipeline.commands import greet as command

    command.greet(name)


'''
NEW = ""
"""What a file that is not there yet begins with."""

RECIPES: dict[str, dict[str, Edit]] = {
    "An estimator": {
        "fusion_core/filters.py": lambda text: text + ESTIMATOR,
        "fusion_core/__init__.py": lambda text: text.replace("import Holt,", "import Halfway, Holt,").replace(
            '    "raw": Raw,\n', '    "raw": Raw,\n    "halfway": Halfway,  # type: ignore[dict-item]\n'
        ),
        "studies/README.md": after("| `raw` | the newest frame, held | |\n", "| `halfway` | the last two frames | |\n"),
    },
    "A measure": {
        "pipeline/analysis/values.py": lambda text: text.replace(
            '    covered = moved["path_length_mm"]', f'{MEASURE}    covered = moved["path_length_mm"]'
        ).replace("yield values(moved", "yield _values(moved"),
        "pipeline/study/measures.py": after(
            "MEASURES: Mapping[str, Measure] = {\n    measure.name: measure\n    for measure in (\n",
            '        Measure("pause_s", "Pause", "s", "ratio", "lower", source="the trials"),\n',
        ),
        "studies/README.md": after("| measure | what it is |\n|---|---|\n", "| `pause_s` | half of a trial's time |\n"),
    },
    "A statistical test": {
        "pipeline/statistics/": lambda text: text + TEST,
        "pipeline/study/statistical_tests.py": after("    test.name: test\n    for test in (\n", RECORD.lstrip("\n")),
        "pipeline/analysis/comparisons.py": lambda text: text.replace(
            '    "crossover": ',
            '    "count_signs": pairwise(lambda _, one, two: sign_of_means(one, two)),\n    "crossover": ',
            1,
        ).replace(
            "from pipeline.statistics.wilcoxon import wilcoxon",
            "from pipeline.statistics.paired import sign_of_means\nfrom pipeline.statistics.wilcoxon import wilcoxon",
        ),
        "studies/README.md": after(
            "| test | what it is | effect size |\n|---|---|---|\n", "| `count_signs` | a count | |\n"
        ),
    },
    "A message type": {
        "pipeline/sessions/logs/mcap/schemas.py": after(
            '    "PointStamped": "position",\n', '    "SpotReading": "position",\n'
        ),
        "pipeline/sessions/logs/mcap/layout.py": after('    "position": (\n', '        ("spot",),\n'),
    },
    "A section of the report with a table": {
        "pipeline/report/sections/": lambda _: SECTION,
        "pipeline/report/sections/order.py": lambda text: text.replace(
            "    provenance.section,\n)", "    provenance.section,\n    counts.section,\n)"
        ).replace("from pipeline.report.sections import (\n", "from pipeline.report.sections import (\n    counts,\n"),
    },
    "A command": {
        "pipeline/commands/": lambda _: COMMAND,
        "pipeline/__main__.py": lambda text: text.replace("@app.command()\n", f"{ENTRY}@app.command()\n", 1),
        "README.md": after("## Your own study\n", "\n`steadyhand greet` says hello.\n"),
    },
}
WITHIN = {
    "pipeline/statistics/": "pipeline/statistics/paired.py",
    "pipeline/report/sections/": "pipeline/report/sections/counts.py",
    "pipeline/commands/": "pipeline/commands/greet.py",
}
"""The file in a folder that a recipe leaves to the reader."""

STUDY = """
title: Recipes
conditions: [a, b]
sessions: data/{participant}_{condition}.mcap
estimators: {mine: {type: halfway}}
comparisons: [{measure: pause_s, test: count_signs}]
"""
RUN = f"""
import sys
sys.argv[0] = "steadyhand"
if "report" in sys.argv:  # as the fixture `no_figures`, in another process
    from pipeline.report import figures
    figures.draw = lambda _figure, path, *_: path.write_text({EMPTY_FIGURE!r})
from pipeline.__main__ import main
main()
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages with all six recipes walked."""
    root = tmp_path_factory.mktemp("recipes")
    for package in ("pipeline", "fusion_core"):
        shutil.copytree(CLONE / package, root / package, ignore=shutil.ignore_patterns("__pycache__"))
    for page in ("README.md", "studies/README.md"):
        (root / page).parent.mkdir(exist_ok=True)
        shutil.copy(CLONE / page, root / page)
    for edits in RECIPES.values():
        for name, edit in edits.items():
            path = root / WITHIN.get(name, name)
            before = path.read_text(encoding="utf-8") if path.exists() else NEW
            after_edit = edit(before)
            assert after_edit != before, name
            path.write_text(after_edit, encoding="utf-8")
    return root


def steadyhand(copy: Path, *words: str | Path) -> str:
    """The command of the copy."""
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    ran = subprocess.run(
        [sys.executable, "-c", RUN, *map(str, words)],
        env=environment,
        cwd=copy,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def named_in(recipe: str) -> set[str]:
    """The files that a recipe's numbered steps begin with."""
    part = PAGE.split(f"### {recipe}\n", 1)[1].split("\n### ", 1)[0]
    return {
        name
        for line in re.findall(r"^\d\. (.*):", part, flags=re.MULTILINE)
        for name in re.findall(r"^`([^`]+)`", line)
    }


@pytest.mark.parametrize("recipe", RECIPES)
def test_a_recipe_touches_the_files_it_names(recipe: str) -> None:
    optional = {"pipeline/report/prose/references.bib"}  # where what is cited stands there already
    assert named_in(recipe) - optional == set(RECIPES[recipe])


def test_what_the_recipes_add_works(copy: Path, tmp_path: Path) -> None:
    study = tmp_path / "study"
    for participant in ("P1", "P2"):
        for condition, bias in (("a", 0.0), ("b", 5.0)):
            write_session(study / "data" / f"{participant}_{condition}.mcap", session_messages(2.5, bias_mm=bias))
    (study / "study.yaml").write_text(STUDY + STREAMS, encoding="utf-8")
    out = tmp_path / "out"
    steadyhand(
        copy, "report", study, "--out", out, "--cache", tmp_path / "cache", "--jobs", "1", "--format", "html,json"
    )
    results = json.loads((out / "results.json").read_text(encoding="utf-8"))
    assert {row["estimator"] for row in results["accuracy"]} == {"mine"}
    assert any(row["measure"] == "pause_s" for row in results["descriptives"])
    assert [row["test"] for row in results["comparisons"]] == ["count_signs"]
    page = (out / "report.html").read_text(encoding="utf-8")
    for text in ("How many rows", "Pause (s)", "counted signs", "counts of the signs of differences"):
        assert text in page, text
    assert steadyhand(copy, "greet", "you").strip() == "hello you"


def test_an_added_message_type_is_read(copy: Path) -> None:
    code = "from pipeline.sessions.logs.mcap.schemas import content_of; print(content_of('json', 'lab.SpotReading'))"
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    ran = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=copy, capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == "position"
