"""Figures of a page as they were drawn, and as pixels where there are too many of them."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from pipeline.report import figures
from pipeline.report.document.compact_svg import compact
from pipeline.report.document.pictures import Picture, pictures
from pipeline.report.document.typst_compiler import compiler_of
from pipeline.report.figures.style import panels, save

NAMES = ["few.svg", "many.svg", "more.svg"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("figures")
    random = np.random.default_rng(1)
    for name, count in zip(NAMES, (5, 6000, 9000), strict=True):
        figure, (axes,) = panels()
        axes.plot(random.normal(size=count), random.normal(size=count), "o", color="#b00000")
        axes.set_title("50 % & <more> #1 “quoted” Δ")
        save(figure, root / name)
    return root


def size(found: dict[str, Picture]) -> int:
    return sum(len(picture.url) for picture in found.values())


def test_within_the_budget_all_are_as_they_were_drawn(folder: Path) -> None:
    found = pictures(folder, NAMES)
    assert list(found) == NAMES
    for name, picture in found.items():
        head, _, svg = picture.url.partition(",")
        assert (head, picture.is_pixels) == ("data:image/svg+xml;charset=utf-8", False)
        assert unquote(svg) == compact((folder / name).read_text(encoding="utf-8"))
        assert not set('"<>#') & set(svg)  # they would end the attribute or the URL


def drawn(svg: str, folder: Path) -> np.ndarray:
    """The pixels of an SVG, by the program that sets the PDF."""
    (folder / "one.svg").write_text(svg, encoding="utf-8")
    source = '#set page(width: auto, height: auto, margin: 0pt, fill: white)\n#image("/one.svg")'
    png = compiler_of(source.encode(), folder).compile(format="png", ppi=150)
    assert isinstance(png, bytes)
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=float)


@pytest.mark.parametrize("name", ["few.svg", "people.svg"])
def test_with_fewer_characters_a_figure_looks_as_it_was_drawn(name: str, folder: Path, tmp_path: Path) -> None:
    """No coordinate moves by more than rounding; an edge of a pixel may then cross one of its four samples (64 of 255).

    Two edges may meet in a pixel. A mark that lost its fill or its place would change whole pixels by more.
    """
    if name == "people.svg":
        wide = pd.DataFrame(np.random.default_rng(2).gamma(3.0, size=(12, 3)), columns=["a", "b", "c"])
        save(figures.paired(wide, "completion_time_s"), folder / name)
    whole = (folder / name).read_text(encoding="utf-8")
    before, after = drawn(whole, tmp_path), drawn(compact(whole), tmp_path)
    assert before.shape == after.shape
    assert np.ptp(before) > 200
    assert np.abs(before - after).max() <= 2 * 64
    ways, small = (re.findall(r' d="([^"]*)"', text) for text in (whole, compact(whole)))
    assert len(ways) == len(small)
    for one, other in zip(ways, small, strict=True):
        places = [[float(number) for number in re.findall(r"-?[\d.]+", way)] for way in (one, other)]
        assert places[1] == pytest.approx(places[0], abs=0.0051)
        assert re.sub(r"[-\d.\s]", "", one) == re.sub(r"[-\d.\s]", "", other)  # the same lines and curves


def test_the_largest_become_pixels_and_no_more_than_need_be(folder: Path) -> None:
    whole = size(pictures(folder, NAMES))
    found = pictures(folder, NAMES, whole - 1)
    assert [name for name, picture in found.items() if picture.is_pixels] == ["more.svg"]
    assert size(found) < whole
    assert size(pictures(folder, NAMES, 0)) <= size(found)


def test_pixels_show_what_was_drawn(folder: Path) -> None:
    url = pictures(folder, ["more.svg"], 0)["more.svg"].url
    image = Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGB")
    pixels = np.asarray(image, dtype=float)
    assert image.width > 900
    red = (np.abs(pixels - (0xB0, 0, 0)).max(axis=2) < 24).mean()
    white = (pixels.min(axis=2) > 240).mean()
    assert red > 0.05
    assert white > 0.2


def test_the_same_figures_give_the_same_page(folder: Path) -> None:
    assert pictures(folder, NAMES, 0) == pictures(folder, NAMES, 0)
