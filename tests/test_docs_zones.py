"""What the page about braking zones claims is computed again: exact cases, derivations, examples."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from benchmarks import figures_zones as pictures
from tests.zone_case import zone_scenario
from verify.report.zone_along import arc_points, held_arc_length
from vnav_drake.braking import UniformBraking
from vnav_drake.scenario import load_scenario
from vnav_drake.zones.convex_zone import GaugeZone
from vnav_drake.zones.held_arc import arc_excess, greatest_turn, least_ahead
from vnav_drake.zones.shapes import EllipseZone, ProtectiveField
from vnav_drake.zones.touch import stopping_room

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "braking_zones.md").read_text(encoding="utf-8")
LAW = UniformBraking(max_braking=1.0)
LONG = 50.0  # [m], half a wall: its ends are never touched


def ellipse(beta: float, radius: float = 0.4, **more: float) -> EllipseZone:
    return EllipseZone(law=LAW, radius=radius, lateral_ratio=beta, **more)


def room(zone: GaugeZone, corners: list[list[float]]) -> float:
    return float(stopping_room(zone, np.array([corners]))[0][0])


def corridor(beta: float, turned: float = 0.0) -> float:
    """Greatest speed [m/s] in a corridor of half-width 1 m, `turned` [rad] from its axis."""
    cos, sin = math.cos(turned), math.sin(turned)
    wall = np.array([[-LONG, 1.0], [LONG, 1.0]]) @ np.array([[cos, -sin], [sin, cos]])
    return math.sqrt(2.0 * room(ellipse(beta), wall.tolist()))


def approach(reaction_time: float) -> float:
    """Time [s] of a capsule towards a wall, from 10 m to 2 m of free length, by the braking law itself."""
    law = UniformBraking(max_braking=1.0, reaction_time=reaction_time)
    zone = ProtectiveField(law=law, radius=0.4)
    free = np.linspace(10.0, 2.0, 2001)
    wall = np.stack(
        [np.stack([free + 0.4, np.full_like(free, side)], axis=1) for side in (-9.0, 9.0)], axis=1
    )
    length, _ = stopping_room(zone, wall)
    assert length == pytest.approx(free, rel=1e-12)
    pace = 1.0 / law.speed(length)
    return float(np.sum(pace[:-1:2] + 4.0 * pace[1::2] + pace[2::2]) * (free[0] - free[1]) / 3.0)  # Simpson


def test_the_exact_cases_of_the_page_are_what_the_package_computes():
    block = PAGE.split("<!-- exact cases -->")[1].split("<!-- end of exact cases -->")[0]
    rows = [line.strip("|").split("|") for line in block.strip().splitlines()[2:]]
    values = [float(row[2].split()[0]) for row in rows]
    betas = (1.0, 0.5, 0.3)
    # sqrt(2 a (W - rho)/beta); h_E(45 degrees) = sqrt((1 + beta^2)/2); x - sqrt(rho^2 - y^2)
    closed = [math.sqrt(1.2 / beta) for beta in betas]
    closed.append(math.sqrt(1.2 / math.sqrt((1.0 + 0.3**2) / 2.0)))
    speeds = [*(corridor(beta) for beta in betas), corridor(0.3, math.pi / 4.0)]
    assert speeds == pytest.approx(closed, rel=1e-12)
    capsule = room(ProtectiveField(law=LAW, radius=0.4), [[3.0, 0.3]])
    assert capsule == pytest.approx(3.0 - math.sqrt(0.4**2 - 0.3**2), rel=1e-12)
    lengths = [room(ellipse(beta), [[3.0, 1.0]]) for beta in betas[1:]]
    assert values[:7] == pytest.approx([*speeds, *lengths, capsule], abs=1e-9)
    assert values[7:10] == pytest.approx([12.0 / speed for speed in speeds[:3]], abs=5e-4)
    # v = sqrt(2 a length), t_r = 0; with a lag v = sqrt((a t_r)^2 + 2 a length) - a t_r
    assert values[10:] == pytest.approx([approach(0.0), approach(0.3)], abs=1e-8)


@pytest.mark.parametrize("beta", pictures.BETAS)
def test_beside_a_wall_a_turn_demands_the_deceleration_derived(beta):
    # v^2 along an arc by the package's own greatest speeds; its slope by central differences, 2e-6 m apart
    zone, distance, step = ellipse(beta, radius=0.0), 1.0, 1e-6

    def square(way: float, heading: float, bend: float) -> float:
        # place and heading after `way` on the arc; the wall is ahead across, its normal at angle -heading
        at, turned = arc_points(abs(way), math.copysign(bend, way * bend))[-1], heading + bend * way
        off = math.copysign(1.0, way) * (math.cos(heading) * at[0]) - math.sin(heading) * at[1]
        left = distance - off
        normal = np.array([math.cos(turned), -math.sin(turned)])
        along = np.array([-normal[1], normal[0]])
        return 2.0 * room(
            zone, [(left * normal - LONG * along).tolist(), (left * normal + LONG * along).tolist()]
        )

    for heading in (0.3, 0.8, 1.2):
        here = square(0.0, heading, 0.0)
        bend = -1.0 / here  # lambda = |kappa| v^2/a_b = 1, turning towards the wall
        slope = (square(step, heading, bend) - square(-step, heading, bend)) / (2.0 * step)
        assert -0.5 * slope == pytest.approx(float(pictures.demand(np.array(heading), beta, 1.0)), abs=1e-5)


def test_the_demands_told_are_the_greatest_of_their_curves():
    (told,) = re.findall(r"greatest ([\d., and]+) for β = ([\d., and]+)\]", PAGE)
    greatest, betas = ([float(v) for v in re.findall(r"\d+\.\d+", part)] for part in told)
    angle = np.linspace(0.0, math.pi / 2, 20001)
    found = [float(pictures.demand(angle, beta, 1.0).max()) for beta in betas]
    assert greatest == pytest.approx(found, abs=5.01e-3)
    assert pictures.demand(angle, 1.0, 1.0).max() == 1.0  # a disc never demands more than there is


def test_stops_that_share_friction_are_those_of_the_page():
    row = re.search(r"\| chord / D \| ([\d.]+) \| ([\d.]+) \|", PAGE).groups()
    for share, told in zip((0.5, 1.0), row, strict=True):
        turn, length = pictures.shared_stop(share)
        chord = float(np.hypot(*arc_points(length, turn / length)[-1]))
        assert chord == pytest.approx(4.0 * math.sin(math.asin(share) / 4.0) / share, rel=1e-12)
        assert float(told) == pytest.approx(chord, abs=5e-4)
    # the report reckons the same stop: mu g = 0.6 * 9.81 with a_b as large
    base = zone_scenario().problem
    grip = base.robot.friction_acceleration
    equal = UniformBraking(max_braking=grip)
    v, share = 1.7, 0.8
    length = held_arc_length(pictures.replace(base, braking=equal), v, share * grip / v**2)
    assert length / (v**2 / (2.0 * grip)) == pytest.approx(pictures.shared_stop(share)[1], rel=1e-12)


def test_arcs_of_the_reserve_stay_in_the_ellipses_of_the_page():
    turn = pictures.reserved_turn(1.2)
    told = re.search(r"that is ([\d.]+): A = ([\d.]+) for\s+β = 0\.5 and ([\d.]+) for 0\.3", PAGE)
    assert float(told[1]) == pytest.approx(turn, abs=5e-4)
    for beta, words in ((0.5, told[2]), (0.3, told[3])):
        long = least_ahead(beta, turn)
        assert float(words) == pytest.approx(long, abs=5e-3)
        turns = np.linspace(1e-3, turn, 200)
        assert arc_excess(ellipse(beta, ahead=long), turns)[0].max() <= 1e-9
        assert arc_excess(ellipse(beta, ahead=1.0), turns)[0].max() > 0.0
    # with A = 1 a centred ellipse holds small turns from beta = sqrt(3)/2 on, and none below
    assert greatest_turn(ellipse(math.sqrt(0.75) + 1e-3), 1.0) > 0.0
    assert greatest_turn(ellipse(math.sqrt(0.75) - 1e-2), 1.0) == 0.0


def test_what_is_shown_is_there():
    for image in re.findall(r"\]\((images/\S+)\)", PAGE):
        assert (ROOT / "docs" / image).exists()
    for name in ("shapes", "held", "demand"):
        assert pictures.FIGURES[name]().axes
    assert "images/braking_zones_route.svg" in PAGE


def test_the_route_of_the_readme_is_as_fast_as_it_says():
    base = load_scenario(ROOT / "scenarios" / "warehouse.yaml").problem
    zone = EllipseZone(law=base.braking, radius=base.robot.radius, lateral_ratio=0.5)
    motion, uniform = pictures.corner(pictures.replace(base, zone=zone))
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    times = [motion.travel_time, uniform.travel_time]
    told = re.search(r"route takes ([\d.]+) s instead of ([\d.]+) s under the zone alone", readme).groups()
    assert [float(time) for time in told] == pytest.approx(times, abs=0.05)
    caption = r"with it \(([\d.]+) s\) and with uniform braking \(([\d.]+) s\)"
    for found in (re.search(caption, readme), re.search(r"speeds, ([\d.]+) s against ([\d.]+) s\]", PAGE)):
        assert [float(time) for time in found.groups()] == pytest.approx(times, abs=0.005)
    # 12 m along a corridor with room for 0.6 m beside the robot: v = sqrt(2 a 0.6/beta), a = 1 m/s^2
    corridors = re.search(
        r"takes \[([\d.]+) s\].* as\nit is long and ([\d.]+) s with uniform", readme
    ).groups()
    exact = [12.0 / math.sqrt(1.2 / beta) for beta in (0.5, 1.0)]
    assert [float(time) for time in corridors] == pytest.approx(exact, abs=0.005)
    # with uniform braking the optimum is in [25.44124, 25.44170] s; the disc in the zone has
    # twice the a_b, so all its times fall by sqrt(2), and nothing with the zone beats it
    assert uniform.travel_time == pytest.approx(25.4417, rel=2e-5)
    assert motion.travel_time >= 25.44124 / math.sqrt(2.0)


def test_the_zone_shown_for_scenario_files_is_read(tmp_path):
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    content = yaml.safe_load((ROOT / "scenarios" / "warehouse.yaml").read_text(encoding="utf-8"))
    content["braking"] = yaml.safe_load(block)["braking"]
    file = tmp_path / "shown.yaml"
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    problem = load_scenario(file).problem
    assert isinstance(problem.zone, EllipseZone)
    assert (problem.zone.lateral_ratio, problem.friction_reserve) == (0.5, True)
