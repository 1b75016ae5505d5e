"""The index of a report folder: all scenarios side by side."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from verify import evidence
from verify.by_products import THUMBNAIL
from verify.defects import DEFECTS
from verify.evidence import EvidenceError
from verify.previous import read_previous
from verify.report import story
from verify.report.html import render, write_whole
from verify.report.index_changes import BETTER, MOVED, NEW, SAME, WORSE, ChangesCell, changes_cell
from verify.report.numbers import DASH, metres, number_in, percent, percent_or_times, seconds, seconds_proven
from verify.report.story_bound import least_time
from verify.report.wording import VERDICTS

SORTER = "index.js"
LARGEST_THUMBNAIL = 64 * 1024  # [bytes]: ours have a few thousand
_STANDINGS = ("bad", "open", "good")  # failing ones first
_VERDICTS = ("failed", "unknown", "refined", "certified")  # the worst first


@dataclass(frozen=True, kw_only=True)
class Cell:
    """A figure as it reads, and the number by which the column sorts; None is not sorted but last."""

    name: str
    text: str
    value: float | None


@dataclass(frozen=True, kw_only=True)
class IndexRow:
    """One scenario."""

    name: str
    link: str
    thumbnail: str  # data: address of the small map, or empty
    headline: str
    standing: str
    rank: int  # of the standing, failing ones first, then of the verdict
    gates: str
    failing: int
    figures: Sequence[Cell]
    changes: ChangesCell
    run: datetime | None  # when result.json was written


def write_index(file: Path, results: Sequence[tuple[str, Mapping[str, Any]]]) -> None:
    """Write the index page of `results`, pairs of a scenario's folder name beside `file` and its result.

    Failing scenarios come first. Small maps, the run before and the time of the run come from the folders;
    what is not there is left out, and so is a result of which no row can be made: it may be somebody else's.

    Raises
    ------
    OSError : the file cannot be written; an older one is untouched.
    """
    found = (_readable_row(file.parent, name, result) for name, result in results)
    rows = [row for row in found if row is not None]
    rows.sort(key=lambda row: (row.rank, row.name))
    counts = {kind: sum(row.standing == kind for row in rows) for kind in _STANDINGS}
    moved = [
        (word, sum(row.changes.rank == rank for row in rows))
        for rank, word in (
            (WORSE, "worse"), (MOVED, "changed"), (BETTER, "better"), (SAME, "as before"), (NEW, "new")
        )
    ]  # fmt: skip
    columns = [cell.name for cell in rows[0].figures] if rows else []
    text = render(
        "index.html",
        scripts=[SORTER] if rows else [],
        rows=rows,
        counts=counts,
        columns=columns,
        wbr=Markup("_<wbr>"),
        moved=[f"{number} {word}" for word, number in moved if number],
    )
    write_whole(file, text)


def _readable_row(out: Path, name: str, result: Mapping[str, Any]) -> IndexRow | None:
    try:
        return _row(out, name, result)
    except DEFECTS:
        return None


def _row(out: Path, name: str, result: Mapping[str, Any]) -> IndexRow:
    times, plan = story.travel_times(result), story.executed_plan(result)
    time, length = times.get(plan), number_in(result, "plans", plan, "length")
    optimum = next((times[name] for name in story.optima(result) if name in times), None)
    bound, simulated = least_time(result, plan), times.get("simulation")
    left = time / bound - 1.0 if time is not None and bound and time >= bound else None
    above = time / optimum - 1.0 if time is not None and optimum else None
    stops = story.stops_figure(result)
    bad = number_in(result, "simulation", "emergency_stops", "bad")
    gates = story.gate_rows(result)
    statuses = (story.FAILED, story.PASSED, story.NOT_EVALUATED)
    counts = {status: sum(row.status == status for row in gates) for status in statuses}
    standing = story.standing(result)
    folder = out / name
    return IndexRow(
        name=name,
        link=f"./{quote(name, safe='')}/report.html",
        thumbnail=_thumbnail(folder),
        headline=VERDICTS.get(story.verdict(result), ("No verdict", ""))[0],
        standing=standing,
        rank=len(_VERDICTS) * _STANDINGS.index(standing) + _VERDICTS.index(story.verdict(result)),
        gates=", ".join(f"{number} {word}" for word, number in counts.items() if number) or "none",
        failing=counts[story.FAILED],
        figures=[
            Cell(name="Travel time", text=seconds(time), value=time),
            Cell(name="Length", text=metres(length), value=length),
            Cell(name="Variational optimum", text=seconds(optimum), value=optimum),
            Cell(name="Above it", text=DASH if above is None else percent_or_times(above), value=above),
            Cell(name="Lower bound", text=seconds_proven(bound), value=bound),
            Cell(name="Gap to the bound", text=_left(result, left), value=left),
            Cell(name="Simulated", text=story.unfinished(result) or seconds(simulated), value=simulated),
            Cell(name="Bad stops", text=stops or DASH, value=bad if stops else None),
        ],
        changes=changes_cell(read_previous(folder), result, folder),
        run=_run_at(folder),
    )


def _left(result: Mapping[str, Any], left: float | None) -> str:
    """The gap in percent; where a gate limits this very gap, on its side of the limit."""
    limited = number_in(result, "gaps", "certified")
    same = left is not None and limited is not None and math.isclose(left, limited, rel_tol=1e-6)
    return story.gap_figure(result, "certified") if same else percent(left)


def _run_at(folder: Path) -> datetime | None:
    try:
        return datetime.fromtimestamp((folder / evidence.RESULT).stat().st_mtime, UTC)
    except OSError:
        return None


def _thumbnail(folder: Path) -> str:
    """As an image, in which no script runs: the folder may be somebody else's."""
    try:
        drawn = evidence.read_bytes(folder, THUMBNAIL)
    except EvidenceError:
        return ""
    if len(drawn) > LARGEST_THUMBNAIL or not drawn.startswith(b"<svg "):
        return ""
    return Markup("data:image/svg+xml;base64,") + base64.b64encode(drawn).decode()
