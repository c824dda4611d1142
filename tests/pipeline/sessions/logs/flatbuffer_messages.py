"""Foxglove's messages as flatbuffers, built by the package `flatbuffers` and Foxglove's own schemas, in stock logs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any

from flatbuffers import Builder
from mcap.writer import Writer

MakeTable = Callable[[Builder], int]


def generated(name: str) -> Any:
    """The module that flatc made for a table or struct."""
    return import_module(f"foxglove_schemas_flatbuffer.{name}")


def get_schema(name: str) -> bytes:
    """The binary schema of a type (the package's own function is deprecated)."""
    return files("foxglove_schemas_flatbuffer").joinpath(f"{name}.bfbs").read_bytes()


def table(builder: Builder, name: str, **fields: Any) -> int:
    """A table. Fields are numbers, references to what was built before, texts, or a time in ns."""
    module = generated(name)
    built = {key: builder.CreateString(value) if isinstance(value, str) else value for key, value in fields.items()}
    module.Start(builder)
    for key, value in built.items():
        if key == "Timestamp":
            value = generated("Time").CreateTime(builder, *divmod(value, 10**9))  # noqa: PLW2901
        getattr(module, f"Add{key}")(builder, value)
    end: int = module.End(builder)
    return end


def vector_of(builder: Builder, references: Sequence[int]) -> int:
    """A vector of tables."""
    builder.StartVector(4, len(references), 4)
    for one in reversed(references):
        builder.PrependUOffsetTRelative(one)
    end: int = builder.EndVector()
    return end


def point(builder: Builder, place: Sequence[float], name: str = "Point3") -> int:
    return table(builder, name, **dict(zip("XYZ", map(float, place), strict=True)))


def pose(builder: Builder, place: Sequence[float]) -> int:
    position = point(builder, place, "Vector3")
    turn = table(builder, "Quaternion", X=0.0, Y=0.6, Z=0.0, W=0.8)
    return table(builder, "Pose", Position=position, Orientation=turn)


def transform(builder: Builder, stamp_ns: int, place: Sequence[float], child: str = "hand") -> int:
    return table(
        builder,
        "FrameTransform",
        Translation=point(builder, place, "Vector3"),
        Timestamp=stamp_ns,
        ParentFrameId="room",
        ChildFrameId=child,
    )


def message(name: str, stamp_ns: int, place: Sequence[float], frame: str = "room") -> bytes:
    """A message of one of `POSITIONS` at a place; others in it are at (9, 9, 9)."""
    builder = Builder(0)
    if name == "Point3InFrame":
        root = table(builder, name, Point=point(builder, place), Timestamp=stamp_ns, FrameId=frame)
    elif name == "PoseInFrame":
        root = table(builder, name, Pose=pose(builder, place), Timestamp=stamp_ns, FrameId=frame)
    elif name == "PosesInFrame":
        poses = vector_of(builder, [pose(builder, (9, 9, 9)), pose(builder, place)])
        root = table(builder, name, Poses=poses, Timestamp=stamp_ns, FrameId=frame)
    elif name == "FrameTransform":
        root = transform(builder, stamp_ns, place)
    else:
        each = [transform(builder, stamp_ns, (9, 9, 9), "head"), transform(builder, stamp_ns, place)]
        root = table(builder, name, Transforms=vector_of(builder, each))
    builder.Finish(root)
    return bytes(builder.Output())


POSITIONS = ("Point3InFrame", "PoseInFrame", "PosesInFrame", "FrameTransform", "FrameTransforms")


def write_log(path: Path, name: str, payloads: Iterable[bytes], schema: bytes | None = None) -> Path:
    """A log with messages of a type on /t, received at 0, 1000, … ns."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        data = get_schema(name) if schema is None else schema
        number = writer.register_schema(f"foxglove.{name}", "flatbuffer", data)
        channel = writer.register_channel("/t", "flatbuffer", number)
        for index, payload in enumerate(payloads):
            writer.add_message(channel, index * 1000, payload, index * 1000)
        writer.finish()  # type: ignore[no-untyped-call]
    return path
