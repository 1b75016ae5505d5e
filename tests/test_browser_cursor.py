"""What the cursor of the linked views reads, in a browser, against the motion itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from browser_case import Opened, browser, opened
from explorer_case import Case, make_case

from verify.report.explorer.cursor import CLEAR, joined, knots
from verify.report.html import script
from verify.report.series import distance_at
from vnav_drake.plan import Trajectory, arc_step

if TYPE_CHECKING:
    from playwright.sync_api import Browser

__all__ = ["browser"]

NAMES = ("x", "y", "heading", "v", "a", "curvature")
# single precision of a time of 30 s, 2e-6 s, tells two instants apart; steps of the drive are 1 m/s^2
ROUNDING = 1e-5


def swerving(case: Case) -> Trajectory:
    """1600 rows of about 10 ms from the start: drive and steering swing slowly, and jump every 40 rows."""
    n = 1600
    dt = np.tile([0.008, 0.012, 0.010, 0.014], n // 4)
    k = np.arange(n)
    a = 0.4 * np.sin(k / 90.0) * np.where(k // 40 % 2, 1.0, 0.5)
    curvature = 0.5 * np.cos(k / 150.0) * np.where(k // 40 % 2, 1.0, -0.6)
    v = np.concatenate([[0.6], 0.6 + np.cumsum(a * dt)])
    along = 0.5 * (v[1:] + v[:-1]) * dt
    heading = np.concatenate([[0.0], np.cumsum(curvature * along)])
    x, y = (np.concatenate([[0.0], np.cumsum(part)]) for part in arc_step(heading[:-1], curvature, along))
    x, y = x + case.motion.x[0], y + case.motion.y[0]
    t = np.concatenate([[0.0], np.cumsum(dt)])
    clearance = case.problem.clearance(np.column_stack([x, y]))
    return Trajectory(
        t, x, y, heading, v, np.append(a, a[-1]), np.append(curvature, curvature[-1]), clearance
    )


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return make_case(tmp_path_factory.mktemp("cursor") / "warehouse")


@pytest.fixture(scope="module")
def page(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    file = tmp_path_factory.mktemp("page") / "empty.html"
    file.write_text(
        '<!DOCTYPE html><html lang="en"><head><title>Cursor</title></head></html>', encoding="utf-8"
    )
    with opened(browser, file) as seen:
        yield seen
        seen.assert_quiet()


def read(page: Opened, case: Case, t: np.ndarray) -> dict[str, np.ndarray]:
    """What the page's own script reads at times `t`, by name."""
    found = page.run(
        """([text, source, times]) => {
          document.body.innerHTML = '<script type="application/json" id="explore-data"></script>';
          document.getElementById("explore-data").textContent = text;
          const data = new Function(`${source}; return vnavData;`)();
          return times.map((t) => data.here(t));
        }""",
        [str(case.sections()["explorer"].data), script("explorer_data.js"), t.tolist()],
    )
    return {name: np.array([row[name] for row in found]) for name in found[0]}


@pytest.mark.parametrize("kind", ["bend", "swerving"])
def test_the_cursor_reads_the_motion_and_not_a_line_between_samples(page: Opened, case: Case, kind: str):
    motion = case.motion if kind == "bend" else swerving(case)
    case = replace(case, evidence=replace(case.evidence, executed=motion))
    problem, robot = case.problem, case.problem.robot
    t = np.sort(np.random.default_rng(8).uniform(0.0, motion.t[-1], 3000))
    t = t[np.abs(t[:, None] - motion.t).min(axis=1) > ROUNDING]  # which side of a jump is then certain
    seen, own = read(page, case, t), dict(zip(NAMES, motion.at(t), strict=True))
    assert len(t) > 2000
    # a thousandth of the least limit, a_max = a_b = 1 m/s^2, in a and v^2 kappa
    within = 1e-3 + ROUNDING
    turn = own["v"] ** 2 * own["curvature"]
    np.testing.assert_allclose(seen["a"], own["a"], atol=within)
    np.testing.assert_allclose(seen["turn"], turn, atol=within)
    for name in ("x", "y", "v"):  # told with two decimals: a tenth of the last of them
        np.testing.assert_allclose(seen[name], own[name], atol=1e-3)
    np.testing.assert_allclose(seen["heading"], own["heading"], atol=2e-3)
    np.testing.assert_allclose(seen["s"], distance_at(motion, t), atol=1e-3)
    clearance = problem.clearance(np.column_stack([own["x"], own["y"]]))
    np.testing.assert_allclose(seen["clearance"], clearance, atol=CLEAR)
    np.testing.assert_allclose(seen["braking"], own["v"] ** 2 / 2.0, atol=3e-3)  # a_b = 1 m/s^2; v dv
    # margins by their formulas (Manor 2015, eqs. (3.13), (A.1) to (A.3))
    friction = robot.friction_acceleration - np.hypot(own["a"], turn)
    np.testing.assert_allclose(seen["margin.friction"], friction, atol=2.0 * within)
    np.testing.assert_allclose(seen["margin.drive"], 1.0 - own["a"], atol=within)
    np.testing.assert_allclose(seen["share.brakes"], 1.0 + own["a"], atol=within)
    np.testing.assert_allclose(seen["margin.tip"], robot.tip_acceleration - np.abs(turn), atol=within)
    np.testing.assert_allclose(seen["margin.braking"], clearance - own["v"] ** 2 / 2.0, atol=CLEAR + 3e-3)


def test_rows_that_continue_each_other_are_joined_and_jumps_are_kept():
    # 100 rows of 0.01 s at 1 m/s: a is 0, but 0.5 m/s^2 in the last 20; a kink of no duration after row 50
    t = np.insert(np.linspace(0.0, 1.0, 101), 51, 0.5)
    a = np.where(t < 0.8 - 1e-9, 0.0, 0.5)
    v = 1.0 + 0.5 * np.maximum(t - 0.8, 0.0)
    x = t + 0.25 * np.maximum(t - 0.8, 0.0) ** 2
    heading = np.where(np.arange(102) > 50, 1.0, 0.0)
    none = np.zeros(102)
    rows = joined(Trajectory(t, x, none, heading, v, a, none, none), 1e-3, 1e-3)
    np.testing.assert_allclose(rows["t"], [0.0, 0.5, 0.8, 1.0])
    np.testing.assert_array_equal(rows["heading"], [0.0, 1.0, 1.0, 1.0])
    np.testing.assert_array_equal(rows["a"], [0.0, 0.0, 0.5, 0.5])


def test_knots_keep_a_curve_within_its_bound():
    x = np.linspace(0.0, 6.0, 4000)
    y = np.abs(np.sin(x)) - 2.0 * x
    kept = knots(x, y, 1e-3)
    assert np.abs(np.interp(x, x[kept], y[kept]) - y).max() <= 1e-3
    assert len(kept) < 150
