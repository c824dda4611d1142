"""From pictures of a marker to its position, the lens between them, and the page that the marker is printed on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from pypdf import PdfReader
from pypdf.generic import ContentStream
from scipy.spatial.transform import Rotation

from pipeline.errors import PipelineError
from pipeline.live import printed_marker
from pipeline.live.lens import Lens, of_calibration, of_field_of_view
from pipeline.live.marker import finder, markers, position_mm, refined
from pipeline.statistics.arrays import FloatArray
from tests.pipeline.helpers import exit_code
from tests.pipeline.live.frames import FACING, corners_px, frame

SIZE = (1280, 720)
LENS = of_field_of_view(65.0, SIZE)
MM_PER_PT = 25.4 / 72


@dataclass(frozen=True)
class Seen:
    """Of every marker in pictures that was found: errors (n, 3) in mm, of ours and with OpenCV's own corners."""

    shown: int
    ours: FloatArray
    opencv: FloatArray


@pytest.fixture(scope="module")
def seen() -> Seen:
    """200 views of a 50 mm marker, 1.5 m away, in the middle two thirds, tilted by up to 23° about each axis.

    A picture has four, as far apart across as can be, so that none hides another; each may be anywhere.
    """
    random, finds = np.random.default_rng(1), finder()
    ours, opencv = [], []
    for _ in range(50):
        across = -550 + (random.uniform(0, 1100) + np.arange(4) * 275) % 1100
        places = {
            int(number): (np.array([x, random.uniform(-280, 280), 1500.0]), random.uniform(-0.4, 0.4, 3))
            for number, x in zip(random.choice(50, 4, replace=False), across, strict=True)
        }
        shown = {number: (place, Rotation.from_rotvec(turn) * FACING) for number, (place, turn) in places.items()}
        grey = frame(SIZE, LENS, shown, random)
        for number, every in markers(finds, grey).items():
            for corners in every:
                found = position_mm(grey, corners, 50.0, LENS)
                assert found is not None
                ours.append(np.array(found) - places[number][0])
                opencv.append(_by_opencv(grey, corners) - places[number][0])
    return Seen(200, np.array(ours), np.array(opencv))


def _by_opencv(grey: np.ndarray, corners: FloatArray) -> FloatArray:
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.1)
    own = cv2.cornerSubPix(grey, corners.astype(np.float32), (3, 3), (-1, -1), stop)
    square = 25.0 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    _, _, place = cv2.solvePnP(square, own, LENS.matrix, np.zeros(4), flags=cv2.SOLVEPNP_IPPE_SQUARE)
    return np.ravel(place).astype(np.float64)


def test_a_marker_is_found_to_3_mm_at_one_and_a_half_metres(seen: Seen) -> None:
    assert len(seen.ours) >= 0.98 * seen.shown
    sd = seen.ours.std(axis=0)
    assert sd[:2].max() <= 3.0
    assert sd[2] <= 12.0  # along the line of sight 33 pixels say less
    assert np.linalg.norm(seen.ours, axis=1).max() <= 50.0


def test_edges_tell_more_than_opencv_s_corners(seen: Seen) -> None:
    def rms(errors: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(np.mean(errors**2, axis=0)))

    assert (rms(seen.ours) < rms(seen.opencv) / 4).all()
    assert abs(seen.ours[:, 2].mean()) < 3.0 < abs(seen.opencv[:, 2].mean())  # blur does not move what is ours


@pytest.mark.parametrize("distance_mm", [250.0, 600.0, 1000.0, 1500.0])
@pytest.mark.parametrize("blur_px", [0.5, 1.0])
def test_corners_are_where_they_were_drawn(distance_mm: float, blur_px: float) -> None:
    random, finds = np.random.default_rng(int(distance_mm)), finder()
    place, attitude = np.array([30.0, -20.0, distance_mm]), Rotation.from_rotvec([0.3, -0.2, 0.5]) * FACING
    grey = frame(SIZE, LENS, {7: (place, attitude)}, random, blur_px=blur_px, noise=0.0)
    [corners] = markers(finds, grey)[7]
    off = refined(grey, corners) - corners_px(place, attitude, LENS, 50.0)
    assert np.abs(off).max() < 0.1


