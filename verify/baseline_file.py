"""The file of a baseline: key figures of earlier runs, and how far later ones may be from them."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError
from pydantic_core import ErrorDetails

from verify.atomic import locked, replace_file
from verify.evidence import MODEL_OF_PLAN
from verify.metrics import UNIT_OF_KIND, Metric

DIGITS = 10  # significant digits stored: more than any tolerance asks for, few enough to read
MAX_BYTES = 16 * 1024 * 1024  # a thousand scenarios take a twentieth of it

_KNOWN = (
    *(f"travel_time.{plan}" for plan in (*MODEL_OF_PLAN, "simulation")),
    "lower_bound",
    *(f"gap.{name}" for name in ("analytic", "refinement", "certified", "certified_full")),
    *(f"margin.{name}" for name in ("braking", "clearance", "stops_clearance")),
    "constraint_violation",
    "emergency_stops",
    "tracking_error",
)


class BaselineError(Exception):
    """The baseline cannot be used; the message names file, key, value and what was expected."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


Amount = Annotated[float, Field(ge=0.0)]
Name = Annotated[str, Field(pattern=r"^[a-z0-9_-]+$")]
MetricName = Annotated[str, Field(pattern=r"^[a-z0-9_.]+$")]


class Spread(_Section):
    """How far a figure may be from the stored one: `absolute + relative * |stored|`."""

    absolute: Amount = 0.0  # in the figure's unit
    relative: Amount = 0.0

    def around(self, stored: float) -> float:
        """The distance allowed, in the unit of `stored`."""
        return self.absolute + self.relative * abs(stored)


class Tolerance(Spread):
    """The same for runs with the stored effort; `other_effort` for runs with another one."""

    other_effort: Spread | None = None


class Aim(_Section):
    """What limits of the gate `certified_gap` a run was made with."""

    limit: Amount  # under which it was judged
    aimed: Amount | None = None  # the gap to which the bound was refined; none was sought


class Entry(_Section):
    """What is kept of one run."""

    question: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]  # as from `question_of`
    effort: Literal["quick", "full"]
    verdict: Literal["certified", "refined"]
    certified_gap: Aim
    metrics: Annotated[dict[MetricName, float], Field(min_length=1)]


class Baseline(_Section):
    """Entries by scenario, tolerances by kind of figure or by pattern of its name."""

    schema_version: Annotated[Literal[1], Field(alias="schema")] = 1
    tolerances: dict[str, Tolerance] = {}
    scenarios: dict[Name, Entry] = {}
    _file: Path | None = PrivateAttr(default=None)

    @property
    def file(self) -> Path | None:
        """Where it was read."""
        return self._file


# What another machine keeps. Solvers stop within 1e-6 of an optimum, so times repeat far better than
# here; with the other effort they stop earlier, from fewer starting points.
DEFAULTS: Mapping[str, Tolerance] = MappingProxyType(
    {
        "travel_time": Tolerance(relative=1e-3, other_effort=Spread(relative=0.02)),
        # The simulation writes a row each 0.01 s, and arrives at one of them.
        "travel_time.simulation": Tolerance(
            absolute=0.02, relative=1e-3, other_effort=Spread(absolute=0.02, relative=0.02)
        ),
        # One decision of the dynamic window more or less on the way.
        "travel_time.dwa": Tolerance(relative=0.05, other_effort=Spread(relative=0.05)),
        "bound": Tolerance(relative=5e-3, other_effort=Spread(relative=0.02)),
        "gap": Tolerance(absolute=1e-3, relative=0.25, other_effort=Spread(absolute=0.02, relative=0.25)),
        "constraint_violation": Tolerance(absolute=1e-6, other_effort=Spread(absolute=1e-6)),
        "margin": Tolerance(absolute=5e-3, other_effort=Spread(absolute=0.05)),
        # A coarser plan is followed less closely, most of all where the floor is slippery.
        "tracking_error": Tolerance(absolute=5e-3, other_effort=Spread(absolute=0.3)),
        "count": Tolerance(other_effort=Spread()),
        # A busy or smaller machine takes four times as long; short stages have noise of seconds.
        "compute_time": Tolerance(absolute=5.0, relative=3.0),
    }
)


def spread(tolerances: Mapping[str, Tolerance], metric: Metric, *, same_effort: bool) -> Spread:
    """What holds for a figure, from the most special entry that means it.

    That is, of `tolerances`, the one for its name, then the longest pattern, then the one for its kind; then
    the defaults for its name and its kind. With another effort it is `other_effort` of the first of these
    that has any, nowhere narrower than what holds with the same.
    """
    entries = _precedence(tolerances, metric)
    if same_effort:
        return entries[0]
    other = next((found.other_effort for found in entries if found.other_effort is not None), Spread())
    return Spread(
        absolute=max(entries[0].absolute, other.absolute), relative=max(entries[0].relative, other.relative)
    )


