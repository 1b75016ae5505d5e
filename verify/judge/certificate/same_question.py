"""Was the certificate made for this scenario? Compared number by number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from verify.judge.certificate.file import CertificateFile
from verify.judge.question import Question

Array = NDArray[np.float64]

LAW_KEYS = (
    "robot.radius",
    "robot.max_braking",
    "braking.reaction_time",
    "braking.margin",
    "robot.max_speed",
)
MOST_NAMED = 8  # differing numbers


def law_of(question: Question) -> Array:
    """The speed law of the scenario (5,), in the order of `LAW_KEYS`; no speed limit is infinity."""
    limits = question.setting.limits
    return np.array([limits.radius, limits.braking, limits.reaction_time, limits.margin, limits.speed])


def question_faults(file: CertificateFile, question: Question) -> list[str]:
    """Every number of the scenario that is another one in the certificate, by its key in the scenario."""
    different: dict[str, tuple[float, float]] = {}
    for key, asked, given in (
        *_positions("start", question.setting.start.position, file.start),
        *_positions("goal", question.setting.goal.position, file.goal),
        *zip(LAW_KEYS, law_of(question).tolist(), file.law.tolist(), strict=True),
    ):
        if asked != given:
            different[key] = (asked, given)
    faults = []
    asked_table, given_table = question.features.table, file.features
    if len(asked_table) == len(given_table):
        for row in np.flatnonzero((asked_table != given_table).any(axis=1)).tolist():
            numbers = zip(asked_table[row].tolist(), given_table[row].tolist(), strict=True)
            for key, (asked, given) in zip(question.features.keys(row), numbers, strict=True):
                if asked != given:
                    different.setdefault(_named(key, question, row), (asked, given))
    else:
        faults.append(
            f"made for {len(given_table)} sides, walls, points and circles; "
            f"the scenario has {len(asked_table)}"
        )
    told = [
        f"made for {key} = {given!r}; the scenario has {asked!r}" for key, (asked, given) in different.items()
    ]
    if len(told) > MOST_NAMED:
        told[MOST_NAMED:] = [f"and {len(told) - MOST_NAMED} more numbers differ from the scenario's"]
    return faults + told


def _positions(end: str, asked: tuple[float, float], given: Array) -> list[tuple[str, float, float]]:
    return [(f"{end}.position[{i}]", float(asked[i]), float(given[i])) for i in range(2)]


def _named(key: str, question: Question, row: int) -> str:
    owner = int(question.features.owner[row])
    name = question.features.names[owner] if owner >= 0 else ""
    return f"{key} ({name})" if name else key