def test_markers_are_told_apart_by_number_and_a_number_may_be_seen_twice() -> None:
    places = {3: (-200.0, 0.0, 900.0), 7: (150.0, 80.0, 900.0)}
    shown = {number: (np.array(place), FACING) for number, place in places.items()}
    grey = frame(SIZE, LENS, shown, np.random.default_rng(2))
    found = markers(finder(), grey)
    assert sorted(found) == [3, 7]
    for number, place in places.items():
        position = position_mm(grey, found[number][0], 50.0, LENS)
        assert position is not None
        assert position[:2] == pytest.approx(place[:2], abs=2.0)
        assert position[2] == pytest.approx(place[2], abs=10.0)
    twice = np.vstack([grey[360:], grey[360:]])
    assert len(markers(finder(), twice)[7]) == 2


def test_an_empty_or_a_dark_picture_has_no_marker() -> None:
    assert markers(finder(), np.zeros((720, 1280), np.uint8)) == {}
    noise = np.random.default_rng(3).integers(0, 255, (720, 1280), dtype=np.uint8)
    assert 7 not in markers(finder(), noise)


def test_four_corners_of_no_square_are_no_reading() -> None:
    grey = np.full((720, 1280), 120, np.uint8)
    assert position_mm(grey, np.array([[600.0, 300], [700, 330], [620, 400], [640, 380]]), 50.0, LENS) is None


def test_a_wrong_field_of_view_is_wrong_in_depth_alone() -> None:
    """What docs/live.md says: z is off by the factor, movements along the picture are not."""
    place, random = np.array([200.0, -100.0, 1000.0]), np.random.default_rng(4)
    grey = frame(SIZE, LENS, {7: (place, FACING)}, random, noise=0.0)
    [corners] = markers(finder(), grey)[7]
    wider = position_mm(grey, corners, 50.0, of_field_of_view(70.0, SIZE))
    factor = np.tan(np.radians(65.0 / 2)) / np.tan(np.radians(70.0 / 2))
    assert wider == pytest.approx([200.0, -100.0, 1000.0 * factor], rel=0.01)
    larger = position_mm(grey, corners, 55.0, LENS)
    assert larger == pytest.approx(place * 1.1, rel=0.01)


# --- the lens

ROS = """image_width: 640
image_height: 360
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [500.0, 0.0, 320.5, 0.0, 502.0, 181.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 0.001, 0.002, 0.0]
"""


def test_a_calibration_of_ros_is_scaled_to_the_camera_s_size(tmp_path: Path) -> None:
    """http://wiki.ros.org/camera_calibration_parsers; a pixel's middle is a whole number, as OpenCV has it."""
    (tmp_path / "camera.yaml").write_text(ROS, encoding="utf-8")
    lens = of_calibration(tmp_path / "camera.yaml", (1280, 720))
    assert lens == Lens((1000.0, 1004.0), (641.5, 363.5), (0.1, -0.2, 0.001, 0.002, 0.0))


def test_a_calibration_that_opencv_has_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "camera.yml"
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("image_width", 1280)
    file.write("image_height", 720)
    file.write("camera_matrix", LENS.matrix)
    file.write("distortion_coefficients", np.array([[0.1, -0.2, 0.0, 0.0, 0.05]]))
    file.release()
    lens = of_calibration(path, SIZE)
    assert lens.matrix == pytest.approx(LENS.matrix)
    assert lens.distortion == pytest.approx((0.1, -0.2, 0.0, 0.0, 0.05))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("image_width: 640", "image_width: 480"), "is of pictures of 480 × 360, and the camera gives 1280 × 720"),
        (("image_width: 640", "width: 640"), "image_width: should be a number of pixels, found None"),
        (("[500.0, 0.0,", "[-500.0, 0.0,"), "camera_matrix: should be 3 × 3 with positive focal lengths"),
        (("camera_matrix:", "matrix:"), "camera_matrix: should have `data`, a list of finite numbers"),
        (("[0.1, -0.2,", "[.nan, -0.2,"), "distortion_coefficients: should have `data`, a list of finite numbers"),
        (("[0.1, -0.2,", "[0.1, -0.2, 0.3,"), "distortion_coefficients: has 6; a lens has 4, 5, 8, 12, 14"),
        ((ROS, "{"), "is no calibration in YAML"),
    ],
)
def test_what_is_wrong_with_a_calibration_is_said(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(ROS.replace(*change), encoding="utf-8")
    with pytest.raises(PipelineError, match=r"camera\.yaml") as refused:
        of_calibration(path, SIZE)
    assert said in str(refused.value)


def test_a_calibration_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match=r"none\.yaml: the camera's calibration cannot be read: No such file"):
        of_calibration(tmp_path / "none.yaml", SIZE)


