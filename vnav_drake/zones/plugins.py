"""Braking zones from elsewhere: modules that the user names, and entry points of installed packages.

    load_plugin("my_package.zones")     # as `verify --plugin my_package.zones` does

Every dataclass in the module that extends `ConvexZone` (mostly by way of `GaugeZone`) and has a `type_name`
is known from then on, in this process. An installed package registers the same under the entry point group
`vnav_drake.zones`, the name of the entry point being the type's; it is loaded only when that name is asked
for and no other zone has it. Nothing in a scenario file alone makes a module load.
"""

from __future__ import annotations

import importlib
import inspect
import json
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType, TracebackType
from typing import Any, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic.errors import PydanticUserError

from vnav_drake.braking import UniformBraking
from vnav_drake.scenario_file import printable, show_path, split_path
from vnav_drake.scenario_zone import BUILT_IN
from vnav_drake.zones.convex_zone import ConvexZone
from vnav_drake.zones.errors import PluginError, ZoneError, ZoneFault

GROUP = "vnav_drake.zones"  # of entry points
_NAME = re.compile(r"[A-Za-z][\w.-]{0,63}", re.ASCII)
_OURS = ("law", "radius")  # fields of every zone, no parameters of a scenario
_WORDS = {
    "missing": "is missing",
    "finite_number": "must be finite",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "tuple_type": "must be a list",
    "list_type": "must be a list",
    "dict_type": "must be a mapping",
}

_registered: dict[str, type[ConvexZone]] = {}  # by `load_plugin`, for the life of the process


def load_plugin(module: str) -> tuple[str, ...]:
    """Import a module and make its zones known; returns their names. Twice is as good as once.

    Modules are looked for where Python looks, and in the working directory after that.

    Raises
    ------
    PluginError : it cannot be imported, holds no zone, or one whose name is taken.
    """
    found = _zones_of(_imported(module), module)
    for name, zone in found.items():
        other = _registered.get(name)
        if other is not None and other is not zone:
            raise PluginError(
                f"plugin {module}: the zone {name!r} is already registered by {other.__module__}; "
                "expected names that differ"
            )
    _registered.update(found)
    return tuple(found)


def names() -> tuple[str, ...]:
    """Names of all zones that plugins bring, without loading any."""
    return tuple(dict.fromkeys([*_registered, *(entry.name for entry in entry_points(group=GROUP))]))


def zone_class(name: str) -> type[ConvexZone] | None:
    """The zone of this name from a loaded plugin, else from an entry point; None where there is none.

    Raises
    ------
    PluginError : the entry point cannot be loaded or is no such zone, or several packages have one.
    """
    if name in _registered:
        return _registered[name]
    entries = tuple(entry_points(group=GROUP, name=name))
    if not entries:
        return None
    if len({entry.value for entry in entries}) > 1:
        values = ", ".join(sorted(entry.value for entry in entries))
        raise PluginError(f"several packages register a zone {name!r}: {values}; expected one")
    return _entry_zone(entries[0])


def build(
    zone: type[ConvexZone], parameters: Mapping[str, Any], law: UniformBraking, radius: float
) -> ConvexZone:
    """A plugin's zone with parameters from a scenario file, checked against the types of its fields.

    Raises
    ------
    ZoneError : a parameter is unknown, missing or of a wrong type, or the zone refuses it.
    """
    values = _parameters(zone, parameters)
    try:
        with Foreign(f"the zone {zone.type_name!r} cannot be made", PluginError):
            return _constructed(zone, values, law, radius)
    except PluginError as error:
        raise ZoneError("", str(error)) from error


def _constructed(
    zone: type[ConvexZone], values: Mapping[str, Any], law: UniformBraking, radius: float
) -> ConvexZone:
    try:
        return zone(law=law, radius=radius, **values)
    except ValueError as error:
        raise told(error, tuple(values)) from error


def told(error: ValueError, parameters: Sequence[str]) -> ZoneError:
    """A constructor's error, its parameter told apart: `ahead = 0.5: must be 1 or more`."""
    if isinstance(error, ZoneError):
        return error
    head, _, rest = str(error).partition(": ")
    key = head.partition(" = ")[0]
    place = split_path(key)
    return ZoneError(key, rest) if rest and place and place[0] in parameters else ZoneError("", str(error))


class Foreign:
    """Around code that is not ours, which may raise anything: told as the plugin's fault, in one line.

    Interruptions pass; what is said in our words already does, too.
    """

    def __init__(self, what: str, kind: type[ValueError]) -> None:
        self.what, self.kind = what, kind

    def __enter__(self) -> None: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        if error is None or isinstance(error, KeyboardInterrupt | PluginError | ZoneError | ZoneFault):
            return
        raise self.kind(f"{self.what}: {_reason(error)}") from error


class Watched:
    """Around work with zones: what a plugin's own functions raise there is told as the plugin's fault.

    Raises
    ------
    PluginError : in place of an error that came out of a function of a plugin's zone; others pass.
    """

    def __enter__(self) -> None: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        if isinstance(error, PluginError):
            return
        cause: BaseException | None = error
        while isinstance(cause, Exception):
            zone = _failing_zone(cause)
            if zone is not None:
                where = f"the braking zone {zone.type_name!r} of the plugin {type(zone).__module__}"
                raise PluginError(f"{where} fails: {_reason(cause)}") from error
            cause = cause.__cause__ or cause.__context__


