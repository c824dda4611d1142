"""What a report says of its own making."""

LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "pandas",
    "pyarrow",
    "pydantic",
    "mcap",
    "mcap_ros2",
    "mcap_protobuf",
    "orjson",
    "matplotlib",
    "jinja2",
    "typst",
    "vqf",
)
"""The libraries whose versions a report names, by import name."""
