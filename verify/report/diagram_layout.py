"""Where the boxes and wires of a block diagram go: layers from left to right, feedback below.

The steps of Sugiyama, Tagawa and Toda (1981, "Methods for visual understanding of hierarchical system
structures"): wires that close a loop are set aside, the longest way of the rest gives the layers, systems are
ordered within a layer by the mean place of their neighbours, and heights follow by least squares.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

Array = NDArray[np.float64]

SWEEPS = 12  # passes over the layers that order and align them


class System(Protocol):
    """What is asked of a Drake system."""

    def get_name(self) -> str: ...
    def GetSystemType(self) -> str: ...  # noqa: N802
    def get_input_port(self, port_index: Any) -> Any: ...
    def get_output_port(self, port_index: Any) -> Any: ...


class Diagram(Protocol):
    """What is asked of a Drake diagram."""

    def GetSystems(self) -> Sequence[Any]: ...  # noqa: N802
    def connection_map(self) -> Mapping[Any, Any]: ...


@dataclass(frozen=True)
class Block:
    """One system with the ports that have a wire."""

    name: str
    kind: str  # its class, without namespace and scalar
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Wire:
    """From an output to an input; ports are places in `Block.outputs` and `Block.inputs`."""

    source: int
    output: int
    target: int
    input: int

    @property
    def net(self) -> tuple[int, int]:
        """The output that it begins at: wires of one net carry the same signal."""
        return self.source, self.output


@dataclass(frozen=True)
class Graph:
    """Blocks in the order in which the diagram was built, and its wires."""

    blocks: tuple[Block, ...]
    wires: tuple[Wire, ...]


def read_graph(diagram: Diagram) -> Graph:
    """Systems and wires of a Drake diagram, as it runs."""
    systems = list(diagram.GetSystems())
    place = {id(system): i for i, system in enumerate(systems)}
    joined = sorted(
        (place[id(source)], int(output), place[id(target)], int(port))
        for (target, port), (source, output) in diagram.connection_map().items()
    )
    outputs = [sorted({w[1] for w in joined if w[0] == i}) for i in range(len(systems))]
    inputs = [sorted({w[3] for w in joined if w[2] == i}) for i in range(len(systems))]
    blocks = tuple(
        Block(
            system.get_name(),
            kind_of(system.GetSystemType()),
            tuple(system.get_input_port(k).get_name() for k in inputs[i]),
            tuple(system.get_output_port(k).get_name() for k in outputs[i]),
        )
        for i, system in enumerate(systems)
    )
    wires = tuple(Wire(s, outputs[s].index(o), t, inputs[t].index(k)) for s, o, t, k in joined)
    return Graph(blocks, wires)


def kind_of(type_name: str) -> str:
    """`VectorLogSink` of `drake::systems::VectorLogSink<double>`."""
    return re.split(r"::|\.", re.sub(r"<.*>", "", type_name))[-1]


def feedback(graph: Graph) -> tuple[bool, ...]:
    """Which wires close a loop: those that lead back to a system from which the walk came (depth first).

    The walk begins with the systems in the order in which the diagram was built; without these wires there is
    no loop.
    """
    onward = [sorted({w.target for w in graph.wires if w.source == i}) for i in range(len(graph.blocks))]
    state = [0] * len(onward)  # 0 not seen, 1 on the way, 2 done
    back: set[tuple[int, int]] = set()
    for root in range(len(onward)):
        if state[root]:
            continue
        state[root] = 1
        way = [(root, iter(onward[root]))]
        while way:
            node, rest = way[-1]
            for target in rest:
                if state[target] == 1:
                    back.add((node, target))
                elif state[target] == 0:
                    state[target] = 1
                    way.append((target, iter(onward[target])))
                    break
            else:
                state[node] = 2
                way.pop()
    return tuple((w.source, w.target) in back for w in graph.wires)


def layers(graph: Graph, back: Sequence[bool]) -> tuple[int, ...]:
    """The layer of each block, from 0: behind all whose wires it takes, feedback apart (longest way).

    A block that takes nothing stands just before the first that takes from it.
    """
    ahead = [w for w, closes in zip(graph.wires, back, strict=True) if not closes]
    layer = [0] * len(graph.blocks)
    for _ in graph.blocks:  # as many rounds as the longest way can have wires
        for w in ahead:
            layer[w.target] = max(layer[w.target], layer[w.source] + 1)
    for i in range(len(layer)):
        takes = any(w.target == i for w in ahead)
        gives = [layer[w.target] for w in ahead if w.source == i]
        if not takes and gives and not any(w.target == i for w in graph.wires):
            layer[i] = min(gives) - 1
    return tuple(layer)


@dataclass(frozen=True)
class Node:
    """What takes room in a layer: a block, or a wire that passes (`net` of it)."""

    layer: int
    block: int = -1
    net: tuple[int, int] = (-1, -1)


def passing(graph: Graph, back: Sequence[bool], layer: Sequence[int]) -> list[Node]:
    """Places of wires that pass layers between their ends: one for a net and a layer."""
    reach: dict[tuple[int, int], int] = {}
    for w, closes in zip(graph.wires, back, strict=True):
        if not closes:
            reach[w.net] = max(reach.get(w.net, 0), layer[w.target])
    return [Node(k, net=net) for net, last in sorted(reach.items()) for k in range(layer[net[0]] + 1, last)]


@dataclass(frozen=True)
class Link:
    """A stretch of wire between nodes of neighbouring layers; offsets [px] of its ends from their tops."""

    left: int
    right: int
    from_top: float
    to_top: float


def arranged(nodes: Sequence[Node], links: Sequence[Link], heights: Array, gap: float) -> Array:
    """Tops (n,) [px, downwards] of all nodes: ordered and aligned so that wires are short and rarely cross.

    Parameters
    ----------
    nodes, links : what takes room, and the stretches of wire between;  heights : (n,) [px];  gap : [px],
        between nodes of one layer.

    Notes
    -----
    Nodes of a layer go where the mean of their wires' other ends is (barycentres); heights then have the
    least sum of squared distances from there, kept apart: a monotone regression once room and gaps are
    taken off.
    """
    count = max((node.layer for node in nodes), default=-1) + 1
    order = [[i for i, node in enumerate(nodes) if node.layer == k] for k in range(count)]
    top = np.zeros(len(nodes))
    for rows in order:
        top[rows] = _apart(np.zeros(len(rows)), heights[rows], gap)
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        for k in range(count) if forward else range(count - 1, -1, -1):
            wanted = _wanted(order[k], links, top, both=sweep >= SWEEPS // 2, forward=forward)
            if sweep < SWEEPS // 2:  # later the order is kept, and both sides are looked at
                order[k] = [i for _, i in sorted(zip(wanted.tolist(), order[k], strict=True))]
                wanted = np.sort(wanted)
            top[order[k]] = _apart(wanted, heights[order[k]], gap)
    return top - top.min(initial=np.inf)


def _wanted(rows: Sequence[int], links: Sequence[Link], top: Array, *, both: bool, forward: bool) -> Array:
    """Where each node would have its wires level, on the side that the sweep comes from or on both."""
    wanted = []
    for i in rows:
        left = [top[e.left] + e.from_top - e.to_top for e in links if e.right == i]
        right = [top[e.right] + e.to_top - e.from_top for e in links if e.left == i]
        ends = left + right if both else (left if forward else right)
        wanted.append(float(np.mean(ends)) if ends else float(top[i]))
    return np.array(wanted)


def _apart(wanted: Array, heights: Array, gap: float) -> Array:
    """Tops nearest to `wanted`, in this order and without overlap."""
    if not len(wanted):
        return wanted
    room = np.concatenate([[0.0], np.cumsum(heights[:-1] + gap)])
    return np.asarray(isotonic_regression(wanted - room).x + room)
