"""What is wrong with a braking zone, or with the plugin that brings it."""

from __future__ import annotations


class ZoneError(ValueError):
    """A zone that cannot be; `key` names the parameter, such as `fields[1].polygon`, or is empty."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(f"{key}: {message}" if key else message)
        self.key, self.message = key, message


class PluginError(ValueError):
    """A module or entry point that brings no braking zone; the message names it and says why."""
