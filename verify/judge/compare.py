"""Does a result.json say what the evidence beside it shows?"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any

from verify import evidence
from verify.evidence import EvidenceError
from verify.judge.gates import GATE_NAMES
from verify.judge.verdict import Judgement

RELATIVE = 1e-9  # between two machines' arithmetic; far below any digit anyone reads
ABSOLUTE = 1e-8  # [any unit]: margins are proven to 1e-8 m, and differences near zero are rounding
# Numbers within messages are rounded: by one unit of the last digit told, if that is little of the number.
TEXT_RELATIVE, TEXT_ABSOLUTE = 1e-3, 2e-6
LISTED = 20  # differences shown

# Keys that state a judgement wherever they stand: absent from ours, they must be absent from a claim.
_JUDGED_KEYS = frozenset({"value", "worst", "violation", "at", "unpromised", "overridden", "scenario_limit"})

# The like, of the lower bound: what a refused certificate does not show.
_BOUND_KEYS = frozenset({"travel_time", "statement", "reasons", "worst_slack"})

_DECISIVE = re.compile(r"verdict:|checks\[.*\]\.status:|gates\[.*\]\.passed:")  # told first
_WORDS = re.compile(r"(^|\.)(message|statement|reasons\[\d+\])$")  # sentences with numbers in them
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def compare(result: Mapping[str, Any], judgement: Judgement) -> tuple[str, ...]:
    """Each difference between a result and what the judge finds, as a sentence; empty when they agree.

    Figures that cannot be recomputed from evidence (compute times, solver names, iterations) are not
    compared. In the objects the judge fills, a claim it does not make is refused where it would be
    read as a judgement: a further plan, gap, gate or check.
    """
    expected = judgement.as_result()
    found = list(_differences("", expected, result))
    for section in ("plans", "gaps"):
        claimed = result.get(section)
        if isinstance(claimed, Mapping):
            extra = sorted(set(map(str, claimed)) - set(expected[section]))
            found += [f"{section}.{name}: claimed, but there is no evidence for it" for name in extra]
    found += [
        f"plans.{name}.travel_time: claimed, but the run did not reach the goal"
        for name, plan in expected["plans"].items()
        if "travel_time" not in plan and "travel_time" in _claimed_plan(result, name)
    ]
    found += [
        f"{name}: claimed, but there is no evidence for it"
        for name in ("executed", "simulation", "lower_bound", "zone")
        if name in result and name not in expected
    ]
    found += _simulation_claims(expected.get("simulation"), result.get("simulation"))
    found += _zone_claims(expected.get("zone"), result.get("zone"))
    found.sort(key=lambda reason: not _DECISIVE.match(reason))
    if len(found) > LISTED:
        found = [*found[:LISTED], f"and {len(found) - LISTED} more differences"]
    return tuple(found)


def _simulation_claims(expected: Any, claimed: Any) -> list[str]:
    """What a result says of emergency stops and of the pre-screen without evidence for it."""
    if not isinstance(expected, Mapping) or not isinstance(claimed, Mapping):
        return []  # told where the sections are compared
    names = [name for name in ("emergency_stops", "single_track") if name in claimed and name not in expected]
    found = [f"simulation.{name}: claimed, but there is no evidence for it" for name in names]
    stops, told = expected.get("emergency_stops"), claimed.get("emergency_stops")
    if isinstance(stops, Mapping) and isinstance(told, Mapping):
        extra = sorted(set(map(str, told)) - set(stops))
        found += [f"simulation.emergency_stops.{name}: claimed, but not found" for name in extra]
    return found


def _zone_claims(expected: Any, claimed: Any) -> list[str]:
    """What a result says of the zone's promise and its fields without evidence for it."""
    if not isinstance(expected, Mapping) or not isinstance(claimed, Mapping):
        return []  # told where the sections are compared
    found = [
        f"zone.{name}: claimed, but there is no evidence for it"
        for name in ("promise", "fields", "plugin")
        if name in claimed and name not in expected
    ]
    kept, told = expected.get("promise"), claimed.get("promise")
    if isinstance(kept, Mapping) and isinstance(told, Mapping):
        extra = sorted(set(map(str, told)) - set(kept))
        found += [f"zone.promise.{name}: claimed, but not found" for name in extra]
    return found


