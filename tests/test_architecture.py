"""Imports point one way, and a few rules of the code base that a reader should be able to rely on."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("vnav_drake", "systems", "verify")
MAX_LINES = 450

# Inside vnav_drake, by the first name below the package. Problem modules may import each other;
# geometry may import problem modules; methods both, and never each other.
PROBLEM = (
    "robot",
    "braking",
    "zones",
    "world",
    "convex",
    "problem",
    "plan",
    "biarcs",
    "scenario*",
    "testing",
)
SHARED = ("voronoi", "arcs", "homotopy", "speed_profile", "field_fitting")
METHODS = ("voronoi_route", "collocation", "speed_graph", "vc_method", "dwa", "lower_bound")

# The judge recomputes everything: from the package it may only know how the text of a scenario file
# becomes raw numbers. `test_judge_independence` says the same of what is loaded at run time.
JUDGE_MAY_IMPORT = ("vnav_drake.scenario_file*", "vnav_drake.scenario_faults*")
# Only here, and only inside the function that is called for a zone that a plugin brings: nobody else has it.
JUDGE_PLUGINS = "verify.judge.zones.plugin"
PLUGIN_REGISTRY = (
    *("vnav_drake.zones", "vnav_drake.zones.catalogue*", "vnav_drake.zones.convex_zone*"),
    *("vnav_drake.zones.errors*", "vnav_drake.zones.plugins*", "vnav_drake.braking*"),
)
DRAKE_USERS = ("vnav_drake.collocation*", "vnav_drake.lower_bound*", "systems*", "verify.replay*")
MATPLOTLIB_USERS = ("verify.report*",)


def _name(file: Path) -> str:
    parts = list(file.relative_to(ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {_name(file): file for package in PACKAGES for file in sorted((ROOT / package).rglob("*.py"))}
TREES = {name: ast.parse(file.read_text(encoding="utf-8")) for name, file in FILES.items()}


def imports_of(tree: ast.Module, module: str, is_package: bool) -> set[str]:
    """Absolute names of all that a module imports; `from a import b` gives a.b and a."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = module.split(".") if is_package else module.split(".")[:-1]
                package = package[: len(package) - node.level + 1]
                base = ".".join([*package, *([base] if base else [])])
            found.add(base)
            found.update(f"{base}.{alias.name}" for alias in node.names)
    return found


IMPORTS = {name: imports_of(tree, name, FILES[name].name == "__init__.py") for name, tree in TREES.items()}


