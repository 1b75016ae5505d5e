"""What a scenario file asks: whether two results answer the same, though the files are not."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from vnav_drake.scenario_faults import validate_spec
from vnav_drake.scenario_file import read_document
from vnav_drake.scenario_spec import ScenarioSpec


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What a scenario file asks, and how long to search for the answer."""

    question: str  # as from `question_of`
    effort: Literal["quick", "full"]


@lru_cache(maxsize=256)
def asked_in(data: bytes) -> Asked:
    """What the bytes of a scenario file ask. Its keys are checked, what it means for a robot is not.

    Raises
    ------
    ScenarioError : this is no scenario.
    """
    document = read_document(data, "the scenario")
    spec, faults = validate_spec(document)
    if spec is None or document.faults:
        raise document.error([*document.faults, *faults])
    return Asked(question=question_of(spec), effort=spec.plan.effort)


def question_of(spec: ScenarioSpec) -> str:
    """SHA-256 of what is asked: without how long to search for it, limits of gates, and texts for people.

    Names of obstacles are such texts, unless the scenario calls by them the gates to go through. Keys that
    have their default value do not count either: a file that leaves them out asks the same.
    """
    asked = spec.model_dump(mode="json", by_alias=True, exclude_defaults=True)
    for key in ("name", "description", "gates"):
        asked.pop(key, None)
    plan = asked.get("plan", {})
    plan.pop("effort", None)
    if not spec.plan.through:
        for obstacle in asked["world"].get("obstacles", ()):
            obstacle.pop("name", None)
    if not plan:
        asked.pop("plan", None)
    text = json.dumps(asked, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
