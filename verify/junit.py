"""Gates as JUnit XML, for CI servers."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from verify.judge import Judgement

# Characters that XML 1.0 cannot hold at all.
_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


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
    for entry in suite.missing:
        _case(element, suite, entry.partition(":")[0], "error", entry)
    if suite.judgement is not None:
        judgement = suite.judgement
        for gate in judgement.gates:
            if gate.passed is None:
                kind = "failure" if gate.named else "skipped"
                _case(element, suite, gate.name, kind, gate.reason)
            else:
                text = f"value {gate.value!r}, limit {gate.limit!r}"
                _case(element, suite, gate.name, "" if gate.passed else "failure", text)
        broken = [f"{c.name} of {c.trajectory}: {c.message}" for c in judgement.failing_checks]
        good = judgement.verdict != "failed" and not broken
        text = "\n".join([*judgement.reasons, *broken])
        _case(element, suite, "verdict", "" if good else "failure", text or judgement.verdict)
    cases = list(element)
    element.set("tests", str(len(cases)))
    for count, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        element.set(count, str(sum(case.find(tag) is not None for case in cases)))
    return element


def _case(parent: ElementTree.Element, suite: Suite, name: str, kind: str, text: str) -> None:
    case = ElementTree.SubElement(parent, "testcase", classname=_text(suite.name), name=_text(name))
    if kind:
        mark = ElementTree.SubElement(case, kind, message=_text(text))
        mark.text = _text(text)


def _text(text: str) -> str:
    return _ILLEGAL.sub("\ufffd", text)
