"""Braking zones as the judge sees them: what is asked for, its reach, its distance to obstacles.

Own formulas and own geometry: of the planners' zones only those of plugins are used, whose functions nobody
else has.
"""

from verify.judge.zones.asked import AskedZone, asked_zone
from verify.judge.zones.errors import ZoneError
from verify.judge.zones.held import least_arc_room, outside
from verify.judge.zones.sampled import sampled_faults
from verify.judge.zones.separation import least_separation, separation
from verify.judge.zones.shapes import Shape
from verify.judge.zones.zone import FieldSet, ForeignZone, GaugeZone, Zone

__all__ = [
    "AskedZone",
    "FieldSet",
    "ForeignZone",
    "GaugeZone",
    "Shape",
    "Zone",
    "ZoneError",
    "asked_zone",
    "least_arc_room",
    "least_separation",
    "outside",
    "sampled_faults",
    "separation",
]