def _within(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def _part(module: str) -> str:
    """The first name below vnav_drake, empty for the package itself."""
    return module.partition(".")[2].partition(".")[0]


def _offences(importers: Iterator[str], forbidden: tuple[str, ...]) -> list[str]:
    return sorted(
        f"{module} imports {target}"
        for module in importers
        for target in IMPORTS[module]
        if any(_within(target, package) for package in forbidden)
    )


def _lines(strange: list[str]) -> str:
    return "\n".join(["", *strange])


def _reached(module: str, package: str) -> set[str]:
    """The module and all modules of `package` that it imports, directly or not.

    Packages around a module are left out: Python runs them before it, whatever it uses.
    """
    reached, pending = set(), [module]
    while pending:
        current = pending.pop()
        if current not in reached:
            reached.add(current)
            inside = [name for name in IMPORTS[current] if name in IMPORTS and _within(name, package)]
            pending += [name for name in inside if not _within(current, name)]
    return reached


JUDGE = [name for name in FILES if _matches(name, ("verify.judge*",))]


def test_imports_are_read_in_every_form():
    source = "import a.b\nfrom c import d\ndef f():\n    from . import g\n    from ..h import k\n"
    tree = ast.parse(source)
    assert imports_of(tree, "p.q.m", is_package=False) == {"a.b", "c", "c.d", "p.q", "p.q.g", "p.h", "p.h.k"}
    assert {"p.q.g", "p.h.k"} <= imports_of(tree, "p.q", is_package=True) | {"p.h.k"}


def test_packages_are_found():
    assert {"vnav_drake.world", "vnav_drake.collocation", "systems", "verify"} <= set(FILES)
    assert JUDGE


def test_planning_knows_neither_systems_nor_verify():
    strange = _offences((m for m in FILES if _within(m, "vnav_drake")), ("systems", "verify"))
    assert not strange, _lines(strange)


def test_systems_do_not_know_verify():
    strange = _offences((m for m in FILES if _within(m, "systems")), ("verify",))
    assert not strange, _lines(strange)


def test_no_package_imports_tests_or_benchmarks():
    strange = _offences(iter(FILES), ("tests", "benchmarks"))
    assert not strange, _lines(strange)


def test_every_planning_module_has_a_layer():
    known = (*PROBLEM, *SHARED, *METHODS, "")
    strange = [m for m in FILES if _within(m, "vnav_drake") and not _matches(_part(m), known)]
    assert not strange, "say in tests/test_architecture.py which layer these belong to:" + _lines(strange)


def test_problem_modules_import_only_problem_modules():
    strange = [
        f"{module} imports {target}"
        for module in FILES
        if _within(module, "vnav_drake") and _matches(_part(module), PROBLEM)
        for target in IMPORTS[module]
        if _within(target, "vnav_drake") and not _matches(_part(target), (*PROBLEM, ""))
    ]
    assert not strange, _lines(strange)


def test_shared_modules_import_no_method():
    strange = [
        f"{module} imports {target}"
        for module in FILES
        if _within(module, "vnav_drake") and _matches(_part(module), SHARED)
        for target in IMPORTS[module]
        if _within(target, "vnav_drake") and _matches(_part(target), METHODS)
    ]
    assert not strange, _lines(strange)


@pytest.mark.parametrize("method", METHODS)
def test_methods_never_import_each_other(method: str):
    others = tuple(f"vnav_drake.{other}" for other in METHODS if other != method)
    strange = _offences((m for m in FILES if _within(m, f"vnav_drake.{method}")), others)
    assert not strange, _lines(strange)


def test_the_judge_shares_no_code_with_the_planners():
    # Also not through other modules of verify.
    strange = [
        f"{judge} reaches {module}, which imports {target}"
        for judge in JUDGE
        for module in _reached(judge, "verify")
        for target in IMPORTS[module]
        if _within(target, "systems")
        or (target.startswith("vnav_drake.") and not _matches(target, JUDGE_MAY_IMPORT))
        if not (module == JUDGE_PLUGINS and _matches(target, PLUGIN_REGISTRY))
    ]
    assert not strange, _lines(strange)


def test_the_judge_loads_the_registry_of_zones_only_when_it_is_asked_for_a_plugin():
    tree = TREES[JUDGE_PLUGINS]
    loaded = ast.Module([node for node in tree.body if not _for_types_only(node)], [])
    functions = [node for node in ast.walk(loaded) if isinstance(node, ast.FunctionDef)]
    inside = {id(node) for function in functions for node in ast.walk(function)}
    at_once = [
        name
        for node in ast.walk(loaded)
        if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in inside
        for name in imports_of(ast.Module([node], []), JUDGE_PLUGINS, is_package=False)
    ]
    assert not [name for name in at_once if _within(name, "vnav_drake")]
    assert any(_within(name, "vnav_drake.zones.catalogue") for name in IMPORTS[JUDGE_PLUGINS])


def _for_types_only(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def test_drake_is_used_only_where_it_is_needed():
    users = (m for m in FILES if not _matches(m, DRAKE_USERS))
    strange = _offences(users, ("pydrake",))
    assert not strange, _lines(strange)


def test_matplotlib_draws_only_reports():
    users = (m for m in FILES if not _matches(m, MATPLOTLIB_USERS))
    strange = _offences(users, ("matplotlib",))
    assert not strange, _lines(strange)


def test_benchmark_peers_are_no_dependency():
    strange = _offences(iter(FILES), ("casadi",))
    assert not strange, _lines(strange)


def test_errors_are_caught_by_name():
    strange = []
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ExceptHandler):
                kinds = node.type.elts if isinstance(node.type, ast.Tuple) else [node.type]
                caught = {"" if kind is None else ast.unparse(kind) for kind in kinds}
                # tidying up after anything is fine when the error goes on
                goes_on = isinstance(node.body[-1], ast.Raise) and node.body[-1].exc is None
                if caught & {"", "Exception"} or ("BaseException" in caught and not goes_on):
                    strange.append(f"{module}:{node.lineno}")
    assert not strange, _lines(strange)


def test_module_names_say_what_they_answer():
    vague = {"utils", "util", "common", "helpers", "helper", "misc"}
    assert not [module for module in FILES if vague & {part.strip("_") for part in module.split(".")}]


def test_modules_stay_short():
    files = [*FILES.values(), *(ROOT / "benchmarks").rglob("*.py")]
    long = {_name(f): n for f in files if (n := len(f.read_text(encoding="utf-8").splitlines())) > MAX_LINES}
    assert not long, _lines([f"{name}: {lines} lines" for name, lines in long.items()])


def _undocumented(node: ast.AST, where: str, *, methods: bool) -> Iterator[str]:
    """Public functions and classes, and public methods if asked for, without a docstring."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            if child.name.startswith("_"):
                continue
            here = f"{where}.{child.name}"
            if ast.get_docstring(child) is None:
                yield here
            if isinstance(child, ast.ClassDef) and methods:
                yield from _undocumented(child, here, methods=True)
        elif isinstance(child, ast.If | ast.Try):
            yield from _undocumented(child, where, methods=methods)


def test_public_names_of_planning_have_docstrings():
    # Modules inside a package are its own business below the level of functions and classes.
    planning = {m: tree for m, tree in TREES.items() if _within(m, "vnav_drake")}
    bare = [m for m, tree in planning.items() if ast.get_docstring(tree) is None]
    bare += [
        name
        for m, tree in planning.items()
        for name in _undocumented(tree, m, methods=m.count(".") == 1 and FILES[m].name != "__init__.py")
    ]
    assert not bare, _lines(bare)
