"""Validation errors of the scenario models, said in the words of the file format."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from vnav_drake.scenario_file import Document, Fault, KeyPath, show_value
from vnav_drake.scenario_section import MAX_COORDINATE
from vnav_drake.scenario_spec import ScenarioSpec, scenario_schema
from vnav_drake.scenario_zone import SPECS, TAG, is_tag, untagged

_OWN_TYPES = {"version", "text", "name", "speed", "zone", "methods", "shape", "weights", "step"}
_MANY = 10_000  # faults beyond this are counted, not listed: each takes a kilobyte
_PLAIN = {
    "finite_number": "must be finite",
    "bool_type": "must be true or false",
    "string_pattern_mismatch": "must consist of the characters a-z, 0-9, _ and -",
}


def validate_spec(document: Document) -> tuple[ScenarioSpec | None, list[Fault]]:
    """The model of a document, or None and one fault for each key, type or range that is wrong."""
    try:
        return ScenarioSpec.model_validate(document.data), []
    except ValidationError as error:
        if error.error_count() <= _MANY:
            return None, _faults(error, document)
        count = error.error_count()
    many = Fault((), f"{count:,} keys, types or ranges are wrong, too many to list")
    try:
        ScenarioSpec.model_validate(_beginning(document.data))
    except ValidationError as error:
        return None, [*_faults(error, document), many]
    return None, [many]


def _faults(error: ValidationError, document: Document) -> list[Fault]:
    """One fault for each validation error, except where the file's text itself was already refused."""
    schema = scenario_schema()
    details = [one for one in error.errors(include_url=False) if not _follows(one, document)]
    return [_fault(one, schema) for one in details]


def _beginning(data: object) -> object:
    """The data with every list cut short, so that only so many faults remain."""
    if isinstance(data, dict):
        return {key: _beginning(value) for key, value in data.items()}
    return [_beginning(value) for value in data[:50]] if isinstance(data, list) else data


def _follows(detail: ErrorDetails, document: Document) -> bool:
    """Whether a fault only follows from another: a value that was not read, a list short of its bad items."""
    path = untagged(detail["loc"])
    if any(path[: i + 1] in document.unread for i in range(len(path))):
        return True
    return detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"]


def _fault(detail: ErrorDetails, schema: Mapping[str, Any]) -> Fault:
    place: KeyPath = detail["loc"]
    path, rule = untagged(place), _rule_at(schema, place)
    if detail["type"] in _OWN_TYPES:
        return Fault(path, detail["msg"])
    if detail["type"] == "extra_forbidden":
        return Fault(path, _unknown_key(place, schema))
    if detail["type"] == "missing":
        if path and isinstance(path[-1], int):
            return Fault(path[:-1], f"must be {_kind(_rule_at(schema, place[:-1]))}")
        return Fault(path, _sentence(f"is missing; expected {_kind(rule)}", rule))
    return Fault(path, _sentence(_expected(detail, rule), rule))


def _expected(detail: ErrorDetails, rule: Mapping[str, Any]) -> str:
    """What was expected, from the kind of error and its bounds."""
    kind = detail["type"]
    text = _PLAIN.get(kind) or _bound(detail, rule) or _length(detail, rule)
    if text:
        return text
    if kind in {"float_type", "int_type", "int_from_float"}:
        return f"must be {_kind(rule)}{_number_hint(detail['input'])}"
    if kind == "string_type":
        return (
            "must be text; put it in quotes" if isinstance(detail["input"], int | float) else "must be text"
        )
    if kind == "literal_error":
        return f"must be {_choices(rule)}"
    if kind in {"tuple_type", "list_type", "model_type", "model_attributes_type", "dict_type"}:
        return f"must be {_kind(rule)}"
    return f"is not valid: {detail['msg']}"


def _bound(detail: ErrorDetails, rule: Mapping[str, Any]) -> str:
    """The bound that a number broke; empty when that is not what is wrong."""
    bounds = detail.get("ctx", {})
    if _is_coordinate(rule) and ("ge" in bounds or "le" in bounds):
        return f"must lie within +-{MAX_COORDINATE:g}, where rounding stays far below 1e-9 m"
    if "ge" in bounds:
        positive = "positive, " if bounds["ge"] > 0.0 and detail["input"] <= 0.0 else ""
        return f"must be {positive}at least {bounds['ge']:g}"
    if "le" in bounds:
        return f"must be at most {bounds['le']:g}"
    if "lt" in bounds:
        return "must be less than " + ("pi/2" if bounds["lt"] == math.pi / 2.0 else f"{bounds['lt']:g}")
    return ""


