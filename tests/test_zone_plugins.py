"""Braking zones from elsewhere: modules named on the command line, entry points, what is wrong with them."""

from __future__ import annotations

import hashlib
import pickle
import sys
from pathlib import Path

import pytest

from verify import pipeline
from verify.__main__ import main
from verify.judge.zones.plugin import differences, identity
from vnav_drake.scenario import Scenario, ScenarioError, parse_scenario
from vnav_drake.zones import plugins
from vnav_drake.zones.catalogue import known_types
from vnav_drake.zones.errors import PluginError
from vnav_drake.zones.plugins import load_plugin

EXAMPLE = (Path(__file__).parent / "scenario_example.yaml").read_text()
HEAD = """
from dataclasses import dataclass
from typing import ClassVar, Literal
import numpy as np
from vnav_drake.zones.convex_zone import ConvexZone, GaugeZone
from vnav_drake.zones.shapes import EllipseZone
"""
DATACLASS = "@dataclass(frozen=True, kw_only=True)\n"
OVAL = f"""{HEAD}
{DATACLASS}class Oval(GaugeZone):
    side: float = 0.5
    corners: tuple[tuple[float, float], ...] = ()
    form: Literal["round", "flat"] = "round"
    count: int = 1
    sharp: bool = False
    type_name: ClassVar[str] = "oval"

    def __post_init__(self):
        if self.side <= 0.0:
            raise ValueError(f"side = {{self.side}}: must be positive")
        if self.count > 2:
            raise ValueError("too many of them")
        if self.count < 0:
            raise ZeroDivisionError("count")

    def shape(self, angle):
        h = np.hypot(np.cos(angle), self.side * np.sin(angle))
        return h, (self.side**2 - 1.0) * np.sin(angle) * np.cos(angle) / h
"""


@pytest.fixture(autouse=True)
def workshop(tmp_path, monkeypatch):
    """A working directory for modules; nothing known of them before or after."""
    before = set(sys.modules)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    monkeypatch.setattr(plugins, "_registered", {})
    yield tmp_path
    for name in set(sys.modules) - before:
        if Path(getattr(sys.modules[name], "__file__", None) or "/").is_relative_to(tmp_path):
            del sys.modules[name]


def module(name: str, text: str) -> str:
    Path(f"{name}.py").write_text(text, encoding="utf-8")
    return name


def install(name: str, *entries: str) -> None:
    """An installed package, as far as its entry points go."""
    info = Path(f"{name}-1.0.dist-info")
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[vnav_drake.zones]\n" + "\n".join(entries) + "\n")
    if str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))


def asked(zone: str) -> Scenario:
    return parse_scenario(EXAMPLE.replace("zone: uniform", f"zone: {zone}").encode(), "f.yaml")


