"""The one judge: reads a result folder and says what it proves.

It imports no planner, no distance query, braking law or speed profile: every quantity is recomputed
from the scenario's raw numbers and the rows of the trajectory files.
"""

from verify.judge.bound import Bound
from verify.judge.compare import compare, compare_files, gate_overrides
from verify.judge.finding import Check, Place
from verify.judge.gates import GATE_NAMES, Gate
from verify.judge.stops import in_words as stops_in_words
from verify.judge.verdict import SAME_TIME, Findings, Judgement, decide, exactly, examine, judge

__all__ = [
    "GATE_NAMES",
    "SAME_TIME",
    "Bound",
    "Check",
    "Findings",
    "Gate",
    "Judgement",
    "Place",
    "compare",
    "compare_files",
    "decide",
    "exactly",
    "examine",
    "gate_overrides",
    "judge",
    "stops_in_words",
]
