"""Fixed words of the report: names of gates, checks and limits, the glossary with its sources."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

THESIS = "Manor 2015"


@dataclass(frozen=True)
class GateWords:
    """How a gate's figure is written."""

    title: str
    meaning: str
    unit: str  # "%" for ratios
    at_least: bool = False  # the gate holds when value >= limit


GATES: Mapping[str, GateWords] = MappingProxyType(
    {
        "analytic_gap": GateWords(
            "Analytic gap", "speed graph against the variational collocation of the same model", "%"
        ),
        "refinement_gap": GateWords(
            "Refinement gap",
            "full robot against the variational optimum plus the proven cost of its ends",
            "%",
        ),
        "certified_gap": GateWords(
            "Certified gap", "best time of the variational model against the global lower bound", "%"
        ),
        "constraint_violation": GateWords(
            "Constraint violation", "worst normalised violation of any limit, in continuous time", "1"
        ),
        "braking_margin": GateWords(
            "Braking margin", "least of clearance minus braking distance along the motion", "m", at_least=True
        ),
        "emergency_stops": GateWords(
            "Emergency stops", "simulated stops that collide, fall or leave the zone claimed", "stops"
        ),
    }
)

GAPS: Mapping[str, str] = MappingProxyType(
    {
        "analytic": "Analytic gap",
        "refinement": "Refinement gap",
        "certified": "Certified gap",
        "certified_full": "Certified gap, full robot",
    }
)

VERDICTS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "certified": (
            "Certified",
            "The variational optimum satisfies every limit of the full robot, "
            "and its certified gap is within the gate.",
        ),
        "refined": ("Refined", "The motion is the collocation of the full robot, and it passed all checks."),
        "failed": ("Failed", "No trajectory passed all checks."),
    }
)

CHECKS: Mapping[str, str] = MappingProxyType(
    {
        "boundary": "Stays within the boundary",
        "start": "Begins at the start",
        "goal": "Ends at the goal",
        "clearance": "Touches no obstacle",
        "braking_distance": "Can stop within its clearance",
        "uniform_distance": "Keeps to uniform braking",
        "braking_arc": "Held arcs stay in the zone",
        "friction_circle": "Friction circle",
        "tip_over": "Tip-over",
        "steering": "Steering",
        "drive": "Drive and brakes",
        "speed": "Speed limits",
        "travel_time": "Travel time adds up",
        "tracking": "Tracking in simulation",
        "fields": "Fields hold what they claim",
        "certificate": "Certificate of the lower bound",
        "emergency_stops": "Emergency stops",
    }
)

LIMITS: Mapping[str, str] = MappingProxyType(
    {
        "start": "the speed or heading asked at the start",
        "goal": "the speed or heading asked at the goal",
        "braking_distance": "the braking zone",
        "braking_arc": "the limit of held arcs",
        "friction_circle": "the friction circle",
        "tip_over": "the tip-over limit",
        "steering": "the steering limit",
        "drive": "the drive and brake limits",
        "speed": "the speed limits",
    }
)

# The same in a chart or a table, where there is no room; other names as they are.
BROKEN: Mapping[str, str] = MappingProxyType(
    {
        "start": "start heading or speed",
        "goal": "end heading or speed",
        "drive": "drive and brakes",
        "braking_distance": "braking zone",
        "braking_arc": "held arc",
    }
)

# Why the lower bound was refined no further, by the words in result.json.
STOPPED: Mapping[str, str] = MappingProxyType(
    {
        "gap": "Refinement of the bound stopped as the gap asked for was reached.",
        "budget": "Refinement of the bound stopped as its budget of triangles was spent.",
        "time": "Refinement of the bound stopped at its time limit: another run may get further.",
        "precision": "Refinement of the bound stopped where the solver's precision ends.",
    }
)

# Why a run gave up on its way, by the words in result.json.
VEHICLES: Mapping[str, str] = MappingProxyType(
    {"four_wheel": "four-wheeled vehicle", "single_track": "single-track vehicle"}
)