def refused(zone: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        asked(zone)
    assert len(caught.value.faults) == 1
    return caught.value.faults[0].removeprefix("f.yaml:26: braking.zone")


# --- modules ---


def test_a_module_in_the_working_directory_makes_its_zones_known():
    assert "oval" not in known_types()
    assert load_plugin(module("ovals", OVAL)) == ("oval",)
    assert load_plugin("ovals") == ("oval",)  # once more does no harm
    assert known_types()[-1] == "oval"
    zone = asked(
        "{type: oval, side: 0.7, corners: [[1, 2], [3.5, 4]], form: flat, count: 2, sharp: true}"
    ).problem.zone
    assert (zone.side, zone.corners) == (0.7, ((1.0, 2.0), (3.5, 4.0)))
    assert (zone.form, zone.count, zone.sharp, zone.radius) == ("flat", 2, True, 0.4)
    assert pickle.loads(pickle.dumps(zone)) == zone
    assert asked("oval").problem.zone.side == 0.5
    assert asked("{type: field_set, base: {type: oval, side: 1}}").problem.zone.side == 1.0


def test_parts_of_packages_can_be_named():
    Path("mine").mkdir()
    Path("mine/__init__.py").touch()
    module("mine/zones", OVAL)
    assert load_plugin("mine.zones") == ("oval",)


def test_zones_of_the_package_and_helpers_in_a_module_are_no_plugins():
    helper = f"{DATACLASS}class Helper(EllipseZone):\n    wide: float = 1.0\n"
    assert load_plugin(module("ovals", OVAL + helper)) == ("oval",)


@pytest.mark.parametrize(
    ("zone", "says"),
    [
        (
            "{type: oval, sid: 1}",
            ".sid = 1: unknown parameter of the zone 'oval'; known: side, corners, form,",
        ),
        ("{type: oval, law: 1}", ".law = 1: unknown parameter"),
        ("{type: oval, side: wide}", ".side = 'wide': must be a number"),
        ("{type: oval, side: true}", ".side = True: must be a number"),
        ("{type: oval, side: .inf}", ".side = inf: must be finite"),
        ("{type: oval, count: 1.5}", ".count = 1.5: must be a whole number"),
        ("{type: oval, sharp: 1}", ".sharp = 1: must be true or false"),
        ("{type: oval, form: square}", ".form = 'square': Input should be 'round' or 'flat'"),
        ("{type: oval, corners: 3}", ".corners = 3: must be a list"),
        ("{type: oval, corners: [[1, 2], [3, x]]}", ".corners[1][1] = 'x': must be a number"),
        ("{type: oval, side: -1}", ".side = -1: must be positive"),
        ("{type: oval, count: 3}", " = {'count': 3, 'type': 'oval'}: too many of them"),
        (
            "{type: oval, count: -1}",
            " = {'count': -1, 'type': 'oval'}: the zone 'oval' cannot be made: ZeroDivisionE",
        ),
        (
            "{type: ovum}",
            " = {'type': 'ovum'}: unknown braking zone; known: uniform, ellipse, protective_field, ",
        ),
    ],
)
def test_parameters_are_checked_by_their_annotations(zone, says):
    load_plugin(module("ovals", OVAL))
    assert refused(zone).startswith(says)


def test_a_parameter_without_a_default_is_needed():
    load_plugin(module("ovals", OVAL.replace("side: float = 0.5", "side: float")))
    assert refused("oval") == ".side: is missing"


BROKEN = {
    "syntax": ("def", "cannot be imported: SyntaxError"),
    "raises": ("raise RuntimeError('no licence\\nat all')", "cannot be imported: RuntimeError: no licence"),
    "needs": (
        "import surely_not_installed",
        "cannot be imported: ModuleNotFoundError: No module named 'surely",
    ),
    "own_error": ("class Odd(Exception): pass\nraise Odd('so')", "cannot be imported: Odd: so"),
    "leaves": ("import sys\nsys.exit(0)", "cannot be imported: SystemExit: 0"),
    "empty": ("x = 1", "holds no braking zone; expected a dataclass"),
    "nameless": (OVAL.replace('ClassVar[str] = "oval"', 'ClassVar[str] = ""'), "holds no braking zone"),
    "odd_name": (OVAL.replace('"oval"', '"an oval"'), "Oval.type_name = 'an oval': expected letters"),
    "taken": (OVAL.replace('"oval"', '"ellipse"'), "Oval.type_name = 'ellipse': is built in"),
    "plain": (
        OVAL.replace(DATACLASS, ""),
        "Oval: is no dataclass; expected @dataclass(frozen=True, kw_only=True)",
    ),
    "abstract": (OVAL.replace("def shape", "def form_"), "Oval: is abstract; expected it to define shape"),
    "twice": (OVAL + OVAL.replace("class Oval", "class Ovum"), "two zones are called 'oval'"),
    "types": (OVAL.replace("count: int", "count: Missing"), "its fields have types that cannot be found"),
    "arrays": (
        OVAL.replace("count: int = 1", "count: np.ndarray = 1"),
        "a field has a type that no file can give",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_module_that_brings_no_zone_is_refused_in_a_line(name, capsys, workshop):
    text, says = BROKEN[name]
    (workshop / "good.yaml").write_text(EXAMPLE)
    code = "from __future__ import annotations\n" + text if name == "types" else text
    assert main(["good.yaml", "--out", "out", "--plugin", module(f"is_{name}", code)]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    (line,) = told.err.splitlines()
    assert line.startswith(("verify: plugin is_", "verify: the zone 'oval'"))
    assert says in line
    assert not (workshop / "out").exists()


@pytest.mark.parametrize(
    "name", ["no_such_module", "no.such.module", "a-b", "../x", "", "ovals.py", "x\x1b[2Jy"]
)
def test_what_is_no_module_is_refused(name, capsys):
    module("ovals", OVAL)
    assert main(["absent.yaml", "--plugin", name]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("verify: plugin ")
    assert line.isprintable()


def test_two_modules_cannot_have_zones_of_one_name():
    load_plugin(module("ovals", OVAL))
    with pytest.raises(PluginError, match="the zone 'oval' is already registered by ovals"):
        load_plugin(module("others", OVAL))


def test_an_interruption_is_no_fault_of_a_plugin():
    with pytest.raises(KeyboardInterrupt):
        load_plugin(module("slow", "raise KeyboardInterrupt"))


def test_checking_a_result_loads_plugins_too(capsys):
    assert main(["check", "results", "--plugin", "no_such_module"]) == 2
    assert "plugin no_such_module cannot be imported" in capsys.readouterr().err
    assert main(["check", "results", "--plugin", module("ovals", OVAL)]) == 2
    assert "results: not a result folder" in capsys.readouterr().err
    assert known_types()[-1] == "oval"


# --- the conformance kit ---


def test_a_zone_that_breaks_the_rules_is_refused_with_its_reason():
    load_plugin(module("ovals", OVAL.replace("return h,", "return 0.9 * h,")))
    text = refused("{type: oval, side: 0.7}")
    assert ": is refused: straight stop: the zone lacks" in text
    load_plugin(
        module("wrong", OVAL.replace('"oval"', '"skew"').replace("self.side**2 - 1.0", "1.0 - self.side**2"))
    )
    assert ": is refused: slope: dh/dangle is" in refused("{type: skew, side: 0.7}")
    assert asked("{type: skew, side: 1.0}").problem.zone is not None  # the slope is zero, either way


def test_a_zone_that_fails_is_refused_in_a_line():
    load_plugin(module("ovals", OVAL.replace("np.hypot(np.cos(angle)", "np.hypot(np.cosinus(angle)")))
    assert ": the zone 'oval' fails: AttributeError: module 'numpy' has no attribute" in refused("oval")


LATER = OVAL.replace(
    "    def shape(self, angle):\n",
    "    def shape(self, angle):\n        if Path('now').exists():\n            raise %s('at some angle')\n",
).replace("\nimport numpy", "\nfrom pathlib import Path\nimport numpy")


@pytest.mark.parametrize("error", ["ZeroDivisionError", "Own"])
def test_a_zone_that_fails_while_it_is_used_is_the_plugin_s_fault(error, workshop):
    load_plugin(module("later", LATER % error + "\nclass Own(Exception): ...\n"))
    zone = asked("{type: oval, side: 0.7}").problem.zone
    (workshop / "now").touch()
    with (
        pytest.raises(
            PluginError,
            match=f"^the braking zone 'oval' of the plugin later fails: {error}: at some angle$",
        ),
        plugins.Watched(),
    ):
        zone.support(0.0, 1.0)
    with pytest.raises(ZeroDivisionError), plugins.Watched():  # which is no plugin's
        _ = 1 / 0
    with pytest.raises(KeyboardInterrupt), plugins.Watched():
        raise KeyboardInterrupt


def test_a_run_whose_zone_fails_could_not_finish(workshop, monkeypatch, capsys):
    def fails(scenario, *_args, **_how):
        scenario.problem.zone.support(0.0, 1.0)

    load_plugin(module("later", LATER % "RuntimeError"))
    (workshop / "s.yaml").write_text(EXAMPLE.replace("zone: uniform", "zone: oval"))
    asked("oval")
    monkeypatch.setattr(pipeline, "run_scenario", lambda *a, **k: (Path("now").touch(), fails(*a, **k)))
    assert main(["s.yaml"]) == 3
    told = capsys.readouterr().err
    assert "the braking zone 'oval' of the plugin later fails: RuntimeError: at some angle" in told
    assert "fault of ours" not in told
    assert "Traceback" not in told


# --- which plugin it is ---


def test_a_plugin_is_known_by_its_module_and_its_source(workshop):
    load_plugin(module("ovals", OVAL))
    told = identity("oval")
    source = (workshop / "ovals.py").read_bytes()
    assert told == {"module": "ovals", "sha256": hashlib.sha256(source).hexdigest()}
    result = {"zone": {"type": "oval", "parameters": {}, "plugin": told}}
    assert differences(result) == ()
    nested = {"zone": {"type": "field_set", "parameters": {"base": {"type": "oval"}}, "plugin": told}}
    assert differences(nested) == ()
    (workshop / "ovals.py").write_text(OVAL + "# changed\n")
    for made in (result, nested):
        (reason,) = differences(made)
        assert reason.startswith(
            "the plugin ovals is not the one this was made with: SHA-256 of its source is "
        )
    assert identity("nowhere") == {}
    for odd in ({}, {"zone": 3}, {"zone": {"plugin": told}}, {"zone": {"type": [], "plugin": told}}):
        assert differences(odd) == ()


def test_an_installed_plugin_is_known_by_its_package_too():
    module("lazy", OVAL)
    install("lazy", "oval = lazy:Oval")
    Path("lazy-1.0.dist-info/top_level.txt").write_text("lazy\n")
    told = identity("oval")
    assert (told["distribution"], told["version"]) == ("lazy", "1.0")


# --- entry points ---


def test_an_entry_point_is_loaded_only_when_its_zone_is_asked_for():
    module("lazy", f"from pathlib import Path\nPath('loaded').touch()\n{OVAL}")
    module("other", "raise RuntimeError('never asked for')")
    install("lazy", "oval = lazy:Oval")
    install("other", "never = other:Zone")
    assert known_types()[-2:] == ("never", "oval")
    assert asked("ellipse").problem.zone is not None
    assert "unknown braking zone; known: " in refused("{type: lazy}")  # nor by the module's name
    assert not Path("loaded").exists()
    assert asked("{type: oval, side: 0.7}").problem.zone.side == 0.7
    assert Path("loaded").exists()


def test_an_entry_point_may_name_a_module():
    module("lazy", OVAL)
    install("lazy", "oval = lazy")
    assert asked("oval").problem.zone.side == 0.5


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        (
            "oval = absent:Oval",
            "oval = absent:Oval of vnav_drake.zones cannot be imported: ModuleNotFoundError",
        ),
        ("oval = lazy:Ovum", "cannot be imported: AttributeError"),
        ("oval = lazy:HEAD", "cannot be imported: AttributeError"),
        ("oval = lazy:np", "holds no braking zone"),
        ("oval = lazy:EllipseZone", "is no braking zone with type_name 'oval'"),
        ("ovum = lazy:Oval", "is no braking zone with type_name 'ovum'"),
        ("ovum = lazy", "is no braking zone with type_name 'ovum'"),
    ],
)
def test_an_entry_point_that_brings_no_such_zone_is_refused(entry, says):
    module("lazy", OVAL)
    install("lazy", entry)
    assert says in refused(f"{{type: {entry.split()[0]}}}")


def test_two_packages_cannot_have_zones_of_one_name():
    install("one", "oval = one:Oval")
    install("two", "oval = two:Oval")
    assert "several packages register a zone 'oval': one:Oval, two:Oval; expected one" in refused("oval")


def test_a_module_that_is_named_comes_before_an_entry_point():
    install("broken", "oval = absent:Oval")
    load_plugin(module("ovals", OVAL))
    assert asked("oval").problem.zone.side == 0.5


def test_a_built_in_zone_is_never_taken_from_a_package():
    module("evil", "raise RuntimeError('loaded')")
    install("evil", "ellipse = evil:Zone", "uniform = evil:Zone")
    assert type(asked("ellipse").problem.zone).__name__ == "EllipseZone"
    assert asked("uniform").problem.zone is None
