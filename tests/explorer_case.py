"""Linked views of the warehouse made by hand: two of its motions stand for homotopy classes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from report_case import warehouse, write_folder

from verify.report import ReportExtras
from verify.report.drawings import ClassDrawing, SpeedGraphDrawing
from verify.report.evidence import Evidence, read_evidence
from verify.report.explorer import explorer_scripts, explorer_sections
from verify.report.html import content_policy, render, script, stylesheet
from vnav_drake.plan import Trajectory
from vnav_drake.problem import Problem

NO_CERTIFICATE = (None, "no lower bound was computed")


@dataclass(frozen=True)
class Case:
    """A result folder and what the views are made of."""

    problem: Problem
    result: dict[str, Any]
    evidence: Evidence
    extras: ReportExtras

    @property
    def motion(self) -> Trajectory:
        """The motion that the cursor follows."""
        assert self.evidence.executed is not None
        return self.evidence.executed

    def sections(self) -> dict[str, Any]:
        """What the template asks for."""
        return explorer_sections(self.problem, self.result, self.evidence, self.extras, None, NO_CERTIFICATE)


def make_case(folder: Path) -> Case:
    """The warehouse's folder, with a Voronoi arc along the bottom corridor and two classes."""
    scenario = warehouse()
    result = write_folder(folder, scenario)
    evidence = read_evidence(folder)
    classes = [
        ClassDrawing(
            rank=rank, name=f"class {rank}", points=np.column_stack([motion.x, motion.y]), motion=motion
        )
        for rank, motion in enumerate([evidence.plans["collocation"], evidence.plans["voronoi_route"]], 1)
    ]
    extras = ReportExtras(
        voronoi_polylines=[np.array([[2.0, 2.0], [30.0, 2.0]])],
        speed_graph=SpeedGraphDrawing(classes=classes),
    )
    return Case(scenario.problem, result, evidence, extras)


def write_page(file: Path, case: Case) -> Path:
    """The views alone as a page, under the policy that a report has."""
    sections = case.sections()
    names = explorer_scripts(sections)
    texts = [script(name) for name in names]
    body = render("explorer.html", **sections)
    file.write_text(
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{content_policy(texts, inline_styles=True)}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><title>Views</title>'
        f"<style>{stylesheet()}</style></head><body><main>{body}<p id='stills'>Stills</p></main>"
        + "".join(f"<script>{text}</script>" for text in texts)
        + "</body></html>",
        encoding="utf-8",
    )
    return file
