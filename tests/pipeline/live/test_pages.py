"""The live study's pages as files: complete in every language, and nothing that their content policy would stop."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from fusion_core import ESTIMATORS
from pipeline.live.messages import VERSION
from tests.conftest import CLONE

PAGES = CLONE / "pipeline" / "live" / "pages"
HTML = sorted(PAGES.glob("*.html"))
SCRIPTS = sorted(PAGES.glob("*.js"))
STYLES = sorted(PAGES.glob("*.css"))
LANGUAGES = sorted(PAGES.glob("texts/*.yaml"))
_NAMESPACE = "http://www.w3.org/2000/svg"


def name(path: Path) -> str:
    """A test's name: the file's."""
    return path.name


def read(path: Path) -> str:
    """A page's file."""
    return path.read_text(encoding="utf-8")


def leaves(texts: Any, prefix: str = "") -> dict[str, str]:
    """Every text by its place, `phone.state.done`."""
    if not isinstance(texts, dict):
        return {prefix: texts}
    return {
        place: text for key, part in texts.items() for place, text in leaves(part, f"{prefix}.{key}".strip(".")).items()
    }


ENGLISH = leaves(yaml.safe_load(read(PAGES / "texts" / "en.yaml")))


def modules(page: str) -> set[str]:
    """The scripts of a page, with those they import."""
    pending, known = {page}, set[str]()
    while pending:
        script = pending.pop()
        known.add(script)
        pending |= set(re.findall(r'from "\./(\w+)\.js"', read(PAGES / f"{script}.js"))) - known
    return known


@pytest.mark.parametrize("language", LANGUAGES, ids=name)
def test_every_language_says_everything(language: Path) -> None:
    texts = leaves(yaml.safe_load(read(language)))
    assert texts.keys() == ENGLISH.keys()
    for place, text in texts.items():
        assert isinstance(text, str) and text.strip(), place
        assert set(re.findall(r"\{\w+\}", text)) == set(re.findall(r"\{\w+\}", ENGLISH[place])), place


@pytest.mark.parametrize("page", HTML, ids=name)
def test_every_text_that_a_page_names_is_there(page: Path) -> None:
    for place in re.findall(r'data-(?:text|label)="([^"]+)"', read(page)):
        assert f"{page.stem}.{place}" in ENGLISH, place


def test_every_text_is_used() -> None:
    used = set[str]()
    for page in HTML:
        scripts = "".join(read(PAGES / f"{script}.js") for script in modules(page.stem))
        places = re.findall(r"texts\.([\w.]+)", scripts) + re.findall(r'data-(?:text|label)="([^"]+)"', read(page))
        used |= {place if place.startswith("common.") else f"{page.stem}.{place}" for place in places}
        used.add(f"{page.stem}.title")  # the document's
    unused = [place for place in ENGLISH if not any(place == one or place.startswith(f"{one}.") for one in used)]
    assert unused == []


@pytest.mark.parametrize("page", HTML, ids=name)
def test_a_page_holds_nothing_that_its_policy_stops(page: Path) -> None:
    text = read(page)
    assert re.findall(r"<script(?![^>]*\bsrc=)[^>]*>|<style|\sstyle=|\son\w+=|javascript:|<base|<iframe", text) == []
    assert re.findall(r"<script[^>]*>([^<]+)</script>", text) == []
    for address in re.findall(r'(?:src|href|action)="([^"]*)"', text):
        assert address.startswith("/pages/"), address
        assert (PAGES / address.removeprefix("/pages/")).is_file(), address


@pytest.mark.parametrize("script", SCRIPTS, ids=name)
def test_a_script_writes_no_markup_and_asks_nobody_else(script: Path) -> None:
    text = read(script).replace(_NAMESPACE, "")
    markup = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|setAttribute\(\"style\""
    assert re.findall(rf"{markup}|https?://|import\(|importScripts|sendBeacon|XMLHttpRequest", text) == []
    for imported in re.findall(r'from "([^"]+)"', text):
        assert (PAGES / imported).is_file(), imported


@pytest.mark.parametrize("style", STYLES, ids=name)
def test_a_style_fetches_nothing(style: Path) -> None:
    assert re.findall(r"url\(|@import|@font-face", read(style)) == []


def test_every_file_is_used() -> None:
    named = set[str]()
    for page in HTML:
        named |= {page.name, *re.findall(r'"/pages/([^"]+)"', read(page)), *(f"{one}.js" for one in modules(page.stem))}
    assert {path.name for path in PAGES.iterdir() if path.is_file()} == named


@pytest.mark.parametrize("page", ["phone", "questionnaire", "join"])
def test_no_estimator_is_named_to_a_participant(page: str) -> None:
    words = [text for place, text in ENGLISH.items() if place.split(".")[0] in (page, "common")]
    everything = " ".join([read(PAGES / f"{page}.html"), *(read(PAGES / f"{one}.js") for one in modules(page)), *words])
    for estimator in ESTIMATORS:
        if estimator != "raw":  # an everyday word
            assert estimator not in everything


def test_every_page_says_the_version_of_its_messages() -> None:
    said = {name(path): re.findall(r"version: (\d+)", read(path)) for path in SCRIPTS if '"hello"' in read(path)}
    assert said == {page: [str(VERSION)] for page in ("operator.js", "phone.js", "questionnaire.js")}
