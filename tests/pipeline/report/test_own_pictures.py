"""A study's own pictures: in page and print, small, and without what a camera notes beside them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pypdf import PdfReader

from tests.pipeline.helpers import Steadyhand

pytestmark = pytest.mark.usefixtures("blank_figures")
PLACE = "51.5 North"


@cache
def photograph() -> Image.Image:
    """A picture of noise that is larger than a report shows one."""
    pixels = np.random.default_rng(1).integers(0, 255, (90, 120, 3), dtype=np.uint8)
    return Image.fromarray(pixels).resize((2000, 1500))


def study(folder: Path, entry: str = "file: pictures/setup.jpg, alt: A hand, caption: Look at the hand.") -> Path:
    (folder / "pictures").mkdir(parents=True)
    rows = "".join(f"P{p},{c},m,{p + 0.5 * p * (c == 'b')}\n" for p in range(1, 7) for c in "ab")
    (folder / "measures.csv").write_text(f"participant,condition,measure,value\n{rows}", encoding="utf-8")
    text = f"conditions: [a, b]\nmeasures: measures.csv\npictures:\n  - {{{entry}}}\n"
    (folder / "study.yaml").write_text(text, encoding="utf-8")
    exif = Image.Exif()
    exif[0x010E], exif[0x0112] = PLACE, 6  # a description, and that the camera was held on its side
    photograph().save(folder / "pictures" / "setup.jpg", exif=exif)
    photograph().resize((40, 30)).save(folder / "pictures" / "sketch.png")
    (folder / "pictures" / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n and no more")
    return folder


def test_a_photograph_is_shown_small_upright_and_without_its_place(tmp_path: Path, steadyhand: Steadyhand) -> None:
    ran = steadyhand("report", study(tmp_path / "study"))
    assert ran.code == 0, ran.err
    written = steadyhand.out / "figures" / "picture-1.jpg"
    with Image.open(written) as image:
        assert image.size == (1200, 1600)
    assert PLACE.encode() not in written.read_bytes()
    page = (steadyhand.out / "report.html").read_text(encoding="utf-8")
    assert 'alt="A hand"' in page
    assert "Look at the hand." in page
    assert page.count("data:image/jpeg;base64,") == 1
    pages = PdfReader(steadyhand.out / "report.pdf").pages
    assert any("Look at the hand." in page.extract_text() for page in pages)
    assert any(len(page.images) for page in pages)


@pytest.mark.usefixtures("blank_print")
def test_a_drawing_stays_one(tmp_path: Path, steadyhand: Steadyhand) -> None:
    entry = "file: pictures/sketch.png, alt: A sketch, caption: Look."
    assert steadyhand("report", study(tmp_path / "study", entry)).code == 0
    with Image.open(steadyhand.out / "figures" / "picture-1.png") as image:
        assert image.size == (40, 30)


@pytest.mark.usefixtures("blank_print")
def test_another_picture_is_another_report(tmp_path: Path, steadyhand: Steadyhand) -> None:
    folder = study(tmp_path / "study")
    assert steadyhand("report", folder, "--format", "html").code == 0
    before = (steadyhand.out / "report.html").read_bytes()
    Image.new("RGB", (60, 40), "red").save(folder / "pictures" / "setup.jpg")
    assert steadyhand("report", folder, "--format", "html").code == 0
    assert (steadyhand.out / "report.html").read_bytes() != before


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("file: pictures/none.png, alt: A, caption: B", 'there is no file "pictures/none.png" in the study folder'),
        ("file: ../outside.png, alt: A, caption: B", '"../outside.png" is outside the study folder'),
        ("file: measures.csv, alt: A, caption: B", '"measures.csv" should be a PNG or JPEG'),
        ("file: pictures/sketch.png, caption: B", '"pictures.0.alt" is missing'),
        ("file: pictures/broken.png, alt: A, caption: B", "pictures: cannot be read as a PNG or JPEG"),
    ],
)
def test_a_picture_that_cannot_be_shown_is_an_error(
    tmp_path: Path, steadyhand: Steadyhand, entry: str, said: str
) -> None:
    ran = steadyhand("report", study(tmp_path / "study", entry))
    assert ran.code == 2
    assert said in ran.err
