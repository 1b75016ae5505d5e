"""Gates and the baseline as JUnit XML, for CI servers.

Elements and attributes are those that Jenkins, GitLab and the test reporters for GitHub read. Compute time
is of the whole run, so it stands at the case `verdict`, and sums of cases are the times of suites.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

from verify.cases import VERDICT, Case
from verify.suite import Suite

__all__ = ["Suite", "write_junit"]

# Characters that XML 1.0 cannot hold at all.
_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

# What kind of error; one for each status that is told as `error`.
_TYPES = {"error": "not_finished", "bad_input": "bad_input"}
_TAGS = {"passed": "", "failed": "failure", "skipped": "skipped", "error": "error", "bad_input": "error"}


def write_junit(file: Path, suites: Sequence[Suite]) -> None:
    """A suite a scenario, with its measured values as properties.

    It has one test case a gate, one for the verdict, and with a baseline one for each kind of figure. What
    was not evaluated is skipped, or failed where somebody asks for it by name. An error has the type
    `bad_input` where the file has to be mended, `not_finished` where a run could not finish.
    """
    root = ElementTree.Element("testsuites", name="verify", time=_seconds(sum(s.seconds for s in suites)))
    root.extend(_suite(suite) for suite in suites)
    for count in ("tests", "failures", "errors"):
        root.set(count, str(sum(int(child.get(count, "0")) for child in root)))
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)


def _suite(suite: Suite) -> ElementTree.Element:
    found = suite.cases
    element = ElementTree.Element(
        "testsuite",
        name=_text(suite.name),
        tests=str(len(found)),
        failures=_count(found, "failed"),
        errors=_count(found, *_TYPES),
        skipped=_count(found, "skipped"),
        time=_seconds(suite.seconds),
    )
    place = {"file": _text(suite.file)} if suite.file else {}
    element.attrib.update(place)
    properties = dict(_properties(suite))
    if properties:
        told = ElementTree.SubElement(element, "properties")
        for name, value in properties.items():
            ElementTree.SubElement(told, "property", name=_text(name), value=_text(value))
    for case in found:
        seconds = suite.seconds if case.name == VERDICT else 0.0
        _case(element, case, {"classname": _text(suite.name), "time": _seconds(seconds), **place})
    return element


def _properties(suite: Suite) -> Iterator[tuple[str, str]]:
    """Measured values by the names of `verify.metrics`, and what they belong to."""
    if suite.report:
        yield "report", suite.report
    if suite.version:
        yield "vnav_drake", suite.version
    if suite.run is not None:
        yield "verdict", suite.run.verdict
        yield "effort", suite.run.effort
        for metric in suite.run.metrics:
            yield metric.name, repr(metric.value)


def _case(parent: ElementTree.Element, case: Case, attributes: dict[str, str]) -> None:
    element = ElementTree.SubElement(parent, "testcase", {"name": _text(case.name), **attributes})
    tag = _TAGS[case.status]
    if tag:
        mark = ElementTree.SubElement(element, tag, message=_text(case.text))
        if case.status in _TYPES:
            mark.set("type", _TYPES[case.status])
        mark.text = _text(case.text)
    else:
        ElementTree.SubElement(element, "system-out").text = _text(case.text)


def _count(found: Iterable[Case], *statuses: str) -> str:
    return str(sum(case.status in statuses for case in found))


def _seconds(time: float) -> str:
    return f"{time:.3f}"


def _text(text: str) -> str:
    return _ILLEGAL.sub("\ufffd", text)
