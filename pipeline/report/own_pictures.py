"""The study's own pictures: read, made small enough for a page, freed of what a camera notes beside them, and written.

They are written anew from their pixels, so that neither the place where a photograph was taken nor anything else that
a file can hide goes into a report.
"""

from __future__ import annotations

import hashlib
import io
from pathlib import Path

from pipeline.engine.input_files import CHANGED, InputChangedError
from pipeline.engine.stage import Work
from pipeline.errors import PipelineError
from pipeline.report.document.model import Figure
from pipeline.study.pictures import OwnPicture

_LONGEST_PX = 1600  # twice the width of a page's column
_MOST_PIXELS = 100_000_000
_PNG_MOST_BYTES = 400_000  # a larger one is a photograph
_QUALITY = 85


def own_pictures(work: Work) -> tuple[Figure, ...]:
    """Each picture as a figure whose file stands in `figures`; PipelineError for a file that is no such picture."""
    found = []
    for number, picture in enumerate(work.study.pictures, 1):
        content, suffix = _small(work.folder / picture.file, _read(work, picture))
        name = f"picture-{number}{suffix}"
        (work.out / "figures" / name).write_bytes(content)
        found.append(Figure(f"picture-{number}", name, picture.caption, picture.alt))
    return tuple(found)


def _read(work: Work, picture: OwnPicture) -> bytes:
    """The bytes whose digest the report names."""
    path = work.folder / picture.file
    content = path.read_bytes()
    if hashlib.sha256(content).hexdigest() != work.inputs[Path(picture.file).as_posix()]:
        raise InputChangedError(f"{path}: {CHANGED}")
    return content


def _small(path: Path, content: bytes) -> tuple[bytes, str]:
    """The picture's pixels as a file of at most some hundred kilobytes, and its suffix."""
    from PIL import Image, ImageOps, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(content), formats=("PNG", "JPEG")) as opened:
            if opened.width * opened.height > _MOST_PIXELS:
                size = f"{opened.width} × {opened.height} pixels"
                raise PipelineError(
                    f"{path}: pictures: has {size}; save it with at most {_LONGEST_PX} on its longer side"
                )
            drawn = opened.format == "PNG"
            upright = ImageOps.exif_transpose(opened).convert("RGBA")
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise PipelineError(f"{path}: pictures: cannot be read as a PNG or JPEG ({error}); save it anew") from None
    upright.thumbnail((_LONGEST_PX, _LONGEST_PX))
    flat = Image.new("RGB", upright.size, "white")
    flat.paste(upright, mask=upright.getchannel("A"))
    if drawn:
        written = io.BytesIO()
        flat.save(written, "PNG", optimize=True)
        if written.tell() <= _PNG_MOST_BYTES:
            return written.getvalue(), ".png"
    written = io.BytesIO()
    flat.save(written, "JPEG", quality=_QUALITY)
    return written.getvalue(), ".jpg"
