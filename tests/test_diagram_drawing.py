"""The block diagram: it shows what the diagram holds, boxes keep apart, wires run forwards but for loops."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, ConstantVectorSource, Gain, Integrator, LogVectorOutput

from verify.report.diagram_drawing import APART, HEAD, draw_diagram, place, port_label, text_width
from verify.report.diagram_layout import Block, Graph, Wire, feedback, kind_of, layers, read_graph
from verify.report.palette import variable_of_colour


def servo():
    """An integrator steered to a wanted value, logged: one loop, and a system that is not joined."""
    builder = DiagramBuilder()
    wanted = builder.AddNamedSystem("wanted", ConstantVectorSource([1.0]))
    error = builder.AddNamedSystem("error", Adder(2, 1))
    gain = builder.AddNamedSystem("gain", Gain(-2.0, 1))
    motor = builder.AddNamedSystem("motor", Integrator(1))
    builder.AddNamedSystem("spare", Gain(1.0, 1))
    builder.Connect(wanted.get_output_port(), error.get_input_port(0))
    builder.Connect(error.get_output_port(), gain.get_input_port())
    builder.Connect(gain.get_output_port(), motor.get_input_port())
    builder.Connect(motor.get_output_port(), error.get_input_port(1))
    LogVectorOutput(motor.get_output_port(), builder).set_name("log")
    return builder.Build()


def graph_of(count: int, wires: list[tuple[int, int, int]]) -> Graph:
    """Blocks with one output each; wires (source, target, input)."""
    blocks = tuple(
        Block(f"s{i}", "Kind", tuple(f"u{w[2]}" for w in sorted(wires) if w[1] == i), ("y",))
        for i in range(count)
    )
    used = [sorted(w[2] for w in wires if w[1] == i) for i in range(count)]
    return Graph(blocks, tuple(Wire(s, 0, t, used[t].index(u)) for s, t, u in sorted(wires)))


@st.composite
def graphs(draw: st.DrawFn) -> Graph:
    count = draw(st.integers(1, 7))
    ends = st.tuples(*(st.integers(0, count - 1),) * 2, st.integers(0, 2))
    return graph_of(count, draw(st.lists(ends, max_size=14, unique_by=lambda w: w[1:])))


def test_the_graph_is_that_of_the_diagram():
    graph = read_graph(servo())
    names = [block.name for block in graph.blocks]
    assert names == ["wanted", "error", "gain", "motor", "spare", "log"]
    assert [block.kind for block in graph.blocks][:2] == ["ConstantVectorSource", "Adder"]
    joined = {
        (names[w.source], graph.blocks[w.source].outputs[w.output],
         names[w.target], graph.blocks[w.target].inputs[w.input])
        for w in graph.wires
    }  # fmt: skip
    assert joined == {
        ("wanted", "y0", "error", "u0"), ("error", "sum", "gain", "u0"), ("gain", "y0", "motor", "u0"),
        ("motor", "y0", "error", "u1"), ("motor", "y0", "log", "data"),
    }  # fmt: skip
    assert graph.blocks[4].inputs == graph.blocks[4].outputs == ()


def test_the_loop_closes_where_it_comes_back_and_sources_stand_beside_their_first_reader():
    graph = read_graph(servo())
    back = feedback(graph)
    assert [(w.source, w.target) for w, closes in zip(graph.wires, back, strict=True) if closes] == [(3, 1)]
    assert layers(graph, back) == (0, 1, 2, 3, 0, 4)
    # a source of the last of three in a row
    late = graph_of(4, [(0, 1, 0), (1, 2, 0), (3, 2, 1)])
    assert layers(late, feedback(late)) == (0, 1, 2, 1)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("drake::systems::VectorLogSink<double>", "VectorLogSink"),
        ("drake::systems::A<drake::systems::B<double>>", "A"),
        ("systems.tracking.TrackingController", "TrackingController"),
        ("Plain", "Plain"),
    ],
)
def test_a_kind_is_the_class_alone(name, kind):
    assert kind_of(name) == kind


def test_of_a_long_port_the_end_is_shown():
    assert port_label("state") == "state"
    assert port_label("DefaultModelInstance_desired_state") == "…desired_state"
    assert len(port_label("x" * 60)) == len(port_label("x" * 18))


@given(graphs())
def test_without_feedback_every_wire_runs_to_the_right(graph):
    back = feedback(graph)
    layer = layers(graph, back)
    assert min(layer) >= 0
    for w, closes in zip(graph.wires, back, strict=True):
        assert closes or layer[w.source] < layer[w.target]
        assert not closes or layer[w.source] >= layer[w.target]


@given(graphs())
def test_boxes_keep_apart_and_hold_their_ports(graph):
    placed = place(graph)
    count = len(graph.blocks)
    assert np.all(np.diff(placed.left) > placed.width[:-1])
    for k in range(len(placed.left)):
        rows = [i for i, node in enumerate(placed.nodes) if node.layer == k]
        rows.sort(key=lambda i: placed.top[i])
        for above, below in pairwise(rows):
            assert placed.top[above] + placed.height[above] + APART <= placed.top[below] + 1e-6
    for w in graph.wires:
        for block, (x, y) in ((w.source, placed.output(w.net)), (w.target, placed.input(w))):
            left = placed.left[placed.layer[block]]
            assert x in (left, left + placed.width[placed.layer[block]])
            assert placed.top[block] + HEAD < y < placed.top[block] + placed.height[block]
    assert len(placed.nodes) >= count


def test_rows_that_could_cross_do_not():
    # a over b, each with a reader of its own that was built in the other order
    graph = graph_of(4, [(0, 3, 0), (1, 2, 0)])
    top = place(graph).top
    assert (top[0] < top[1]) == (top[3] < top[2])
    assert top[0] == pytest.approx(top[3])  # and the wires are level


def test_a_box_is_as_wide_as_its_name():
    graph = Graph((Block("n" * 40, "Kind", (), ()),), ())
    assert place(graph).width[0] > text_width("n" * 40, 11.0, bold=True)


def test_the_picture_tells_every_wire_and_has_the_colours_of_the_page():
    picture = draw_diagram(servo())
    assert picture.description == (
        "wanted sends y0 to error; error sends sum to gain; gain sends y0 to motor; motor sends y0 to error "
        "and log."
    )
    assert "6 systems and 5 wires" in picture.caption
    assert "one signal runs back" in picture.caption
    # a wire ends in a triangle: four forwards and one back
    found = re.findall(r'<path d="M[-\d. ]+l[-\d. ]+v[-\d.]+z"[^>]* fill="var\(--(\w+)\)"', picture.svg)
    assert sorted(found) == ["collocation", "ink", "ink", "ink", "ink"]
    assert not re.search("#[0-9a-f]{6}", picture.svg)
    named = set(re.findall(r"var\((--[a-z-]+)\)", picture.svg))
    assert named <= set(variable_of_colour().values())
    assert "--collocation" in named
    ids = re.findall(r'\bid="([^"]+)"', picture.svg)
    assert len(ids) == len(set(ids))
    assert draw_diagram(servo()).svg == picture.svg


def test_nothing_that_runs_back_needs_no_lane():
    builder = DiagramBuilder()
    source = builder.AddNamedSystem("source", ConstantVectorSource([1.0]))
    LogVectorOutput(source.get_output_port(), builder).set_name("log")
    picture = draw_diagram(builder.Build())
    assert "Nothing runs back" in picture.caption
    assert "--collocation" not in picture.svg
