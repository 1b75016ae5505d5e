"""The block diagram of what runs, drawn from the diagram itself: systems, ports and wires."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties
from matplotlib.patches import FancyBboxPatch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.textpath import TextPath
from numpy.typing import NDArray

from verify.report.diagram_layout import (
    Block,
    Diagram,
    Graph,
    Link,
    Node,
    Wire,
    arranged,
    feedback,
    layers,
    passing,
    read_graph,
)
from verify.report.numbers import count
from verify.report.palette import INK, MUTED, PAPER, RACK_EDGE, method
from verify.report.svg import Picture, drawing_style, new_figure, to_svg

Array = NDArray[np.float64]

NAME_SIZE, KIND_SIZE, PORT_SIZE = 11.0, 9.0, 9.0  # [px]
HEAD, ROW, FOOT = 36.0, 15.0, 5.0  # [px] a box: name and class, one row for a port, below them
PAD = 8.0  # [px] between what is written and the box, and between ports
PASS = 4.0  # [px] room of a wire that passes
APART = 16.0  # [px] between boxes above each other
GAP, TRUNK, LANE = 30.0, 7.0, 9.0  # [px] between layers, and more for each feedback that runs there; below
ROUND = 5.0  # [px] corners of feedback wires
ARROW = 6.0  # [px]
EDGE = 6.0  # [px] around the picture
LONGEST_PORT = 18  # letters; of longer names the end is shown


@dataclass(frozen=True)
class Placed:
    """A diagram with the place of everything [px]; y downwards."""

    graph: Graph
    back: tuple[bool, ...]
    layer: tuple[int, ...]
    nodes: tuple[Node, ...]  # blocks first, in their order
    left: Array  # (layers,)
    width: Array  # (layers,)
    top: Array  # (nodes,)
    height: Array  # (nodes,)

    def output(self, net: tuple[int, int]) -> tuple[float, float]:
        """Where the wires of a net begin."""
        block, port = net
        k = self.layer[block]
        return float(self.left[k] + self.width[k]), float(self.top[block] + HEAD + (port + 0.5) * ROW)

    def input(self, wire: Wire) -> tuple[float, float]:
        """Where a wire ends."""
        return (
            float(self.left[self.layer[wire.target]]),
            float(self.top[wire.target] + HEAD + (wire.input + 0.5) * ROW),
        )


def draw_diagram(diagram: Diagram) -> Picture:
    """Every system of a Drake diagram with its class, and every wire with the names of its ports.

    Signals run from left to right; those that close a loop run back below, in blue.
    """
    graph = read_graph(diagram)
    placed = place(graph)
    loops = len({w.net for w, back in zip(graph.wires, placed.back, strict=True) if back})
    described = {
        "key": "diagram",
        "title": "Block diagram of the simulation",
        "description": "; ".join(
            f"{graph.blocks[i].name} sends {_listed(graph, i)}"
            for i in range(len(graph.blocks))
            if graph.blocks[i].outputs
        )
        + ".",
    }
    with drawing_style():
        svg = _draw(placed, described)
    return Picture(
        **described,
        svg=svg,
        narrow=None,
        heading="Block diagram",
        caption=f"{count(len(graph.blocks))} systems and {count(len(graph.wires))} wires, drawn from the "
        "diagram that ran. Bold: the system's name, below it its class; inputs on the left, outputs on the "
        "right, those without a wire left out. "
        + ("Nothing runs back." if not loops else f"Blue: {_signals(loops)} back."),
    )


def _signals(number: int) -> str:
    return "one signal runs" if number == 1 else f"{count(number)} signals run"


def _listed(graph: Graph, block: int) -> str:
    """What a system sends where, in words."""
    sent: dict[str, list[str]] = {}
    for w in graph.wires:
        if w.source == block:
            sent.setdefault(graph.blocks[block].outputs[w.output], []).append(graph.blocks[w.target].name)
    return ", ".join(f"{port} to {' and '.join(dict.fromkeys(names))}" for port, names in sent.items())


def port_label(name: str) -> str:
    """The name of a port as it is drawn: of a long one its end."""
    if len(name) <= LONGEST_PORT:
        return name
    end = name[-(LONGEST_PORT - 1) :]
    return "…" + (end.partition("_")[2] or end)


def place(graph: Graph) -> Placed:
    """Layers, columns and heights."""
    back = feedback(graph)
    layer = layers(graph, back)
    nodes = [*(Node(layer[i], block=i) for i in range(len(graph.blocks))), *passing(graph, back, layer)]
    heights = np.array([PASS if n.block < 0 else _box_height(graph.blocks[n.block]) for n in nodes])
    links = _links(graph, back, layer, nodes)
    columns = max(layer, default=-1) + 1
    width = np.zeros(columns)
    for i, block in enumerate(graph.blocks):
        width[layer[i]] = max(width[layer[i]], _box_width(block))
    trunks = np.array([len(_trunks(graph, back, layer, k)) for k in range(columns + 1)])
    gaps = np.where(np.arange(columns + 1) % max(columns, 1) == 0, 2.0 * ARROW, GAP) + TRUNK * trunks
    left = EDGE + np.cumsum(gaps[:-1]) + np.concatenate([[0.0], np.cumsum(width)[:-1]]) if columns else width
    return Placed(
        graph, back, layer, tuple(nodes), left, width, EDGE + arranged(nodes, links, heights, APART), heights
    )


def _box_height(block: Block) -> float:
    return HEAD + ROW * max(len(block.inputs), len(block.outputs), 1) + FOOT


def _box_width(block: Block) -> float:
    def widest(names: Sequence[str]) -> float:
        return max((text_width(port_label(name), PORT_SIZE) for name in names), default=0.0)

    ports = widest(block.inputs) + widest(block.outputs) + 3.0 * PAD
    head = max(text_width(block.name, NAME_SIZE, bold=True), text_width(block.kind, KIND_SIZE)) + 2.0 * PAD
    return max(ports, head)


def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Width [px] of a line of text as it is drawn, or a trifle more: control points of its outlines count."""
    if not text.strip():
        return 0.0
    font = FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")
    return float(TextPath((0.0, 0.0), text, size=size, prop=font).vertices[:, 0].max())


