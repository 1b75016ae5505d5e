"""Hostile scenario files: each is refused in bounded time and memory, and nothing else ever comes out."""

import os
import re
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from vnav_drake.scenario import Scenario, ScenarioError, load_scenario, parse_scenario, scenario_schema
from vnav_drake.scenario_file import MAX_BYTES

VALID = (Path(__file__).parent / "scenario_example.yaml").read_text()
HALL = "[[0, 0], [20, 0], [20, 20], [0, 20]]"

# --- files that are no text, or no file ---


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "1: is empty"),
        (b"# only a comment\n", "1: is empty"),
        (b"- 1\n", "must be a mapping"),
        (b"just text", "must be a mapping"),
        (b"schema: 1\nname: \x00\n", r"2: holds the character '\x00'"),
        (b"schema: 1\nname: \x1b[31m\n", r"2: holds the character '\x1b'"),
        (b"schema: 1\n# \xe2\x80\xa8\n", r"2: holds the character '\u2028'"),
        (b"\xef\xbb\xbf" + VALID.encode(), "1: starts with a byte order mark"),
        (VALID.encode("utf-16"), "1: starts with a byte order mark"),
        (VALID.encode("utf-16-le"), r"1: holds the character '\x00'"),
        (b"schema: 1\nname: caf\xe9\n", "2: byte 0xe9 is not UTF-8"),
        (b"\x80\x81\x82\x83", "1: byte 0x80 is not UTF-8"),
    ],
)
def test_bytes_that_are_no_scenario_are_refused(data, says):
    with pytest.raises(ScenarioError) as caught:
        parse_scenario(data, "f.yaml")
    assert says in str(caught.value)


def test_what_is_no_regular_file_is_refused_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "fifo.yaml")
    for path, says in [
        (tmp_path / "missing.yaml", "cannot be read: No such file"),
        (tmp_path, "is not a regular file"),
        (tmp_path / "fifo.yaml", "is not a regular file"),
        ("/dev/zero", "is not a regular file"),
        ("a\0b.yaml", "cannot be read"),
    ]:
        with pytest.raises(ScenarioError, match=re.escape(says)):
            load_scenario(path)


# --- hostile files ---


def many_obstacles(lines):
    return VALID.replace("    - {vertices: [[10, 9]]}", "\n".join(lines)).encode()


def crossing_walls(count=20_000):
    """Each horizontal wall crosses each vertical one: 10^8 crossings."""
    step = 8.0 / count
    across = (f"    - {{vertices: [[1, {1 + i * step!r}], [15, {1 + i * step!r}]]}}" for i in range(count))
    along = (f"    - {{vertices: [[{6 + i * step!r}, 1], [{6 + i * step!r}, 11]]}}" for i in range(count))
    return many_obstacles([*across, *along])


def nested_triangles(count=20_000):
    sizes = (1.0 + 3.0 * i / count for i in range(count))
    return many_obstacles(
        f"    - {{vertices: [[{8 - r!r}, {6 - r!r}], [{8 + r!r}, {6 - r!r}], [8, {6 + r!r}]]}}" for r in sizes
    )


LEVELS = "\n".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30))
HOSTILE = {
    "billion laughs": (f"a0: &a0 [lol]\n{LEVELS}\n".encode(), "anchor"),
    "recursive alias": (b"a: &a [*a]\n", "alias"),
    "recursive key": (b"&a {*a : 1}\n", "alias stands where a key"),
    "deep lists": (b"[" * 5_000_000, "nested more than"),
    "deep mappings": (b"a: " + b"{a: " * 1_500_000, "nested more than"),
    "deep blocks": (b"- " * 3_000_000, "nested more than"),
    "many values": (b"a: [" + b"0," * 3_900_000 + b"]", "holds more than 1,000,000 values"),
    "many keys": (b"".join(b"k%d:\n" % i for i in range(700_000)), "more than 100 keys"),
    "many faults": (
        VALID.replace(HALL, "[" + "a," * 900_000 + "]").encode(),
        " keys, types or ranges are wrong, too many to list",
    ),
    "many aliases": (b"a: &a 1\nb: [" + b"*a," * 2_000_000 + b"]", "too many faults"),
    "many anchors": (b"a: [" + b"&a 1," * 1_500_000 + b"]", "too many faults"),
    "long text": (b"schema: '" + b"\n" * 7_900_000 + b"'", "must be 1"),
    "long key": (b"? " + b"x" * 7_900_000 + b"\n: 1", "unknown key"),
    "long number": (VALID.replace("mass: 40.0", "mass: " + "9" * 7_000_000).encode(), "must be finite"),
    "crossing walls": (crossing_walls(), "cross one another more than 100,000 times"),
    "nested triangles": (nested_triangles(), "cross one another more than 100,000 times"),
    "many circles": (
        many_obstacles(["    - {circle: {center: [10, 9], radius: 0.5}}"] * 2_000),
        "vertices (a circle counts 96); expected at most 100,000",
    ),
    "ten million vertices": (
        VALID.replace(HALL, "[" + "[1, 2],\n" * 10_000_000 + "]").encode(),
        "bytes; a scenario has at most 8,000,000",
    ),
}
CHILD = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (2_000_000_000, 2_000_000_000))
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
from vnav_drake.scenario import ScenarioError, load_scenario
try:
    load_scenario(sys.argv[1])
