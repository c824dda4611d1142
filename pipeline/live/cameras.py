"""Which cameras a study has, and which stream is of which of their markers."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import PipelineError
from pipeline.live.adapters.feeds import feed
from pipeline.live.lens import USUAL_FIELD_OF_VIEW_DEG, Lens, of_calibration, of_field_of_view
from pipeline.live.setup import Setup
from pipeline.study.recording import Camera

if TYPE_CHECKING:
    from pipeline.live.adapters.camera import Webcam

_NS_PER_MS = 1e6
_OF_DEVICE = ("size", "field_of_view_deg", "calibration", "late_ms")


def check(setup: Setup, where: str) -> None:
    """Raise PipelineError, beginning with `where`, for a camera that can never feed its stream."""
    devices: dict[int, tuple[str, Camera]] = {}
    for name, camera in _cameras(setup).items():
        here = f"{where}: recording: senders.{name}"
        if find_spec("cv2") is None:
            raise PipelineError(f'{here}: a camera needs a further package: pip install "steadyhand[camera]"')
        if setup.streams[name].content != "position":
            raise PipelineError(f"{here}: a camera sees positions, and {name} is of kind acceleration")
        if setup.recording.senders[name].unit:
            raise PipelineError(f"{here}: unit: a camera measures in marker_mm's own millimetres; remove it")
        other, known = devices.setdefault(camera.device, (name, camera))
        differing = [key for key in _OF_DEVICE if getattr(known, key) != getattr(camera, key)]
        if differing:
            raise PipelineError(f"{here}: camera {camera.device} has other {', '.join(differing)} for {other}")
        if other != name and camera.marker == known.marker:
            raise PipelineError(f"{here}: marker {camera.marker} is that of {other}; print another by --id")
        _lens(camera, Path(where).parent)


def webcams(setup: Setup, folder: Path, happens: Callable[[Any], None], now_ns: Callable[[], int]) -> list[Webcam]:
    """The cameras, not yet opened; one may see the markers of several streams."""
    cameras = _cameras(setup)
    if not cameras:
        return []
    from pipeline.live.adapters.camera import Wanted, Webcam
    from pipeline.live.adapters.camera_device import Device

    found = []
    for device in sorted({camera.device for camera in cameras.values()}):
        of_device = {name: camera for name, camera in cameras.items() if camera.device == device}
        first = next(iter(of_device.values()))
        wanted = [Wanted(feed(setup, name), one.marker, one.marker_mm) for name, one in of_device.items()]
        opened = Device(device, first.size, _lens(first, folder), round(first.late_ms * _NS_PER_MS))
        found.append(Webcam(opened, wanted, happens, now_ns))
    return found


def _cameras(setup: Setup) -> dict[str, Camera]:
    senders = setup.recording.senders
    return {name: sender.camera for name, sender in senders.items() if sender.camera is not None}


def _lens(camera: Camera, folder: Path) -> Lens:
    if camera.calibration is not None:
        return of_calibration(folder / camera.calibration, camera.size)
    return of_field_of_view(camera.field_of_view_deg or USUAL_FIELD_OF_VIEW_DEG, camera.size)
