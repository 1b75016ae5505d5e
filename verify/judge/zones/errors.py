"""What is wrong with a zone."""

from __future__ import annotations


class ZoneError(ValueError):
    """A scenario's zone is none that could be judged."""
