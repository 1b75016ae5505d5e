"""What the page says of the two-room office (Manor 2015, Sec. 2.7.1), all of it from the study's data."""

from __future__ import annotations

import itertools

from benchmarks.reproduction.page import Data, Row, table

SAME = 1e-6  # [s] and [1]: far above what rounding does to times of 25 s, far below any difference shown
MODEST = 0.25  # greatest saving that we call "modest", a word of the text; ours


def summary(data: Data) -> list[Row]:
    """The crossing."""
    return [
        Row(
            what="two-room office: the upper passage is faster from delta on",
            place=data["printed"]["place"],
            printed=f"{data['printed']['crossing']:g}",
            ours=f"{data['crossing']:.4f}",
            note="reconstruction, laid out so that it comes near 3",
        )
    ]


def _ratio(row: Data) -> float:
    return float(row["vc_method"]["time"] / row["shortest"]["time"])


def _size(ratio: float) -> str:
    """A ratio of times in the words of the text."""
    if ratio > 1.0 - SAME:
        return "no gain at all, against the text"
    return (
        '"modest", as the text says' if ratio >= 1.0 - MODEST else 'far more than "modest", as the text says'
    )


def _shape(data: Data) -> str:
    """Whether the ratio of times over delta has the shape of Fig. 2.15."""
    before = [_ratio(row) for row in data["curve"] if row["delta"] < data["crossing"]]
    beyond = [_ratio(row) for row in data["curve"] if row["delta"] > data["crossing"]]
    constant = all(abs(r - 1.0) < SAME for r in before)
    falling = all(b < a for a, b in itertools.pairwise([1.0, *beyond]))
    parts = [
        (constant, "a constant ratio of 1 up to the crossing"),
        (constant and falling, "a kink there"),
        (all(1.0 - MODEST <= r < 1.0 for r in beyond), "a moderate gain beyond it"),
    ]
    texts = []
    for wanted, verb in ((True, "is confirmed"), (False, "is not confirmed")):
        named = [what for holds, what in parts if holds == wanted]
        if named:
            listed = ", ".join(named[:-1]) + " and " + named[-1] if len(named) > 1 else named[0]
            texts.append(f"What {verb} is the shape: {listed}.")
    spread = [*before, *beyond]
    return " ".join(texts) + f" The ratio runs from {max(spread):.3f} to {min(spread):.3f}."


def _by_published(data: Data) -> tuple[str, str]:
    """From which delta on the published cost takes the upper passage, and what that means."""
    curve = data["curve"]
    passages = [row["vc_method"]["passage_by_published_cost"] for row in curve]
    if "upper" not in passages:
        return f"never up to {curve[-1]['delta']:g}", "the cost of Sec. 2.5 knows no lengths"
    k = passages.index("upper")
    if k == 0:
        return f"{curve[0]['delta']:g}, the least tried", "the cost of Sec. 2.5 knows no lengths"
    if k == 1:
        note = "the cost of Sec. 2.5 knows no lengths: it prefers the wider passage as soon as it is wider"
        return f"{curve[1]['delta']:g}, the first tried above {curve[0]['delta']:g}", note
    note = f"between this and {curve[k - 1]['delta']:g}; the cost of Sec. 2.5 knows no lengths"
    return f"{curve[k]['delta']:g}", note


def _rows(data: Data) -> list[tuple[str, str, str, str]]:
    curve, printed = data["curve"], data["printed"]["crossing"]
    times = [row["shortest"]["time"] for row in curve]
    spread = max(times) - min(times)
    below = all(row["shortest"]["passage"] == "lower" for row in curve)
    delta = data["profiles"]["delta"]
    shown = min(curve, key=lambda row: abs(row["delta"] - delta))
    by_published, meaning = _by_published(data)
    return [
        (
            "the upper passage is the faster one from delta on",
            f"{printed:g}",
            f"{data['crossing']:.4f}",
            "both motions, corners rounded, take equally long",
        ),
        (
            "the vc-method changes to the upper passage at delta",
            f"{printed:g}",
            f"{data['switch']:.4f}",
            "its search adds up times along the arcs, corners and all",
        ),
        ("the same with the published edge cost", f"{printed:g}", by_published, meaning),
        (
            "shortest route passes below for all delta",
            "yes",
            "yes" if below else "no",
            f"delta from {curve[0]['delta']:g} to {curve[-1]['delta']:g}",
        ),
        (
            "t(l_min) is the same for all delta",
            "yes",
            "yes" if spread < SAME else f"no, within {spread:.1g} s",
            f"{times[0]:.2f} s" if spread < SAME else f"{min(times):.2f} to {max(times):.2f} s",
        ),
        (
            f"ratio t(vc-method) / t(l_min) at delta = {delta}",
            "figure only",
            f"{_ratio(shown):.3f}",
            f"{shown['vc_method']['time']:.2f} s against {shown['shortest']['time']:.2f} s;"
            f" {_size(_ratio(shown))}",
        ),
    ]


def section(data: Data) -> str:
    """What the page says."""
    layout, profiles = data["layout"], data["profiles"]
    short = sorted({s for row in data["curve"] for s in row["vc_method"]["shortfalls"]})
    higher, deeper = data["crossing_target_higher"], data["crossing_target_lower"]
    envelope = all(
        row["vc_method"]["time"] <= min(row["lower"]["time"], row["upper"]["time"]) + SAME
        for row in data["curve"]
    )
    lines = [
        "## Two-room office: how wide must the upper passage be?",
        "",
        "Manor 2015, Sec. 2.7.1: the lower passage is 1.5 robot diameters wide, the upper one delta times"
        " that; up to delta = 3 the lower passage is faster, beyond it the upper one. **A reconstruction**:"
        " Fig. 2.13 cannot be read, and neither room, robot nor limits are given in words. Ours is"
        f" {layout['size']:g} m square (the axes of the figure end at 300), the robot"
        f" {2 * layout['radius']:g} m wide, with {layout['acceleration']:g} m/s² both ways as in Sec. 2.8,"
        " from rest to rest; the table's upper edge is what moves.",
        "",
        "![Map](images/reproduction_two_rooms_map.svg)",
        "",
        table(("", "printed", "ours", "what it means"), _rows(data)),
        f"The target's height ({layout['target'][1]:g} m) was chosen so that the crossing comes near 3, so"
        f" that number confirms nothing by itself: with the target {abs(deeper['shift']):g} m lower the"
        f" crossing is {deeper['crossing']:.3f}, as much higher {higher['crossing']:.3f}. {_shape(data)}",
        "",
        "![Ratio of travel times over delta](images/reproduction_two_rooms_ratio.svg)",
        "",
        "In the manner of Fig. 2.15. Each curve is one passage; "
        + (
            "the lower envelope is the vc-method."
            if envelope
            else "the vc-method is not always their lower envelope."
        ),
        "",
        "![Speed over arc length](images/reproduction_two_rooms_speed.svg)",
        "",
        f"In the manner of Fig. 2.14, delta = {profiles['delta']}: speed over arc length as a part of the"
        f" whole. The greatest speed is {100 * max(profiles['upper']['speed']):.1f} cm/s; the axis of Fig."
        f" 2.14 ends at {100 * data['printed']['axis']:g}.",
        "",
        "What these motions cannot meet: "
        + ("; ".join(short) if short else "nothing, every limit is kept")
        + ".",
    ]
    return "\n".join(lines)
