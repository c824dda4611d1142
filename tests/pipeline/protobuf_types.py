"""Protobuf messages of positions and accelerations, described here: Foxglove's, and ROS types in protobuf."""

from __future__ import annotations

from typing import Any

from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from mcap_protobuf.schema import build_file_descriptor_set

Types = dict[str, dict[str, str]]

_XYZ = dict.fromkeys("xyz", "double")
FOXGLOVE: Types = {
    "google.protobuf.Timestamp": {"seconds": "int64", "nanos": "int32"},
    "foxglove.Point3": _XYZ,
    "foxglove.Vector3": _XYZ,
    "foxglove.Quaternion": {**_XYZ, "w": "double"},
    "foxglove.Pose": {"position": "foxglove.Vector3", "orientation": "foxglove.Quaternion"},
    "foxglove.Point3InFrame": {
        "timestamp": "google.protobuf.Timestamp",
        "frame_id": "string",
        "point": "foxglove.Point3",
    },
    "foxglove.PoseInFrame": {"timestamp": "google.protobuf.Timestamp", "frame_id": "string", "pose": "foxglove.Pose"},
}
ROS: Types = {
    "builtin_interfaces.Time": {"sec": "int32", "nanosec": "uint32"},
    "std_msgs.Header": {"stamp": "builtin_interfaces.Time", "frame_id": "string"},
    "geometry_msgs.Point": _XYZ,
    "geometry_msgs.Vector3": _XYZ,
    "geometry_msgs.Quaternion": {**_XYZ, "w": "double"},
    "geometry_msgs.PointStamped": {"header": "std_msgs.Header", "point": "geometry_msgs.Point"},
    "sensor_msgs.Imu": {
        "header": "std_msgs.Header",
        "orientation": "geometry_msgs.Quaternion",
        "orientation_covariance": "repeated double",
        "angular_velocity": "geometry_msgs.Vector3",
        "angular_velocity_covariance": "repeated double",
        "linear_acceleration": "geometry_msgs.Vector3",
        "linear_acceleration_covariance": "repeated double",
    },
}


def message_class(name: str, types: Types) -> Any:
    """The class of a message, its fields numbered from 1 in the order they are named in."""
    pool = DescriptorPool()
    files: dict[str, FileDescriptorProto] = {}
    for full, fields in types.items():
        package, _, short = full.rpartition(".")
        file = files.setdefault(full, FileDescriptorProto(name=f"{full}.proto", package=package, syntax="proto3"))
        message = file.message_type.add(name=short)
        for number, (field, said) in enumerate(fields.items(), 1):
            kind = said.removeprefix("repeated ")
            label = FieldDescriptorProto.LABEL_OPTIONAL if kind == said else FieldDescriptorProto.LABEL_REPEATED
            added = message.field.add(name=field, number=number, label=label)
            if kind in types:
                added.type, added.type_name = FieldDescriptorProto.TYPE_MESSAGE, f".{kind}"
                if f"{kind}.proto" not in file.dependency:
                    file.dependency.append(f"{kind}.proto")
            else:
                added.type = getattr(FieldDescriptorProto, f"TYPE_{kind.upper()}")
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(name))


def changed(types: Types, name: str, **fields: str) -> Types:
    """With other types of some of a message's fields."""
    return {**types, name: {**types[name], **fields}}


def schema_of(kind: Any) -> bytes:
    """A class's descriptor and those it needs, as a log holds them."""
    return bytes(build_file_descriptor_set(kind).SerializeToString())
