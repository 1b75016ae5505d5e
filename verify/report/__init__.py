"""The report: one self-contained HTML page a scenario, and an index of all of them."""

from verify.report.drawings import ClassDrawing, GraphDrawing, SpeedGraphDrawing, VcDrawing
from verify.report.executed_thumbnail import executed_thumbnail
from verify.report.index import write_index
from verify.report.page import ReportExtras, write_report

__all__ = [
    "ClassDrawing",
    "GraphDrawing",
    "ReportExtras",
    "SpeedGraphDrawing",
    "VcDrawing",
    "executed_thumbnail",
    "write_index",
    "write_report",
]
