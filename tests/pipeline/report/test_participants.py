"""A page a participant, where there are many."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import STREAMS, session_messages, write_session
from tests.pipeline.helpers import Steadyhand

Folder = Callable[..., Path]


def many(folder: Folder, people: int) -> Path:
    rows = "".join(f"<P>{p:02},{c},m_s,{p + (c == 'b') * (p % 3)}\n" for p in range(people) for c in "ab")
    settings = (
        "conditions: [a, b]\nmeasures: m.csv\nsessions: '{session}.mcap'\nestimators: {raw: {type: raw}}\n"
        "comparisons: [{measure: m_s, test: t_paired}]\nexclusions: [{participant: <P>02, measure: m_s, reason: ill}]\n"
    )
    root = folder(settings + STREAMS, **{"m.csv": f"participant,condition,measure,value\n{rows}"})
    write_session(root / "one.mcap", session_messages(2.5), participant="<P>01", condition="a")
    return root


@pytest.mark.usefixtures("no_figures", "blank_print")
@pytest.mark.parametrize(("people", "pages"), [(40, 0), (41, 41)])
def test_more_than_forty_participants_have_a_page_each(
    people: int, pages: int, folder: Folder, steadyhand: Steadyhand
) -> None:
    assert steadyhand("report", many(folder, people), "--format", "html").code == 0
    found = sorted((steadyhand.out / "participants").glob("*.html"))
    linked = re.findall(r'href="(participants/[^"]+)"', (steadyhand.out / "report.html").read_text(encoding="utf-8"))
    assert [f"participants/{page.name}" for page in found] == linked
    assert len(found) == pages


@pytest.mark.usefixtures("blank_figures", "blank_print")
def test_a_participants_page_has_their_values_sessions_and_gaps(folder: Folder, steadyhand: Steadyhand) -> None:
    assert steadyhand("report", many(folder, 41)).code == 0
    first, second, third = (
        (steadyhand.out / "participants" / f"{number:04d}.html").read_text(encoding="utf-8") for number in (1, 2, 3)
    )
    assert "<h1>Participant &lt;P&gt;00</h1>" in first
    assert 'href="../report.html"' in first
    assert "M (s)" in first
    assert ">ill<" in third  # the style has words with these letters
    assert ">ill<" not in first
    assert 'href="../traces.html#1"' in second
    assert "/tracker" not in first
    assert ">tracker<" in second
    with zipfile.ZipFile(steadyhand.out / "report.zip") as archive:
        files = {path.relative_to(steadyhand.out).as_posix() for path in steadyhand.out.rglob("*") if path.is_file()}
        assert {name.removeprefix("study/") for name in archive.namelist()} == files - {"report.zip"}
        for name in archive.namelist():
            assert archive.read(name) == (steadyhand.out / name.removeprefix("study/")).read_bytes()