STUCK: Mapping[str, str] = MappingProxyType(
    {
        "no_admissible_arc": "no arc lets it stop safely",
        "standing": "it stands",
        "oscillation": "it goes round in circles",
        "no_progress": "it comes no nearer to the goal",
        "too_many_decisions": "it ran out of decisions",
    }
)

# Conditions that make the path of a class its certified optimum, by the names in result.json.
CONDITIONS: Mapping[str, str] = MappingProxyType(
    {
        "residual": "tangents at its joins do not agree",
        "ridge": "a leg leaves the cell of its nearest feature",
        "class": "the path left the class",
        "node": "the path bends sharply at a Voronoi node",
    }
)

GLOSSARY: tuple[tuple[str, str, str], ...] = (
    ("Clearance d", "Distance from the robot's disc to the nearest obstacle or wall.", f"{THESIS}, Ch. 2"),
    (
        "Braking limit V(d)",
        "Greatest speed from which the robot stops within its clearance: √(2 a_b d) "
        "without reaction time and margin.",
        f"{THESIS}, eq. (3.13); reaction time and margin as in safety-scanner practice",
    ),
    (
        "Braking zone",
        "What must be free at a pose and a speed: a disc of the braking distance, or a shape that "
        "turns with the heading and grows with the speed (docs/braking_zones.md).",
        f"{THESIS}, Secs. 3.8 and 4.3",
    ),
    (
        "Friction reserve",
        "Lateral acceleration at most √((μg)² − a_b²), so that full braking is left in every bend.",
        "docs/braking_zones.md",
    ),
    (
        "Variational model",
        "The braking limit alone: no limit on turning, drive or steering. "
        "Every further limit can only raise its optimum.",
        f"{THESIS}, Ch. 3",
    ),
    (
        "Full robot",
        "Braking limit, friction circle, tip-over, steering, drive, speed and end speeds together.",
        f"{THESIS}, App. A and D",
    ),
    (
        "Friction circle",
        "Braking, driving and turning share the friction: a² + (v²κ)² ≤ (μg)², κ the curvature of the path.",
        f"{THESIS}, eq. (A.2), for combined forces: Kamm's circle",
    ),
    ("Tip-over", "The inner wheels lift when v²|κ| exceeds g w / 2h.", f"{THESIS}, eq. (A.3)"),
    ("Steering limit", "Smallest turning radius r_kin of the front-steered robot.", f"{THESIS}, eq. (A.1)"),
    (
        "Voronoi arc",
        "Points with two or more nearest obstacle features: locally the safest, and so the fastest, way.",
        f"{THESIS}, Sec. 3.4.5",
    ),
    (
        "Speed graph",
        "Points on the borders of the proximity cells, joined by the fastest safe paths within a cell; its "
        "best paths in different classes are then refined to their optima.",
        f"{THESIS}, Ch. 3, Definition 15",
    ),
    (
        "Position-velocity space",
        "Places of the robot with its speed v as height. Its free part F^v lies below the roof v = V(d).",
        f"{THESIS}, Sec. 2.3",
    ),
    (
        "vc-obstacle",
        "Places and speeds from which the robot cannot stop before an obstacle: a column, wider higher up.",
        f"{THESIS}, Definition 5",
    ),
    (
        "Critical points",
        "Type I, saddles: the lowest points of the roof along a Voronoi arc, where two vc-obstacles first "
        "touch. Type II, maxima: peaks of the roof at Voronoi nodes, where three first touch.",
        f"{THESIS}, Theorem 1 and Prop. 2.4.1; plateaus count as one point",
    ),
    (
        "Stack of cells",
        "The part of F^v around one maximum, parted from the next by vertical partitions through the "
        "saddles, and cut into cells by horizontal partitions at the heights of its critical points.",
        f"{THESIS}, Definitions 6 to 8",
    ),
    (
        "Type A and Type B edges",
        "Edges of the graph of cells: Type A lead through a saddle to the next stack, along a Voronoi arc; "
        "Type B lead up and down within a stack and cost nothing.",
        f"{THESIS}, Sec. 2.5",
    ),
    (
        "Published and realised cost",
        "Of a Type A edge. Published: speed lost and won at the limits, which ignores the length of the arc. "
        "Realised: the least time along the arc under V(d), a_max and a_b.",
        f"{THESIS}, Sec. 2.5; the realised one derived",
    ),
    (
        "Dynamic window approach",
        "A baseline that looks a second ahead: of the arcs and speeds within reach it drives the one that "
        "does best in heading, clearance and speed, as long as it can stop on it. It may get stuck.",
        "Fox, Burgard and Thrun 1997, IEEE Robot. Autom. Mag. 4(1); Brock and Khatib 1999, ICRA",
    ),
    (
        "Cold start",
        "A collocation that starts from the straight line from start to goal, whatever stands in the way.",
        "for comparison with seeds from the other methods",
    ),
    (
        "Homotopy class",
        "Paths that can be bent into each other without crossing an obstacle. Named by the gates passed, "
        "each gate by the two obstacles it lies between. A class has one optimum.",
        f"{THESIS}, Sec. 3.5; uniqueness derived from the curvature of the metric ds/V",
    ),
    (
        "Optimality bound",
        "Proven bound on how much faster than the given path any path of the same class can be.",
        "Derived: first variation in a space of non-positive curvature, from the kinks at the joins",
    ),
    (
        "Collocation",
        "The motion as many short intervals whose unknowns a nonlinear program chooses together.",
        "Hargraves and Paris 1987, J. Guidance 10(4)",
    ),
    (
        "Safe end",
        "The robot may start or end at any speed up to the braking limit there; a rest end demands zero.",
        f"{THESIS}, Ch. 3",
    ),
    (
        "Lower bound",
        "A travel time that no path of any homotopy class can beat, with a proof that is checked on its own.",
        "Derived: u with |∇u| ≤ 1/V(d) proves T ≥ u(goal) − u(start)",
    ),
    (
        "Potential, isochrone",
        "A function u of the place that no motion climbs faster than time passes; its lines of equal value.",
        "Derived: see docs/certificate.md",
    ),
    (
        "Slack",
        "What a triangle's bound on the slowness 1/V leaves above the slope of u, as a share of the bound.",
        "Derived: see docs/certificate.md",
    ),
    (
        "Cost of the ends E",
        "Proven extra time of a motion that must start or end at a given speed instead of the safe one.",
        "Derived: the way is cut where the safe speed can be reached, and compared with the straight chord",
    ),
    (
        "Worst violation",
        "Greatest breach of a limit divided by the limit, bounded between rows of the trajectory as well.",
        "Derived: distance is 1-Lipschitz and semiconcave along an arc",
    ),
    (
        "Emergency stop",
        "At an instant of the run the brakes are commanded: once with the steering held, once with the "
        "wheels straightened, as fast as the steering allows. It is bad when the vehicle collides, falls or "
        "does not come to rest; with the friction reserve also when it leaves the disc of the braking "
        "distance.",
        f"{THESIS}, Definition 9, takes that disc for the braking zone; sharing of friction derived",
    ),
    (
        "Friction reserve",
        "v²|κ| ≤ √((μg)² − a_b²): what full braking needs of the friction is left while turning.",
        "Derived from Kamm's circle",
    ),
    (
        "Slip",
        "Speed of a wheel's contact patch over the floor; a rolling wheel has next to none.",
        "Coulomb friction at the contact point of each wheel",
    ),
    (
        "Wheel load",
        "Force between a wheel and the floor; at rest a quarter of the weight. None is left when it lifts.",
        "contact force of the simulation",
    ),
    (
        "Grip in hand",
        "How far the whole speed profile can be scaled before the vehicle slides, tips or leaves its path, "
        "with drive and brakes as strong as that takes. It is no safe speed: braking zone and emergency "
        "stops are examined at the planned speed only.",
        "found by bisection on the simulated vehicle",
    ),
)
