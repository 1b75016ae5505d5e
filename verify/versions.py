"""What a result was made with."""

from __future__ import annotations

import platform
from importlib import metadata

_PACKAGES = {
    "vnav_drake": "vnav-drake",
    "drake": "drake",
    "numpy": "numpy",
    "scipy": "scipy",
    "shapely": "shapely",
}


def versions() -> dict[str, str]:
    """Version of each package that takes part, and of Python; what is not installed is absent."""
    found = {}
    for name, package in _PACKAGES.items():
        try:
            found[name] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found | {
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
    }