def _precedence(tolerances: Mapping[str, Tolerance], metric: Metric) -> list[Tolerance]:
    """What means the figure, the most special first; each kind is among the defaults."""
    patterns = {key for key in tolerances if key not in UNIT_OF_KIND and fnmatchcase(metric.name, key)}
    longest = sorted(patterns, key=lambda key: (key != metric.name, -len(key), key))
    own = [tolerances[key] for key in (*longest, metric.kind) if key in tolerances]
    return own + [DEFAULTS[key] for key in (metric.name, metric.kind) if key in DEFAULTS]


def remedy(baseline: Path | None, scenario: str = "FILE") -> str:
    """The command that stores a run, for a shell."""
    kept = "BASELINE" if baseline is None else shlex.quote(str(baseline))
    return f"verify {shlex.quote(scenario)} --baseline {kept} --update-baseline"


def read_baseline(file: Path) -> Baseline:
    """The content of the file.

    Raises
    ------
    BaselineError : it is missing, unreadable, no JSON, or holds what no baseline holds.
    """
    try:
        if file.stat().st_size > MAX_BYTES:
            raise BaselineError(f"{file}: larger than {MAX_BYTES} bytes, so no baseline")
        text = file.read_bytes().decode("utf-8")
    except FileNotFoundError as error:
        raise BaselineError(f"{file}: does not exist; {remedy(file)} writes it") from error
    except OSError as error:
        raise BaselineError(f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise BaselineError(f"{file}: not text in UTF-8") from error
    try:
        content = json.loads(text, object_pairs_hook=_no_twins)
        found = Baseline.model_validate(content)
    except ValidationError as error:
        raise BaselineError("\n".join(_faults(file, error))) from error
    except (ValueError, RecursionError) as error:
        raise BaselineError(f"{file}: not the JSON of a baseline: {error}") from error
    if "schema" not in content:
        raise BaselineError(f"{file}: schema is missing; expected 1")
    for key in found.tolerances:
        if not _means_something(key, found):
            raise BaselineError(
                f"{file}: tolerances.{key}: no figure has this name; expected a kind ("
                f"{', '.join(UNIT_OF_KIND)}), a name such as travel_time.refined, or a pattern such as gap.*"
            )
    found._file = file
    return found


def _no_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object whose keys differ: of two entries for one scenario, none is silently dropped."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twin = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key {twin!r} stands twice in one object")
    return found


def _faults(file: Path, error: ValidationError) -> list[str]:
    """A line for each fault: where, what is there, what was expected."""
    return [f"{file}: {_fault(fault)}" for fault in error.errors(include_url=False)]


def _fault(fault: ErrorDetails) -> str:
    where = ".".join(map(str, fault["loc"])) or "the whole"
    if fault["type"] == "missing":
        return f"{where} is missing"
    expected = re.sub("^Input should be ", "", fault["msg"])
    if fault["type"] == "extra_forbidden":
        expected = ", ".join(_keys_beside(fault["loc"]))
    return f"{where} = {fault['input']!r:.80}: expected {expected}"


def _keys_beside(place: tuple[int | str, ...]) -> list[str]:
    """Keys that may stand where a fault is."""
    section: type[_Section] = Baseline
    for depth, key in enumerate(place[:-1]):
        if depth == 0:
            section = Tolerance if key == "tolerances" else Entry
        elif depth > 1:
            section = Spread if key == "other_effort" else Aim
    return [field.alias or name for name, field in section.model_fields.items()]


def _means_something(key: str, baseline: Baseline) -> bool:
    """Whether a key of `tolerances` is a kind, or means a figure that there is or may be."""
    if key in UNIT_OF_KIND or key.startswith("compute_time."):
        return True
    stored = {name for entry in baseline.scenarios.values() for name in entry.metrics}
    return any(fnmatchcase(name, key) for name in stored.union(_KNOWN))


def update_baseline(file: Path, entries: Mapping[str, Entry]) -> Baseline:
    """Put entries in the place of those with the same name, and write the file whole or not at all.

    Entries of other scenarios and all tolerances stay. A new file holds the defaults, to be edited.

    Raises
    ------
    BaselineError : what is there is no baseline.
    OSError : it cannot be written.
    """
    target = file.resolve()  # a link stays one
    with locked(target.parent):
        before = read_baseline(target) if target.exists() else Baseline(tolerances=dict(DEFAULTS))
        after = before.model_copy(update={"scenarios": {**before.scenarios, **entries}})
        content = after.model_dump(mode="json", by_alias=True, exclude_none=True)
        text = json.dumps(content, indent=2, sort_keys=True, allow_nan=False) + "\n"
        replace_file(target, lambda aside: aside.write_text(text, encoding="utf-8"))
    return after