except ScenarioError as error:
    print(error)
"""


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_file_is_refused_within_2_gb_and_a_minute_of_work(name, tmp_path):
    data, says = HOSTILE[name]
    path = tmp_path / "hostile.yaml"
    path.write_bytes(data)
    child = subprocess.run(
        [sys.executable, "-c", CHILD, str(path)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )
    assert child.returncode == 0, child.stderr[-2000:]
    assert says in child.stdout
    assert child.stdout.startswith(str(path))
    assert len(child.stdout) < 20_000


def test_no_more_than_the_limit_is_read(tmp_path):
    path = tmp_path / "sparse.yaml"
    with open(path, "wb") as file:
        file.truncate(10**12)
    with pytest.raises(ScenarioError, match="1,000,000,000,000 bytes; a scenario has at most 8,000,000"):
        load_scenario(path)
    with pytest.raises(ScenarioError, match="8,000,001 bytes"):
        parse_scenario(b" " * (MAX_BYTES + 1), "f.yaml")


# --- fuzzing ---

TOKENS = [
    "1e400",
    "-0.0",
    ".nan",
    "~",
    "[",
    "]",
    "{",
    "}",
    ":",
    "- ",
    "&a ",
    "*a",
    "!!int ",
    "'",
    '"',
    "|\n",
    "\n",
]
TOKENS += [
    "? ",
    "#",
    "---\n",
    "%YAML 1.1\n",
    "é",
    "\U0001f600",
    "\t",
    "  ",
    "0x1F",
    "1e-320",
    "99999999999999999999",
]


@st.composite
def mutated_text(draw):
    text = VALID
    for _ in range(draw(st.integers(1, 4))):
        first = draw(st.integers(0, len(text)))
        last = draw(st.integers(first, min(len(text), first + 30)))
        piece = draw(st.sampled_from(TOKENS) | st.text(max_size=8) | st.sampled_from(VALID.split()))
        text = text[:first] + piece + text[last:]
    return text.encode("utf-8", "surrogatepass")


NUMBERS = st.floats() | st.integers() | st.floats(-25.0, 25.0) | st.sampled_from([0, 1e5, 1e-9, 0.4, 20.0])
PAIRS = st.lists(NUMBERS, min_size=2, max_size=2)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=5) | PAIRS | st.lists(PAIRS, max_size=6),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@st.composite
def mutated_data(draw):
    """A valid scenario with some values replaced at random places."""
    data = yaml.safe_load(VALID)
    for _ in range(draw(st.integers(1, 3))):
        place, key = data, draw(st.sampled_from(list(data)))
        while isinstance(place[key], dict | list) and place[key] and draw(st.booleans()):
            place = place[key]
            key = draw(st.sampled_from(list(place) if isinstance(place, dict) else range(len(place))))
        place[key] = draw(VALUES)
    return data


def outcome(data):
    try:
        return parse_scenario(data, "f.yaml")
    except ScenarioError as error:
        return error


def is_scenario_or_error(result):
    if isinstance(result, ScenarioError):
        return all(line.startswith("f.yaml:") and line.isprintable() for line in result.faults)
    return isinstance(result, Scenario)


@settings(max_examples=300, deadline=None)
@given(mutated_text() | st.binary(max_size=60))
def test_no_text_gives_anything_but_a_scenario_or_its_error(data):
    assert is_scenario_or_error(outcome(data))


@settings(max_examples=300, deadline=None)
@given(mutated_data())
def test_no_data_gives_anything_but_a_scenario_or_its_error_and_the_schema_agrees(data):
    result = outcome(yaml.dump(data, allow_unicode=True).encode("utf-8", "surrogatepass"))
    assert is_scenario_or_error(result)
    if isinstance(result, Scenario):  # what is accepted, the schema accepts
        jsonschema.validate(data, scenario_schema(), jsonschema.Draft202012Validator)
