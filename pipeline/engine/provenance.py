"""What a report says about how it was made."""

PROVENANCE = "provenance.json"
"""The file beside results.json that says how they were made."""
LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "pandas",
    "pyarrow",
    "pydantic",
    "mcap",
    "mcap_protobuf",
    "orjson",
    "matplotlib",
    "jinja2",
    "typst",
    "vqf",
)
"""The libraries whose versions every report names, by import name."""
OF_STATISTICS = ("pingouin", "statsmodels")
"""Those that a report names where they computed something of it."""
