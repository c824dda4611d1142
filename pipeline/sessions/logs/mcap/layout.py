"""Which fields of a message a stream reads, whatever the message's type and encoding: found by their names.

A type is known by the paths of its figures and texts alone, ("pose", "position", "x"), say. `EACH` stands for every
element of an array: ("transforms", EACH, "child_frame_id") are the names of all transforms in one message.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

from pipeline.sessions.logs.log import Source

Kind = Literal["number", "text"]
Step = str | int
Path = tuple[Step, ...]
NamePath = tuple[str, ...]

EACH = "*"
LEAVES_LIMIT = 2000

STAMPS: Sequence[NamePath] = (("header", "stamp"), ("timestamp",), ("stamp",))
SECONDS: Sequence[str] = ("sec", "seconds", "secs")
NANOSECONDS: Sequence[str] = ("nanosec", "nsec", "nanos", "nsecs")
FORCE, RATE, TURN, COVARIANCE = "linear_acceleration", "angular_velocity", "orientation", "orientation_covariance"
_PARENTS: Sequence[Path] = (("parent_frame_id",), ("header", "frame_id"), ("frame_id",))
_CHILDREN: Sequence[Path] = (("child_frame_id",),)

# Named as in ROS (PointStamped, PoseStamped, PoseWithCovarianceStamped and Odometry, TransformStamped, Vector3Stamped)
# or in Foxglove's schemas (Point3InFrame, PoseInFrame, FrameTransform).
VECTORS: Mapping[str, Sequence[NamePath]] = {
    "position": (
        ("point",),
        ("pose", "position"),
        ("pose", "pose", "position"),
        ("transform", "translation"),
        ("translation",),
        ("vector",),
        ("position",),
    ),
    "velocity": (("point",), ("vector",), ("twist", "linear"), ("velocity",)),
    "acceleration": ((FORCE,), ("accel", "linear"), ("vector",), ("acceleration",)),
    "angular_velocity": ((RATE,),),
    "orientation": ((TURN,),),
}
"""Where a vector may stand; the first that a message has is taken."""

_NEEDED = {
    "position": "geometry_msgs/msg/PointStamped",
    "velocity": "geometry_msgs/msg/PointStamped",
    "acceleration": "sensor_msgs/msg/Imu",
}
_INDEX = re.compile(r"([^\[\]]+)|\[(\d+)\]")


def within_limit(fields: Iterable[tuple[Path, Kind]]) -> dict[Path, Kind]:
    """The path and kind of every figure and text. ValueError where there are more than any sensor's message has."""
    found: dict[Path, Kind] = {}
    for path, kind in fields:
        found[path] = kind
        if len(found) > LEAVES_LIMIT:
            raise ValueError(f"its schema describes more than {LEAVES_LIMIT} fields, which no sensor's message has")
    return found


@dataclass(frozen=True)
class Layout:
    """The paths of a stream's fields.

    `stamp` is () for messages without one, else one number or seconds and nanoseconds. A figure is None where messages
    do not have it: its value is then 0, and an orientation of zeros is an unknown one. `child` and `parent` are the
    paths of frames' names, None where there are none.
    """

    stamp: tuple[Path, ...]
    figures: tuple[Path | None, ...]
    child: Path | None = None
    parent: Path | None = None

    @property
    def turns(self) -> bool:
        """Whether an acceleration comes with an angular velocity."""
        return len(self.figures) > 3 and self.figures[3] is not None


def find_layout(leaves: Mapping[Path, Kind], type_name: str, content: str, source: Source) -> Layout:
    """Where messages of a type, given by the paths in it, hold what a stream reads. ValueError where they do not."""
    fields = _Fields(leaves, type_name, source)
    for prefix in fields.prefixes():
        first = fields.vector(content, prefix, "xyz")
        if first is not None:
            return fields.layout(content, prefix, first)
    tried = ", ".join(".".join(map(str, path)) for path in VECTORS[content])
    raise ValueError(
        f"it holds {type_name}, and a stream of kind {content} needs {_NEEDED[content]}, or another type with one of "
        f"{tried}; `fields:` says where it stands in any other"
    )


