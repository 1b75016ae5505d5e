"""Gates as JUnit XML, for CI servers."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from verify.cases import cases
from verify.judge import Judgement

# Characters that XML 1.0 cannot hold at all.
_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

_TAGS = {"passed": "", "failed": "failure", "skipped": "skipped", "error": "error"}


@dataclass(frozen=True, kw_only=True)
class Suite:
    """One scenario: its judgement, or why there is none."""

    name: str
    judgement: Judgement | None = None
    error: str = ""
    missing: tuple[str, ...] = ()  # stages that could not finish, with the reason


def write_junit(file: Path, suites: Iterable[Suite]) -> None:
    """One test case a gate, and one for the verdict; gates that were not evaluated are skipped."""
    root = ElementTree.Element("testsuites")
    for suite in suites:
        root.append(_suite(suite))
    for count in ("tests", "failures", "errors", "skipped"):
        root.set(count, str(sum(int(child.get(count, "0")) for child in root)))
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)


def _suite(suite: Suite) -> ElementTree.Element:
    element = ElementTree.Element("testsuite", name=_text(suite.name))
    if suite.error:
        _case(element, suite, "scenario", "error", suite.error)
    if suite.judgement is not None:
        for case in cases(suite.judgement, suite.missing):
            _case(element, suite, case.name, _TAGS[case.status], case.text)
    found = list(element)
    element.set("tests", str(len(found)))
    for count, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        element.set(count, str(sum(case.find(tag) is not None for case in found)))
    return element


def _case(parent: ElementTree.Element, suite: Suite, name: str, kind: str, text: str) -> None:
    case = ElementTree.SubElement(parent, "testcase", classname=_text(suite.name), name=_text(name))
    if kind:
        mark = ElementTree.SubElement(case, kind, message=_text(text))
        mark.text = _text(text)


def _text(text: str) -> str:
    return _ILLEGAL.sub("\ufffd", text)