def _failing_zone(error: BaseException) -> ConvexZone | None:
    """The zone from a plugin in one of whose own methods an error was raised, if any."""
    trace = error.__traceback__
    while trace is not None:
        frame, code = trace.tb_frame, trace.tb_frame.f_code
        owner = frame.f_locals.get(code.co_varnames[0]) if code.co_argcount else None
        if isinstance(owner, ConvexZone):
            module = str(frame.f_globals.get("__name__"))
            own = {base.__module__ for base in type(owner).__mro__}
            if module in own and not module.startswith("vnav_drake."):
                return owner
        trace = trace.tb_next
    return None


def _reason(error: BaseException) -> str:
    words = printable(str(error).partition("\n")[0])[:200]
    return f"{type(error).__name__}{words and ': '}{words}"


def _imported(module: str) -> ModuleType:
    if not re.fullmatch(r"[^\W\d]\w*(\.[^\W\d]\w*)*", module):
        raise PluginError(
            f"plugin {printable(module)}: expected the name of a module, such as my_package.zones"
        )
    here = os.getcwd()
    if here not in sys.path and "" not in sys.path:
        sys.path.append(here)  # it stays: worker processes look where we do
    with Foreign(f"plugin {module} cannot be imported", PluginError):
        return importlib.import_module(module)


def _zones_of(module: ModuleType, name: str) -> dict[str, type[ConvexZone]]:
    """The zones that a module holds, by their names; those of the package left out."""
    found: dict[str, type[ConvexZone]] = {}
    for value in vars(module).values():
        if not (isinstance(value, type) and issubclass(value, ConvexZone)):
            continue
        if value.__module__.startswith("vnav_drake.") or not vars(value).get("type_name"):
            continue
        _check_class(value, f"plugin {name}")
        if found.setdefault(value.type_name, value) is not value:
            raise PluginError(f"plugin {name}: two zones are called {value.type_name!r}")
    if not found:
        raise PluginError(
            f"plugin {name}: holds no braking zone; expected a dataclass that extends GaugeZone or "
            "ConvexZone and has a type_name"
        )
    return found


def _entry_zone(entry: EntryPoint) -> type[ConvexZone]:
    what = f"the entry point {entry.name} = {entry.value} of {GROUP}"
    with Foreign(f"{what} cannot be imported", PluginError):
        found = entry.load()
    if isinstance(found, ModuleType):
        zones = _zones_of(found, found.__name__)
        if entry.name in zones:
            return zones[entry.name]
    elif isinstance(found, type) and issubclass(found, ConvexZone) and found.type_name == entry.name:
        _check_class(found, what)
        return found
    raise PluginError(f"{what}: is no braking zone with type_name {entry.name!r}")


def _check_class(zone: type[ConvexZone], where: str) -> None:
    """Refuse a class that a scenario could not ask for."""
    name = zone.type_name
    what = f"{where}: {zone.__name__}"
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise PluginError(f"{what}.type_name = {name!r}: expected letters, digits, _, . and -")
    if name in BUILT_IN:
        raise PluginError(f"{what}.type_name = {name!r}: is built in; expected another name")
    if "__dataclass_fields__" not in vars(zone) or not is_dataclass(zone):
        raise PluginError(f"{what}: is no dataclass; expected @dataclass(frozen=True, kw_only=True)")
    if inspect.isabstract(zone):
        missing = ", ".join(sorted(getattr(zone, "__abstractmethods__", ())))
        raise PluginError(f"{what}: is abstract; expected it to define {missing}")
    _model(zone)


def _model(zone: type[ConvexZone]) -> type[BaseModel]:
    """The parameters of a zone as a strict model, one field each."""
    what = f"the zone {zone.type_name!r}"
    with Foreign(f"{what}: its fields have types that cannot be found", PluginError):
        hints = get_type_hints(zone)
    own = [field for field in fields(zone) if field.init and field.name not in _OURS]
    given: dict[str, Any] = {
        field.name: (hints[field.name], ... if _required(field) else None) for field in own
    }
    try:
        return create_model(
            "Parameters",
            __config__=ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, protected_namespaces=()),
            **given,
        )
    except (PydanticUserError, NameError) as error:
        words = str(error).partition("\n")[0]
        raise PluginError(f"{what}: a field has a type that no file can give: {words}") from error


def _required(field: Field[Any]) -> bool:
    return field.default is MISSING and field.default_factory is MISSING


def _parameters(zone: type[ConvexZone], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Values for the constructor, those that the file gives."""
    model = _model(zone)
    known = list(model.model_fields)
    for key in parameters:
        if key not in known:
            told = ", ".join(known) or "it takes none"
            raise ZoneError(key, f"unknown parameter of the zone {zone.type_name!r}; known: {told}")
    try:
        read = model.model_validate_json(json.dumps(parameters))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ZoneError(show_path(first["loc"]), _WORDS.get(first["type"], first["msg"])) from error
    return {name: getattr(read, name) for name in read.model_fields_set}
