"""What result.json tells of a braking zone that is not a disc: what it is, whether its promise is kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from verify.judge.checks import Setting
from verify.judge.finding import Check
from verify.judge.motion import Motion
from verify.judge.promises import FIELD_PLAN
from verify.judge.zones.fields_file import NAME as FIELDS
from verify.judge.zones.fields_file import FieldsFile, judge_fields
from verify.judge.zones.plugin import identity
from verify.judge.zones.promise import audit


def zone_block(
    setting: Setting, file: FieldsFile | None, executed: str | None, motions: Mapping[str, Motion]
) -> tuple[dict[str, Any] | None, list[Check]]:
    """The block `zone` and the check `fields` of field sets; None and no check in a scenario with a disc.

    `executed` is the plan that is driven, the only one whose stops are promised anything; `motions` has all.
    """
    asked = setting.zone
    if asked is None:
        return None, []
    block: dict[str, Any] = {
        "type": asked.type,
        "parameters": dict(asked.parameters),
        "isotropic": asked.isotropic,
        "friction_reserve": setting.limits.reserves_friction,
        "relaxation": asked.relaxation,
        "statement": asked.statement,
    }
    if asked.plugin:
        block["plugin"] = identity(asked.path_type)
    checks = []
    if asked.type == "field_set" and executed is not None:
        if executed == FIELD_PLAN:
            check, figures = judge_fields(file, asked, motions[executed], setting.features.table)
            if figures is not None:
                block["fields"] = figures
        else:
            check = Check(
                name=FIELDS,
                trajectory="",
                status="not_evaluated",
                message=f"{executed} is not driven under the fields",
            )
        checks.append(replace(check, trajectory=executed))
    zone = None if executed is None else setting.zone_of(executed)
    if executed is not None and zone is not None:
        block["promise"] = audit(motions[executed], zone, setting.surroundings, setting.limits)
    return block, checks