def path_of(text: str) -> Path:
    """A path as it is written in study.yaml: `transforms[0].translation.x`."""
    return tuple(
        name if name else int(index)
        for part in text.split(".")
        for name, index in _INDEX.findall(part)
        if name or index
    )


@dataclass(frozen=True)
class _Fields:
    leaves: Mapping[Path, Kind]
    type_name: str
    source: Source

    def prefixes(self) -> Iterator[Path]:
        """Where the fields may begin: the message itself, or each element of an array of its messages."""
        yield ()
        if not self.source.fields:
            for path in self.leaves:
                if len(path) > 2 and path[1] == EACH and path[2:] in _CHILDREN:
                    yield path[:2]

    def layout(self, content: str, prefix: Path, first: tuple[Path, ...]) -> Layout:
        figures: list[Path | None] = list(first)
        if content == "acceleration":
            rate, turn = (
                self.vector(name, prefix, axes) for name, axes in (("angular_velocity", "xyz"), ("orientation", "xyzw"))
            )
            figures += [*(rate or [None] * 3), *(turn or [None] * 4)]
            has_covariance = turn is not None and (COVARIANCE, EACH) in self.leaves
            figures.append((COVARIANCE, 0) if has_covariance else None)
        stamp = () if self.source.unstamped else self._stamp(prefix)
        child, parent = (self._text(prefix, names) for names in (_CHILDREN, _PARENTS))
        for key, name, path in (("child", self.source.child, child), ("parent", self.source.parent, parent)):
            if name is not None and path is None:
                raise ValueError(
                    f"it holds {self.type_name}, which has no name of a frame to compare `{key}: {name}` with"
                )
        return Layout(stamp, tuple(figures), child, parent)

    def vector(self, name: str, prefix: Path, axes: str) -> tuple[Path, ...] | None:
        """The paths of a vector's figures; None where there is none. ValueError where study.yaml names a wrong one."""
        stated = self.source.fields.get(name)
        if stated is not None:
            return self._stated(name, stated, axes)
        for path in VECTORS[name]:
            figures = tuple((*prefix, *path, axis) for axis in axes)
            if all(self.leaves.get(figure) == "number" for figure in figures):
                return figures
        bare = tuple((axis,) for axis in axes)  # geometry_msgs/Point, or {"x": …, "y": …, "z": …}
        is_bare = name == "position" and self.leaves.keys() == set(bare)
        return bare if is_bare else None

    def _stated(self, name: str, stated: Sequence[str], axes: str) -> tuple[Path, ...]:
        whole = [path_of(text) for text in stated]
        if len(whole) == 1:
            whole = [(*whole[0], axis) for axis in axes]
        for path in whole:
            if not self._holds_number(path):
                raise ValueError(f"it holds {self.type_name}, which has no number {written(path)} for fields: {name}")
        return tuple(whole)

    def _holds_number(self, path: Path) -> bool:
        return self.leaves.get(tuple(EACH if isinstance(step, int) else step for step in path)) == "number"

    def _stamp(self, prefix: Path) -> tuple[Path, ...]:
        stated = self.source.fields.get("stamp")
        candidates: list[Path] = (
            [(*before, *path) for before in dict.fromkeys((prefix, ())) for path in STAMPS]
            if stated is None
            else [path_of(text) for text in stated]
        )
        if len(candidates) == 2 and all(map(self._holds_number, candidates)):
            return tuple(candidates)
        for path in candidates:
            if stated is not None and self._holds_number(path):
                return (path,)
            for pair in product(SECONDS, NANOSECONDS):
                units = [(*path, name) for name in pair]
                if all(map(self._holds_number, units)):
                    return tuple(units)
        raise ValueError(
            f"it holds {self.type_name}, which has no {' or '.join(map(written, candidates))}; `stamp: log_time` takes "
            "the times at which its messages were recorded"
        )

    def _text(self, prefix: Path, names: Sequence[Path]) -> Path | None:
        paths = ((*prefix, *name) for name in names)
        return next((path for path in paths if self.leaves.get(path) == "text"), None)


def written(path: Path) -> str:
    """A path as it is written in study.yaml."""
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).removeprefix(".")