# --- the page to print


def test_the_dictionary_is_opencv_s() -> None:
    known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    assert len(known.bytesList) == printed_marker.COUNT
    for number in range(printed_marker.COUNT):
        theirs = cv2.aruco.generateImageMarker(known, number, printed_marker.CELLS) == 0
        assert (np.array(printed_marker.cells(number)) == theirs).all(), number


@dataclass(frozen=True)
class Page:
    """What stands on a page as vectors, in mm from its left and lower edge: filled shapes, and lines (2, 2)."""

    size_mm: tuple[float, float]
    filled: list[FloatArray]
    lines: list[FloatArray]


def page_of(path: Path) -> Page:
    """The one page of a PDF."""
    reader = PdfReader(path)
    [page] = reader.pages
    content = page.get_contents()
    assert content is not None
    turns, shapes = [np.eye(3)], list[list[FloatArray]]()
    filled, lines = list[FloatArray](), list[FloatArray]()
    for operands, operator in ContentStream(content, reader).operations:
        figures = [float(one) for one in operands] if operator in (b"cm", b"m", b"l") else []
        if operator == b"q":
            turns.append(turns[-1])
        elif operator == b"Q":
            turns.pop()
        elif operator == b"cm":
            a, b, c, d, e, f = figures
            turns[-1] = turns[-1] @ np.array([[a, c, e], [b, d, f], [0, 0, 1]])
        elif operator in (b"m", b"l"):
            at = (turns[-1] @ [*figures, 1.0])[:2] * MM_PER_PT
            shapes = [*shapes, [at]] if operator == b"m" else [*shapes[:-1], [*shapes[-1], at]]
        elif operator in (b"f", b"S"):
            (filled if operator == b"f" else lines).extend(map(np.array, shapes))
            shapes = []
    width, height = float(page.mediabox.width), float(page.mediabox.height)
    return Page((width * MM_PER_PT, height * MM_PER_PT), filled, lines)


@pytest.mark.parametrize(("number", "size_mm"), [(7, 50.0), (0, 10.0), (49, 120.0), (23, 83.5)])
def test_the_printed_marker_has_its_size_and_opencv_reads_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, number: int, size_mm: float
) -> None:
    path = tmp_path / "marker.pdf"
    assert exit_code(monkeypatch, "marker", "--id", str(number), "--size-mm", str(size_mm), "--out", path) == 0
    page = page_of(path)
    assert page.size_mm == pytest.approx((210.0, 297.0), abs=0.01)
    corners = np.concatenate(page.filled)
    assert np.ptp(corners, axis=0) == pytest.approx(size_mm, abs=0.01)
    [longest] = {round(float(np.ptp(line, axis=0).max()), 2) for line in page.lines if len(line) == 2 and is_flat(line)}
    assert longest == 100.0

    px_per_mm = 6.0
    picture = np.full((round(297 * px_per_mm), round(210 * px_per_mm)), 255, np.uint8)
    for shape in page.filled:
        cv2.fillPoly(picture, [np.round(shape * px_per_mm).astype(np.int32)], (0,))
    [seen] = markers(finder(), picture[::-1]).items()
    assert seen[0] == number
    assert np.ptp(seen[1][0], axis=0) / px_per_mm == pytest.approx(size_mm, abs=0.5)


def is_flat(line: FloatArray) -> bool:
    """Whether it runs across the page."""
    return bool(np.ptp(line[:, 1]) < 0.01)


def test_the_page_says_what_to_do_and_equal_pages_are_equal_bytes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.pdf", "b.pdf"):
        assert exit_code(monkeypatch, "marker", "--out", tmp_path / name) == 0
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()
    text = PdfReader(tmp_path / "a.pdf").pages[0].extract_text()
    for words in ("Marker 7, 50 mm", "at 100 %", "white border, 12.5 mm", "cardboard", "marker_mm: 50"):
        assert words in text
    assert "its ruler is 100 mm long" in capsys.readouterr().out


@pytest.mark.parametrize(
    "option", [("--id", "50"), ("--id", "-1"), ("--size-mm", "200"), ("--size-mm", "9"), ("--size-mm", "nan")]
)
def test_there_are_50_markers_that_fit_a_page(
    monkeypatch: pytest.MonkeyPatch, option: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert exit_code(monkeypatch, "marker", *option) == 2
    assert option[0] in capsys.readouterr().err