def _claimed_plan(result: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    plans = result.get("plans")
    plan = plans.get(name) if isinstance(plans, Mapping) else None
    return plan if isinstance(plan, Mapping) else {}


def compare_files(folder: Path, result: Mapping[str, Any]) -> tuple[str, ...]:
    """Each difference between the manifest in result.json and the files in the folder."""
    claimed = result.get("files")
    if not isinstance(claimed, Mapping):
        return ("files: result.json has no manifest of its evidence",)
    found = []
    present = evidence.manifest(folder)
    for name in sorted(set(map(str, claimed)) | set(present)):
        if name not in present:
            found.append(f"{name}: missing")
        elif name not in claimed:
            found.append(f"{name}: not listed in result.json")
        elif claimed[name] != present[name]:
            found.append(f"{name}: changed since it was written (its SHA-256 differs)")
    for name in (evidence.SCENARIO, evidence.REPORT):
        if name not in claimed and name not in present:
            found.append(f"{name}: missing")
    return tuple(found)


def gate_overrides(result: Mapping[str, Any]) -> dict[str, float]:
    """Gate limits given by hand when the result was made.

    Raises
    ------
    EvidenceError : they are not finite numbers, at least 0, by gate name.
    """
    claimed = result.get("gate_overrides", {})
    if not isinstance(claimed, Mapping):
        raise EvidenceError("result.json: gate_overrides is not an object")
    for name, limit in claimed.items():
        number = isinstance(limit, int | float) and not isinstance(limit, bool)
        if name not in GATE_NAMES or not number or not 0 <= limit <= sys.float_info.max:
            key = name if name in GATE_NAMES else _show(name)
            what = f"gate_overrides.{key} = {_show(limit)}"
            raise EvidenceError(f"result.json: {what}: not a gate and its finite limit, at least 0")
    return {str(name): float(limit) for name, limit in claimed.items()}


def _differences(where: str, expected: Any, claimed: Any) -> Iterator[str]:
    if isinstance(expected, Mapping):
        yield from _object_differences(where, expected, claimed)
    elif isinstance(expected, list):
        yield from _list_differences(where, expected, claimed)
    elif not _agree(where, expected, claimed):
        yield f"{where}: is {_show(claimed)}, recomputed {_show(expected)}"


def _object_differences(where: str, expected: Mapping[str, Any], claimed: Any) -> Iterator[str]:
    if not isinstance(claimed, Mapping):
        yield f"{where}: is {_show(claimed)}, expected an object"
        return
    for key, value in expected.items():
        inner = f"{where}.{key}" if where else str(key)
        if key in claimed:
            yield from _differences(inner, value, claimed[key])
        else:
            yield f"{inner}: absent, recomputed {_show(value)}"
    judged = _JUDGED_KEYS | _BOUND_KEYS if where == "lower_bound" else _JUDGED_KEYS
    closed = set(claimed) if where.endswith(".violations") else set(claimed) & judged
    if where:
        yield from (f"{where}.{key}: claimed, but not found" for key in sorted(closed - set(expected)))


def _list_differences(where: str, expected: list[Any], claimed: Any) -> Iterator[str]:
    if not isinstance(claimed, list) or len(claimed) != len(expected):
        found = len(claimed) if isinstance(claimed, list) else _show(claimed)
        yield f"{where}: expected {len(expected)} entries, found {found}"
        return
    for index, (one, other) in enumerate(zip(expected, claimed, strict=True)):
        about = one if isinstance(one, Mapping) else {}
        names = [str(about[key]) for key in ("name", "trajectory") if key in about]
        yield from _differences(f"{where}[{' of '.join(names) or index}]", one, other)


def _agree(where: str, expected: Any, claimed: Any) -> bool:
    if isinstance(expected, bool) or expected is None:
        return claimed is expected
    if isinstance(expected, int | float):
        if isinstance(claimed, bool) or not isinstance(claimed, int | float):
            return False
        if abs(claimed) > sys.float_info.max:  # a whole number beyond any float
            return False
        return abs(claimed - expected) <= RELATIVE * abs(expected) + ABSOLUTE
    if isinstance(claimed, str) and _WORDS.search(where):
        return _same_text(expected, claimed)
    return bool(expected == claimed)


def _same_text(one: str, other: str) -> bool:
    """The same words and whole numbers, and other numbers that differ by no more than their rounding."""
    if _NUMBER.sub("#", one) != _NUMBER.sub("#", other):
        return False
    pairs = zip(_NUMBER.findall(one), _NUMBER.findall(other), strict=True)
    return all(a == b or _same_number(Decimal(a), Decimal(b)) for a, b in pairs)


def _same_number(one: Decimal, other: Decimal) -> bool:
    unit = max(float(Decimal(1).scaleb(int(n.as_tuple().exponent))) for n in (one, other))
    allowed = max(min(1.01 * unit, TEXT_RELATIVE * abs(float(one))), TEXT_ABSOLUTE)
    return unit < 1.0 and abs(float(one - other)) <= allowed


def _show(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
