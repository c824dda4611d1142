"""Figures of a page as they were drawn, and as pixels where there are too many of them."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from PIL import Image

from pipeline.report.document.pictures import Picture, pictures
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
        assert unquote(svg) == (folder / name).read_text(encoding="utf-8")
        assert not set('"<>#') & set(svg)  # they would end the attribute or the URL


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
