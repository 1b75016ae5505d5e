"""Gates and words: the homotopy class of any path, and its name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from vnav_drake.homotopy.crossing import box_tree, crossings
from vnav_drake.homotopy.outlines import DIRECT
from vnav_drake.voronoi import VoronoiDiagram

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Word = tuple[int, ...]

SEPARATOR = ", "
CLOSE_ENOUGH = 0.4  # likeness from which a known token is worth suggesting


def reduced(word: Iterable[int]) -> Word:
    """The freely reduced word: neighbours g, -g cancel until none are left."""
    out: list[int] = []
    for letter in word:
        if out and out[-1] == -letter:
            out.pop()
        else:
            out.append(letter)
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Gates:
    """Segments across free space that tell homotopy classes apart.

    A gate is the bent line from a foot on one feature over a point of a Voronoi arc to a foot on the
    other feature. Gates are numbered from 1; the letter +g stands for crossing gate g in the direction
    in which the arc's parameter u grows, -g for crossing it the other way.

    Notes
    -----
    Two paths with the same ends are homotopic if and only if their reduced words are equal. Derived:

    1. The free space F = {distance >= level} retracts onto its Voronoi arcs by moving every point straight
       away from its nearest feature until a second one is as near (C. O'Dunlaing and C. K. Yap, "A
       retraction method for planning the motion of a disc", Journal of Algorithms 6, 1985). Distance grows
       on the way, so the way stays in F.
    2. The points that go to an inner point p of an arc are those on the two segments from p to its feet:
       the gate. So the crossings of a path with the gate are those of its image with p, signs included.
    3. The gates lie one on each chain of the 2-core of the graph of arcs, save on trees of short chains.
       Cut at the gates, the graph has no ring left: its pieces are trees, and those of F, which retract
       onto them, are contractible.
    4. So F is homotopy equivalent to the graph with pieces as vertices and gates as edges, where paths
       with given ends are homotopic if and only if they agree after cancelling steps back and forth.

    Gates reach from wall to wall, so a path that comes nearer than `level` to a feature has a word too. It
    says nothing about passages that are too narrow at `level`: these have no gate.
    """

    diagram: VoronoiDiagram  # restricted to the level
    border: Indices  # (g,), Voronoi arc (row of diagram.curves) that each gate crosses
    parameter: Array  # (g,) [m], u on that arc, strictly inside
    point: Array  # (g, 2) [m]
    feet: Array  # (g, 2, 2) [m], left and right foot seen in the direction of growing u
    tokens: tuple[str, ...]  # name of each gate, all different
    sides: Indices  # (g, 2), pieces of free space before and behind a gate, in the direction of growing u
    anticlockwise: Indices  # (g,), sign of the crossing that has the obstacle named first on its left

    def __len__(self) -> int:
        return len(self.border)

    @cached_property
    def at_border(self) -> Indices:
        """(m,) row of the gate on each of the diagram's curves, -1 where there is none."""
        rows = np.full(len(self.diagram.curves), -1)
        rows[self.border] = np.arange(len(self))
        return rows

    @cached_property
    def loops(self) -> NDArray[np.bool_]:
        """(g,) whether both sides of a gate are the same piece of free space."""
        return np.asarray(self.sides[:, 0] == self.sides[:, 1])

    def crossings(self, points: ArrayLike) -> Word:
        """Letters of the gates that a polyline (n, 2) [m] crosses, in its order.

        A polyline through a gate's point, along the gate or with a vertex on it is counted as if it lay
        beside its place by (e, e^2), e positive and smaller than anything: its class is not changed by that,
        unless an end lies on the gate, and then it is the same for all paths with this end.

        Raises
        ------
        ValueError : `points` has no point, another shape, or a coordinate that is not finite.
        """
        return self.located_crossings(points)[0]

    def located_crossings(self, points: ArrayLike) -> tuple[Word, Array]:
        """As `crossings`, and where: (k,) pieces of the polyline, the fraction of the piece added."""
        p = np.asarray(points, dtype=float)
        if p.ndim != 2 or p.shape[1] != 2 or len(p) == 0:
            raise ValueError(f"points of shape {p.shape}: must be (n, 2) with n >= 1 [m]")
        if not np.isfinite(p).all():
            bad = int(np.flatnonzero(~np.isfinite(p).all(axis=1))[0])
            raise ValueError(f"points[{bad}] = {p[bad].tolist()}: must be finite [m]")
        start, end, tree = self._halves
        piece, part, half, sign = crossings(p, start, end, tree)
        # Halves lead from the right foot to the left one: from their left to their right u grows.
        return tuple(((half // 2 + 1) * sign).tolist()), piece + part

    def word(self, points: ArrayLike) -> Word:
        """The reduced word of a polyline (n, 2) [m]: equal for homotopic paths with the same ends."""
        return reduced(self.crossings(points))

    def name(self, word: Iterable[int]) -> str:
        """Tokens of the reduced word, as in "O7/O8, O5/boundary"; "direct" where it is empty.

        A token is marked by a leading "-" where the gate has the same piece of free space on either side,
        so that its place in the order does not tell in which direction it is crossed, and it is crossed
        with the obstacle named first on the right. Different words from one place have different names.

        Raises
        ------
        ValueError : a letter is zero or beyond the number of gates.
        """
        letters = reduced(word)
        wrong = [w for w in letters if not 1 <= abs(w) <= len(self)]
        if wrong:
            raise ValueError(f"letter {wrong[0]}: must be +-1 to +-{len(self)}, the number of gates")
        return SEPARATOR.join(self._marked(w) for w in letters) or DIRECT

    def parse(self, name: str) -> tuple[Word, ...]:
        """The reduced words that have this name: one, or two that start on either side of the first gate.

        Raises
        ------
        ValueError : a token is unknown, or no path passes the gates in this order.
        """
        if name.strip() == DIRECT:
            return ((),)
        marked = [token.strip() for token in name.split(",")]
        rows = [self._row(token.removeprefix("-"), token) for token in marked]
        words = [self._walk(marked, rows, sign) for sign in (1, -1)]
        plain = SEPARATOR.join(marked)
        found = tuple(dict.fromkeys(w for w in words if w is not None and self.name(w) == plain))
        if not found:
            raise ValueError(f"no path passes the gates of {name!r} in this order without turning back")
        return found

    def matches(self, word: Iterable[int], through: Sequence[str]) -> bool:
        """Whether the reduced word passes the tokens of `through` in this order, others between them or not.

        Directions do not matter, nor which of a token's two obstacles comes first; a token without its
        number stands for every passage between the two.

        Raises
        ------
        ValueError : a token is no passage of this world at this level.
        """
        wanted = [self._rows(token) for token in through]
        passed = 0
        for letter in reduced(word):
            if passed < len(wanted) and abs(letter) - 1 in wanted[passed]:
                passed += 1
        return passed == len(wanted)

    def numbers_of(self, token: str) -> frozenset[int]:
        """Gates (1-based, as in words) that a token stands for: several when it lacks the number it needs.

        Raises
        ------
        ValueError : it is no passage of this world at this level; the message names the nearest ones.
        """
        return frozenset(row + 1 for row in self._rows(token))

    @cached_property
    def _halves(self) -> tuple[Array, Array, shapely.STRtree]:
        """Starts and ends (2 g, 2) of the two halves of each gate, from the right foot to the left."""
        start = np.stack([self.feet[:, 1], self.point], axis=1).reshape(-1, 2)
        end = np.stack([self.point, self.feet[:, 0]], axis=1).reshape(-1, 2)
        return start, end, box_tree(start, end)

    @cached_property
    def _row_of(self) -> dict[str, int]:
        return {token: row for row, token in enumerate(self.tokens)}

    @cached_property
    def _rows_of_passage(self) -> dict[str, frozenset[int]]:
        """Rows for every way to write a token: with and without number, either obstacle first."""
        rows: dict[str, set[int]] = {}
        for row, token in enumerate(self.tokens):
            pair, number = self._split(token)
            one, other = pair.split("/")
            for written in (pair, f"{other}/{one}"):
                rows.setdefault(written, set()).add(row)
                rows.setdefault(written + number, set()).add(row)
        return {written: frozenset(found) for written, found in rows.items()}

    def _split(self, token: str) -> tuple[str, str]:
        """The pair of obstacles and the number (with its point, or empty) of a gate's token."""
        pair, point, digits = token.rpartition(".")
        return (pair, point + digits) if point and digits.isdigit() else (token, "")

    def _marked(self, letter: int) -> str:
        row = abs(letter) - 1
        against = bool(self.loops[row]) and letter * int(self.anticlockwise[row]) < 0
        return "-" * against + self.tokens[row]

    def _walk(self, marked: list[str], rows: list[int], sign: int) -> Word | None:
        """The word of these gates in order, the first crossed with `sign`; None if they do not join."""
        letters: list[int] = []
        piece = -1
        for i, (token, row) in enumerate(zip(marked, rows, strict=True)):
            if self.loops[row]:
                step = int(self.anticlockwise[row]) * (-1 if token.startswith("-") else 1)
            else:
                step = sign if i == 0 else (1 if self.sides[row, 0] == piece else -1)
            before, behind = self.sides[row][:: 1 if step > 0 else -1].tolist()
            if i and before != piece:
                return None
            piece = behind
            letters.append(step * (row + 1))
        return tuple(letters) if reduced(letters) == tuple(letters) else None

    def _row(self, token: str, written: str) -> int:
        if token not in self._row_of:
            raise ValueError(self._unknown(written, token, self._row_of))
        return self._row_of[token]

    def _rows(self, written: str) -> frozenset[int]:
        token = written.strip().removeprefix("-")
        if token not in self._rows_of_passage:
            raise ValueError(self._unknown(written, token, self._rows_of_passage))
        return self._rows_of_passage[token]

    def _unknown(self, written: str, token: str, known: Iterable[str]) -> str:
        near = difflib.get_close_matches(token, list(known), n=3, cutoff=CLOSE_ENOUGH)
        hint = f"; nearest: {', '.join(near)}" if near else ""
        if not self.tokens:
            hint = "; there are none: all paths are of one class"
        return f"{written!r} is no passage here that a class can depend on{hint}"
