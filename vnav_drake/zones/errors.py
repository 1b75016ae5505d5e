"""What is wrong with a braking zone, with what a file says of one, or with the plugin that brings one."""

from __future__ import annotations


class ZoneError(ValueError):
    """A zone that cannot be; `key` names the parameter, such as `fields[1].polygon`, or is empty."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(f"{key}: {message}" if key else message)
        self.key, self.message = key, message


class ZoneFault(ValueError):  # noqa: N818 - found in a zone, not by the program in itself
    """A zone that breaks the rules of zones; `reasons` lists all that were found."""

    def __init__(self, *reasons: str) -> None:
        super().__init__(*reasons)
        self.reasons = reasons

    def __str__(self) -> str:
        return "; ".join(self.reasons)


class PluginError(ValueError):
    """A module or entry point that brings no braking zone; the message names it and says why."""