def _links(graph: Graph, back: Sequence[bool], layer: Sequence[int], nodes: Sequence[Node]) -> list[Link]:
    """The stretches between neighbouring layers of all wires that run forwards."""
    via = {(node.net, node.layer): i for i, node in enumerate(nodes) if node.block < 0}
    found: dict[tuple[int, int, int], Link] = {}
    for w, closes in zip(graph.wires, back, strict=True):
        if closes:
            continue
        here, down = w.source, HEAD + (w.output + 0.5) * ROW
        for k in range(layer[w.source] + 1, layer[w.target]):
            there = via[w.net, k]
            found[here, there, w.output] = Link(here, there, down, 0.5 * PASS)
            here, down = there, 0.5 * PASS
        into = HEAD + (w.input + 0.5) * ROW
        found[here, w.target, len(nodes) + len(found)] = Link(here, w.target, down, into)
    return list(found.values())


def _trunks(
    graph: Graph, back: Sequence[bool], layer: Sequence[int], gap: int
) -> list[tuple[tuple[int, int], bool]]:
    """Feedback nets that run up or down left of layer `gap`, from left to right; whether they go down."""
    lanes = _lanes(graph, back, layer)
    nets = {w.net for w, closes in zip(graph.wires, back, strict=True) if closes}
    down = [net for net in lanes if net in nets and layer[net[0]] == gap - 1]
    up = [
        net
        for net in reversed(lanes)
        if any(
            closes and w.net == net and layer[w.target] == gap
            for w, closes in zip(graph.wires, back, strict=True)
        )
    ]
    return [*((net, True) for net in down), *((net, False) for net in up)]


def _lanes(graph: Graph, back: Sequence[bool], layer: Sequence[int]) -> list[tuple[int, int]]:
    """Feedback nets from the uppermost lane to the lowest: those that run back least come first."""
    reach: dict[tuple[int, int], int] = {}
    for w, closes in zip(graph.wires, back, strict=True):
        if closes:
            reach[w.net] = max(reach.get(w.net, 0), layer[w.source] - layer[w.target])
    return sorted(reach, key=lambda net: (reach[net], net))


def _draw(placed: Placed, described: dict[str, str]) -> Markup:
    graph = placed.graph
    lanes = _lanes(graph, placed.back, placed.layer)
    floor = float((placed.top + placed.height).max(initial=0.0)) + 12.0
    right = float((placed.left + placed.width).max(initial=0.0))
    right += 2.0 * ARROW + TRUNK * len(_trunks(graph, placed.back, placed.layer, len(placed.left)))
    size = (right + EDGE, floor + LANE * len(lanes) + EDGE)
    figure = new_figure(*size)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, size[0])
    axes.set_ylim(size[1], 0.0)
    _forward(axes, placed)
    for number, net in enumerate(lanes):
        _feedback(axes, placed, net, floor + LANE * (number + 0.5))
    for i, block in enumerate(graph.blocks):
        _box(axes, placed, i, block)
    return to_svg(figure, **described)


def _forward(axes: Axes, placed: Placed) -> None:
    """Wires to the right: level through layers that they pass, curved between layers."""
    via = {(node.net, node.layer): i for i, node in enumerate(placed.nodes) if node.block < 0}
    drawn: set[tuple[tuple[int, int], int]] = set()
    for w, closes in zip(placed.graph.wires, placed.back, strict=True):
        if closes:
            continue
        at = placed.output(w.net)
        for k in range(placed.layer[w.source] + 1, placed.layer[w.target]):
            y = float(placed.top[via[w.net, k]]) + 0.5 * PASS
            entry = (float(placed.left[k]), y)
            leave = (float(placed.left[k] + placed.width[k]), y)
            if (w.net, k) not in drawn:
                _line(axes, [*_curve(at, entry), leave], INK.light, [*_CURVE_CODES, Outline.LINETO])
                drawn.add((w.net, k))
            at = leave
        end = placed.input(w)
        _line(axes, [*_curve(at, (end[0] - ARROW, end[1])), end], INK.light, [*_CURVE_CODES, Outline.LINETO])
        _arrow(axes, end, INK.light)


