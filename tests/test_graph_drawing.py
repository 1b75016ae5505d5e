"""Edges of the speed graphs as lines: they join their nodes, stay clear, and are few enough to see."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from report_case import warehouse

from verify import graph_drawing
from verify.graph_drawing import published_drawing, sampled_drawing
from vnav_drake.speed_graph.published import PublishedGraph, build_published
from vnav_drake.speed_graph.sampled import SampledGraph, build_sampled
from vnav_drake.voronoi import build_diagram


@cache
def graphs() -> tuple[SampledGraph, PublishedGraph]:
    problem = warehouse().problem
    sampled = build_sampled(problem, build_diagram(problem.world, problem.robot.radius))
    return sampled, build_published(sampled)


def test_lines_of_the_sampled_graph_lead_from_node_to_node_in_free_space(monkeypatch):
    graph = graphs()[0]
    monkeypatch.setattr(graph_drawing, "MOST_LINES", len(graph.edges))
    drawing = sampled_drawing(graph)
    assert drawing.shown == drawing.total == len(graph.edges) == len(drawing.lines)
    point = graph.samples.point
    np.testing.assert_allclose(drawing.lines[:, 0], point[graph.edges.tail], atol=1e-9)
    np.testing.assert_allclose(drawing.lines[:, -1], point[graph.edges.head], atol=1e-9)
    assert graph.problem.clearance(drawing.lines.reshape(-1, 2)).min() > -1e-9


@pytest.mark.parametrize("most", [50, 300])
def test_no_more_lines_than_asked_for_and_it_says_how_many_edges_they_are(monkeypatch, most):
    monkeypatch.setattr(graph_drawing, "MOST_LINES", most)
    sampled, published = sampled_drawing(graphs()[0]), published_drawing(graphs()[1])
    assert len(sampled.lines) == sampled.shown == most
    assert len(published.lines) <= most
    assert published.shown < published.total == len(graphs()[1].edges)


def test_the_published_graph_is_drawn_on_its_own_nodes():
    graph = graphs()[1]
    drawing = published_drawing(graph)
    assert drawing.nodes.shape == (graph.node_count, 2)
    ends = drawing.lines[:, [0, -1]].reshape(-1, 2)
    joined = drawing.nodes[np.unique(np.concatenate([graph.edges.tail, graph.edges.head]))]
    gap = np.hypot(*(joined[:, None] - ends[None]).transpose(2, 0, 1)).min(axis=1)
    assert drawing.shown == drawing.total
    assert gap.max() < 1e-9
