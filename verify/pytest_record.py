"""A scenario runs once in a test session, in whichever process comes first; the others read its record."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from verify.atomic import locked, replace_file
from verify.cases import Case

_RECORD = "record.json"
_BEGUN = "begun"


@dataclass(frozen=True, kw_only=True)
class Record:
    """What a scenario's run showed."""

    name: str  # of the scenario
    headline: str = ""  # its line of output
    report: str = ""  # path of the report
    error: str = ""  # why there is none
    trace: str = ""  # where that came from, if it is not the scenario's fault
    cases: tuple[Case, ...] = ()

    def write(self, file: Path) -> None:
        """As JSON."""
        file.write_text(json.dumps(asdict(self)), encoding="utf-8")

    @classmethod
    def read(cls, file: Path) -> Record:
        """What `write` wrote."""
        fields = json.loads(file.read_text(encoding="utf-8"))
        return cls(**{**fields, "cases": tuple(Case(**case) for case in fields["cases"])})


def recorded_once(folder: Path, name: str, run: Callable[[], Record]) -> Record:
    """The record of scenario `name`, run now by this process unless another has done so.

    A run that was cut short (its process died, say) is not tried again: what killed it once would again.

    Parameters
    ----------
    folder : shared by all processes of the session; made if needed.
    """
    own = folder / name
    own.mkdir(parents=True, exist_ok=True)
    with locked(own):
        if (own / _RECORD).is_file():
            return Record.read(own / _RECORD)
        if (own / _BEGUN).exists():
            error = f"{name}: could not finish: its run was cut short; an earlier result is as it was"
            return Record(name=name, error=error)
        (own / _BEGUN).touch()
        record = run()
        replace_file(own / _RECORD, record.write)
        return record


def records(folder: Path) -> tuple[Record, ...]:
    """All that were made, by name."""
    return tuple(Record.read(file) for file in sorted(folder.glob(f"*/{_RECORD}")))