_CURVE_CODES = [Outline.MOVETO, Outline.CURVE4, Outline.CURVE4, Outline.CURVE4]


def _curve(start: tuple[float, float], end: tuple[float, float]) -> list[tuple[float, float]]:
    half = 0.5 * (end[0] - start[0])
    return [start, (start[0] + half, start[1]), (end[0] - half, end[1]), end]


def _feedback(axes: Axes, placed: Placed, net: tuple[int, int], lane: float) -> None:
    """A net that runs back: right and down, left along its lane, up and right into each of its inputs."""
    colour = method("collocation").light
    x, y = placed.output(net)
    down = _trunk_at(placed, net, placed.layer[net[0]] + 1, goes_down=True)
    targets = [
        w for w, closes in zip(placed.graph.wires, placed.back, strict=True) if closes and w.net == net
    ]
    joints = []
    ups = {w: _trunk_at(placed, net, placed.layer[w.target], goes_down=False) for w in targets}
    for w in targets:
        end, up = placed.input(w), ups[w]
        _line(axes, *_rounded([(x, y), (down, y), (down, lane), (up, lane), (up, end[1]), end], colour))
        _arrow(axes, end, colour)
        joints += [(up, lane)] if up > min(ups.values()) else []
        joints += [(up, end[1])] if any(ups[o] == up and placed.input(o)[1] < end[1] for o in targets) else []
    if joints:
        axes.plot(*np.array(joints).T, "o", color=colour, ms=3.6, mew=0.0)
    if any(w.net == net and not closes for w, closes in zip(placed.graph.wires, placed.back, strict=True)):
        axes.plot(x + 2.0, y, "o", color=INK.light, ms=3.6, mew=0.0)


def _trunk_at(placed: Placed, net: tuple[int, int], gap: int, *, goes_down: bool) -> float:
    """Across [px], where a net runs up or down in a gap: down near the left, up near the right."""
    trunks = _trunks(placed.graph, placed.back, placed.layer, gap)
    place_in_gap = trunks.index((net, goes_down))
    if goes_down:
        begin = float(placed.left[gap - 1] + placed.width[gap - 1])
        return begin + ARROW + TRUNK * place_in_gap
    return float(placed.left[gap]) - ARROW - 3.0 - TRUNK * (len(trunks) - 1 - place_in_gap)


def _rounded(
    corners: Sequence[tuple[float, float]], colour: str
) -> tuple[list[tuple[float, float]], str, list[np.uint8]]:
    """A line of level and upright pieces with round corners."""
    points, codes = [corners[0]], [Outline.MOVETO]
    for before, at, after in zip(corners, corners[1:], corners[2:], strict=False):
        for other, code in ((before, Outline.LINETO), (after, Outline.CURVE3)):
            away = np.subtract(other, at)
            length = float(np.hypot(*away))
            short = min(ROUND, 0.5 * length) / length if length else 0.0
            near = (float(at[0] + short * away[0]), float(at[1] + short * away[1]))
            points += [near] if code == Outline.LINETO else [at, near]
            codes += [code] if code == Outline.LINETO else [code, code]
    return [*points, corners[-1]], colour, [*codes, Outline.LINETO]


def _line(axes: Axes, points: Sequence[tuple[float, float]], colour: str, codes: Sequence[np.uint8]) -> None:
    axes.add_patch(PathPatch(Outline(np.array(points), list(codes)), fill=False, edgecolor=colour, lw=1.2))


def _arrow(axes: Axes, tip: tuple[float, float], colour: str) -> None:
    x, y = tip
    head = np.array([(x, y), (x - ARROW, y - 0.5 * ARROW), (x - ARROW, y + 0.5 * ARROW), (x, y)])
    axes.add_patch(PathPatch(Outline(head, closed=True), facecolor=colour, edgecolor="none", lw=0.0))


def _box(axes: Axes, placed: Placed, i: int, block: Block) -> None:
    k = placed.layer[i]
    x, y, wide, high = placed.left[k], placed.top[i], placed.width[k], placed.height[i]
    axes.add_patch(
        FancyBboxPatch(
            (x, y), wide, high, boxstyle="round,pad=0,rounding_size=4", facecolor=PAPER.light,
            edgecolor=RACK_EDGE.light, lw=1.0,
        )
    )  # fmt: skip
    middle = x + 0.5 * wide
    axes.text(middle, y + 14.0, block.name, ha="center", va="baseline", weight="bold", fontsize=NAME_SIZE)
    axes.text(middle, y + 27.0, block.kind, ha="center", va="baseline", fontsize=KIND_SIZE, color=MUTED.light)
    for names, at, side in ((block.inputs, x + PAD, "left"), (block.outputs, x + wide - PAD, "right")):
        for row, name in enumerate(names):
            axes.text(
                at, y + HEAD + (row + 0.5) * ROW, port_label(name), ha=side, va="center_baseline",
                fontsize=PORT_SIZE, color=INK.light,
            )  # fmt: skip