def _length(detail: ErrorDetails, rule: Mapping[str, Any]) -> str:
    """The bound that a length broke; empty when that is not what is wrong."""
    bounds = detail.get("ctx", {})
    if detail["type"] == "string_too_long":
        return f"must have at most {bounds['max_length']} characters"
    if detail["type"] not in {"too_short", "too_long"}:
        return ""
    if "prefixItems" in rule:
        return f"must be {_kind(rule)}"
    least = bounds["min_length"]
    return f"must have at least {least} {'entry' if least == 1 else 'entries'}"


def _is_coordinate(rule: Mapping[str, Any]) -> bool:
    return bool(rule.get("minimum") == -MAX_COORDINATE)


def _number_hint(value: object) -> str:
    """Why a text that looks like a number is none."""
    if not isinstance(value, str) or not value:
        return ""
    if value.lower().strip("+-") in {"nan", "inf", "infinity"}:
        return ", and finite"
    try:
        float(value)
    except ValueError:
        looks_odd = value[0].isdigit()
    else:
        looks_odd = True
    return "; write it plain, such as 8, 0.5 or 1.0e-6, without quotes" if looks_odd else ""


def _choices(rule: Mapping[str, Any]) -> str:
    choices = [show_value(rule["const"])] if "const" in rule else [str(one) for one in rule.get("enum", [])]
    return choices[0] if len(choices) == 1 else f"one of {', '.join(choices)}"


def _kind(rule: Mapping[str, Any]) -> str:
    """What sort of value a rule of the schema wants."""
    if "const" in rule or "enum" in rule:
        return _choices(rule)
    if "prefixItems" in rule:
        count = len(rule["prefixItems"])
        return "a pair [x, y] of numbers" if count == 2 else f"a list of {count} numbers"
    if rule.get("type") == "object":
        required = rule.get("required", [])
        return "a mapping" + (f" with {', '.join(required)}" if required else "")
    names = {"array": "a list", "number": "a number", "integer": "a whole number", "string": "text"}
    return names.get(rule.get("type", ""), "a value")


def _sentence(text: str, rule: Mapping[str, Any]) -> str:
    return f"{text} [{rule['unit']}]" if "unit" in rule else text


def _unknown_key(path: KeyPath, schema: Mapping[str, Any]) -> str:
    known = list(_rule_at(schema, path[:-1]).get("properties", {}))
    if is_tag(path, len(path) - 2):
        known.remove("type")
        kind = str(path[-2]).removeprefix(TAG)
        return f"unknown parameter of the zone {kind!r}; known: {', '.join(known) or 'it takes none'}"
    close = difflib.get_close_matches(str(path[-1])[:100].lower(), known, n=1)
    if close:
        return f"unknown key; did you mean {close[0]}?"
    return f"unknown key; known here: {', '.join(known)}"


def _rule_at(schema: Mapping[str, Any], path: KeyPath) -> Mapping[str, Any]:
    """The part of the JSON Schema that speaks of a place in the file; empty where none does."""
    rule: Mapping[str, Any] = schema
    for i, key in enumerate(path):
        rule = _resolve(rule, schema)
        if is_tag(path, i):
            rule = schema["$defs"][SPECS[str(key)].__name__]
        elif isinstance(key, str):
            rule = rule.get("properties", {}).get(key, {})
        elif "prefixItems" in rule:
            items = rule["prefixItems"]
            rule = items[key] if key < len(items) else {}
        else:
            rule = rule.get("items", {})
    return _resolve(rule, schema)


def _resolve(rule: Mapping[str, Any], schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """Follow a reference, and take the first choice of "this or null"."""
    outer = {key: rule[key] for key in ("unit",) if key in rule}
    if "anyOf" in rule and rule["anyOf"][-1] == {"type": "null"}:
        rule = rule["anyOf"][0]
    if "$ref" in rule:
        rule = schema["$defs"][rule["$ref"].rsplit("/", 1)[-1]]
    return {**rule, **outer}
