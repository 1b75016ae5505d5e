"""What a fault of ours, or memory running out, is raised as."""

from __future__ import annotations

from shapely.errors import ShapelyError

# Neither interruptions, nor files that cannot be read or written.
DEFECTS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    ImportError,
    LookupError,
    MemoryError,
    NameError,
    RuntimeError,
    ShapelyError,
    TypeError,
    ValueError,
)
