"""Newton's method on the joins of a structure: where a path of given structure has no kinks.

Joins that depend on each other, with only legs between them, form a block. Blocks are independent, so each
has its own step length, and trouble in one does not hold up the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vnav_drake.speed_graph.state import MOVING, Evaluator, State, stretch_of
from vnav_drake.speed_graph.structure import Kind, Structure, places_of

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

RESIDUAL = 1e-12  # below which there is nothing to gain in double precision
FINE = 1e-10  # the residual of a certified path
ITERATIONS = 40
PATIENCE = 14  # rounds until a short leg near a node counts as none
CIRCLING = 1e-4  # [rad]: with smaller residuals after so many rounds it does converge
CORNER = 0.02  # short: a part of the distance from the node to the nearest feature
REACH = 0.7  # longest step, as a part of the distance to the nearest feature
LEAST_REACH = 0.05
BENT = 0.1  # [rad]: with smaller residuals steps may be longer than the legs
LEGS = 2.0  # a leg may change by this many times its length
TINY = 1e-6  # [m]
BACKTRACKS = 5
SHRINK = 0.35
WORSE = 1.2  # a step may let the residual grow by this factor
SLOW = 0.9  # a residual that shrinks by less hardly changes
STUBBORN = 3  # rounds of that until steps are cut: kinks may jump where a leg meets the greatest speed
LOST = 0.5  # [rad]: from larger residuals any step will do
IMPROVED = 0.7  # a doubtful step must make the residual smaller by this factor
SHORTEST = 1e-9  # [m]: legs shorter than this have met
OVERLAP = 1e-10  # [m]: a shorter ride has no length


@dataclass(frozen=True)
class Iteration:
    """One step of Newton's method."""

    time: float  # [s]
    residual: float


@dataclass(frozen=True)
class Settled:
    """Where Newton's method ended, and what keeps it from going on."""

    state: State
    closing: tuple[int, ...]  # rides of no length that it would turn round
    met: Array  # (m + 1,) -1 or +1 for joins at the low or high end of their border, by their parameter


@dataclass(frozen=True)
class _Attempt:
    """What one step led to."""

    state: State
    error: Array  # of each block
    step: Array  # (m + 1,)
    cut: Array  # part of it that each block took
    together: Array  # (m + 1,) joins that have met, as `Settled.met`
    turning: tuple[int, ...]  # rides of no length that the step would turn round


class Solver(Evaluator):
    """Newton's method for one world, robot and braking law."""

    def solve(self, structure: Structure, history: list[Iteration]) -> Settled:
        """Joins moved until the residuals vanish, or joins meet each other or the ends of their borders."""
        state = self.state(structure)
        block = _blocks(structure)
        count = int(block.max(initial=-1)) + 1
        trust = np.full(count, REACH)
        resting = np.zeros(count, dtype=bool)  # converged as far as rounding lets it, or ended by an event
        slow = np.zeros(count, dtype=np.int64)  # rounds since the residual was last clearly less than ever
        least = np.full(count, np.inf)
        closing: set[int] = set()
        met = np.zeros(len(structure.joins))
        for rounds in range(ITERATIONS):
            history.append(Iteration(state.time, state.error))
            error = _errors(state, block, count)
            moving = ~resting & (error > RESIDUAL)
            if not moving.any():
                break
            stubborn = (slow >= STUBBORN) & (error < BENT)
            allowed = np.where(stubborn, SLOW * least, WORSE * error)
            tried = self._attempt(state, block, moving, error, allowed, trust, rounds > PATIENCE)
            if tried.turning:
                closing.update(tried.turning)
                sides = block[[k for i in tried.turning for k in (i, i + 1)]]
                resting[sides[sides >= 0]] = True
                continue
            if tried.together.any():
                met = np.where(tried.together != 0.0, tried.together, met)
                resting[np.unique(block[tried.together != 0.0])] = True
                continue
            trial, after, cut = tried.state, tried.error, tried.cut
            better = after < error
            slow = np.where(after < SLOW * least, 0, slow + 1)
            least = np.minimum(least, after)
            trust = np.where(better, np.minimum(REACH, 2.0 * trust), np.maximum(0.5 * trust, LEAST_REACH))
            stalled = moving & (error < FINE) & ~better
            resting |= stalled
            if stalled.any():
                step = np.where(_of_blocks(stalled, block), 0.0, tried.step)
                trial = self.state(self._moved(state, self._meeting(state, _spread(cut, block) * step)))
            state = trial
        return Settled(state, tuple(sorted(closing)), np.where(met != 0.0, met, state.bound))

    def _attempt(
        self,
        state: State,
        block: Indices,
        moving: Mask,
        error: Array,
        allowed: Array,
        trust: Array,
        patient: bool,
    ) -> _Attempt:
        """One step of all blocks that are `moving`, each cut until its residual is at most what is `allowed`.

        Where Newton's step is doubtful and does not help, every join of the block takes its own step.
        """
        count = len(error)
        newton, doubtful = self._newton(state, block, error)
        step = np.where(_of_blocks(moving, block), newton, 0.0)
        bent = _of_blocks(error > BENT, block)
        circling = _of_blocks(moving & (error > CIRCLING), block) & patient
        trial, after, together = state, error, np.zeros(len(block))
        step, turning = self._closing(state, step)
        cut = _cut(self._size(state, step, bent), block, trust)
        for _try in range(BACKTRACKS):
            if turning:
                break
            new = self._moved(state, self._meeting(state, _spread(cut, block) * step))
            together = self._met(new, circling)
            ended = np.zeros(count, dtype=bool)
            ended[block[together != 0.0]] = True
            if not (ended & doubtful).any():
                if ended.any():
                    break
                trial = self.state(new)
                after = _errors(trial, block, count)
                ended[block[(trial.bound != 0.0) & (state.bound == 0.0)]] = True
            astray = moving & doubtful & ((after > IMPROVED * error) | ended)
            if astray.any():
                doubtful &= ~astray
                step = np.where(_of_blocks(astray, block) & (state.bound == 0.0), _alone(state), step)
                step, turning = self._closing(state, step)
                cut = np.where(astray, _cut(self._size(state, step, bent), block, trust), cut)
                continue
            bad = moving & (after > np.maximum(allowed, FINE)) & (error <= LOST)
            if not bad.any():
                break
            cut[bad] *= SHRINK
        return _Attempt(trial, after, step, cut, together, turning)

    def _newton(self, state: State, block: Indices, error: Array) -> tuple[Array, Mask]:
        """Newton's step (m + 1,) in the borders' parameters, and blocks where it may well be wrong.

        Near a corner of two arcs all sizes look alike and the matrix is nearly singular, and legs that pass
        other borders turn the wrong way; each join alone knows its direction.
        """
        step, doubtful = np.zeros(len(block)), np.zeros(len(error), dtype=bool)
        alone, own = _alone(state), state.jacobian.diagonal()
        for k in range(len(error)):
            rows = np.flatnonzero((block == k) & (state.bound == 0.0))
            matrix, right = state.jacobian[np.ix_(rows, rows)], -state.residual[rows]
            try:
                step[rows] = np.linalg.solve(matrix, right)
            except np.linalg.LinAlgError:
                step[rows] = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
            large = np.abs(right) > 0.5 * error[k]
            astray = (own[rows] * state.diagonal[rows] < 0.0) & (np.abs(right) > FINE)
            doubtful[k] = bool(((step[rows] * alone[rows] < 0.0) & (large | astray)).any())
        return step, doubtful

    def _gaps(self, state: State, step: Array) -> list[tuple[int, float, float]]:
        """Rides with a loose join: piece, length in its border's parameter, and what a step adds to it."""
        joins, out = state.structure.joins, []
        for i, piece in enumerate(state.structure.pieces):
            if piece.is_ride and (joins[i].kind is Kind.ATTACH or joins[i + 1].kind is Kind.LEAVE):
                u0, u1 = (self.parameter(joins[k], piece.border) for k in (i, i + 1))
                out.append((i, piece.sweep * (u1 - u0), piece.sweep * float(step[i + 1] - step[i])))
        return out

    def _closing(self, state: State, step: Array) -> tuple[Array, tuple[int, ...]]:
        """The step, and rides of no length that would turn round.

        While other joins are still on their way Newton's step may say so by mistake: both joins of
        the ride, each on its own, must say so too, else they follow their own steps.
        """
        alone = np.where(state.bound == 0.0, _alone(state), 0.0)
        out, closing = step.copy(), []
        own = {i: gain for i, _, gain in self._gaps(state, alone)}
        for i, gap, gain in self._gaps(state, step):
            if gap <= OVERLAP and gain < 0.0:
                if own[i] < 0.0:
                    closing.append(i)
                else:
                    out[[i, i + 1]] = alone[[i, i + 1]]
        return out, tuple(closing)

    def _meeting(self, state: State, step: Array) -> Array:
        """The step cut at rides that it would turn round, so that their ends meet."""
        out = step.copy()
        for i, gap, gain in self._gaps(state, step):
            if gain < 0.0 and gap + gain < 0.0:
                out[[i, i + 1]] *= max(gap, 0.0) / -gain
        return out

    def _size(self, state: State, step: Array, bent: Mask) -> Array:
        """(m + 1,) how large a step is, over what a join can do while all looks alike.

        It can move by the distance to the nearest feature; for joins that are `bent` (m + 1,) each leg
        can change by `LEGS` times its length. Joins that move together may go far, so a chain of short
        legs around a small feature travels as one.
        """
        joins = state.structure.joins
        out, move = np.zeros(len(joins)), np.zeros((len(joins), 2))
        on = np.array([i for i, j in enumerate(joins) if j.kind in MOVING], dtype=np.int64)
        if len(on) == 0:
            return out
        curves = self.diagram.curves.take(np.array([joins[i].border for i in on]))
        u = np.array([joins[i].u for i in on])
        length = step[on] * stretch_of(curves, u)
        out[on] = np.abs(length) / np.maximum(curves.distance(u), TINY)
        sign = np.where(curves.span[:, 1] >= curves.span[:, 0], 1.0, -1.0)
        move[on] = curves.tangents(u) * (sign * length)[:, None]
        change = np.hypot(*np.diff(move, axis=0).T)
        leg = np.hypot(*np.diff(state.place, axis=0).T)
        leg[[i for i, piece in enumerate(state.structure.pieces) if piece.is_ride]] = np.inf
        turned = change / np.maximum(LEGS * leg, TINY)
        turned = np.where(bent, np.maximum(np.append(0.0, turned), np.append(turned, 0.0)), 0.0)
        return np.maximum(out, turned)

    def _met(self, structure: Structure, circling: Mask) -> Array:
        """(m + 1,) -1 or +1 for joins of a leg that has shrunk to nothing: they have met at a node.

        For joins that are `circling` (m + 1,) a short leg near a node is enough: around a corner all sizes
        look alike, and Newton's method may circle it. What is best there is then read off the kink.
        """
        joins = structure.joins
        place = places_of(self.diagram, joins)
        length = np.hypot(*np.diff(place, axis=0).T)
        out = np.zeros(len(joins))
        for i, piece in enumerate(structure.pieces):
            if piece.is_ride or length[i] > CORNER * self.diagram.world.diameter:
                continue
            one, other = joins[i], joins[i + 1]
            if one.kind not in MOVING or other.kind not in MOVING:
                continue
            shared = np.intersect1d(self.diagram.ends[one.border], self.diagram.ends[other.border])
            if len(shared) == 0:
                continue
            node = int(min(shared, key=lambda n: float(np.hypot(*(self.diagram.nodes[n] - place[i])))))
            near = CORNER * self.diagram.node_distance[node] if circling[i] else SHORTEST
            if np.hypot(*(place[[i, i + 1]] - self.diagram.nodes[node]).T).max() <= near:
                for k in (i, i + 1):
                    span = self.span[joins[k].border]
                    there = span[int(np.flatnonzero(self.diagram.ends[joins[k].border] == node)[0])]
                    out[k] = 1.0 if there == span.max() else -1.0
        return out

    def _moved(self, state: State, step: Array) -> Structure:
        joins = state.structure.joins
        border = np.array([j.border for j in joins])
        u = np.array([j.u for j in joins]) + step
        low, high = np.sort(self.span[np.maximum(border, 0)], axis=1).T
        u = np.where(border >= 0, np.clip(u, low, high), u)
        sweeps = np.zeros(len(state.structure.pieces))
        sweeps[state.leg] = state.flight.sweep
        return state.structure.moved(u, sweeps)


def _blocks(structure: Structure) -> Indices:
    """(m + 1,) number of the block of each join that can move; -1 for the others."""
    out = np.full(len(structure.joins), -1, dtype=np.int64)
    count = 0
    for i, join in enumerate(structure.joins):
        if join.kind in MOVING:
            linked = i > 0 and out[i - 1] >= 0 and not structure.pieces[i - 1].is_ride
            if not linked:
                count += 1
            out[i] = count - 1
    return out


def _spread(values: Array, block: Indices) -> Array:
    """(m + 1,) a value for each block, given to its joins; zero for joins that cannot move."""
    out: Array = np.where(block >= 0, values[block] if len(values) else 0.0, 0.0)
    return out


def _cut(size: Array, block: Indices, trust: Array) -> Array:
    """Part of the step that each block may take, from `Solver._size` (m + 1,)."""
    largest = np.zeros(len(trust))
    np.maximum.at(largest, block[block >= 0], np.abs(size[block >= 0]))
    return np.minimum(1.0, trust / np.maximum(largest, 1e-300))


def _of_blocks(chosen: Mask, block: Indices) -> Mask:
    """(m + 1,) joins of the chosen blocks."""
    out: Mask = np.where(block >= 0, chosen[block] if len(chosen) else False, False)
    return out


def _errors(state: State, block: Indices, count: int) -> Array:
    """Largest residual of each block's joins that are free to move."""
    error = np.zeros(count)
    free = (block >= 0) & (state.bound == 0.0)
    np.maximum.at(error, block[free], np.abs(state.residual[free]))
    return error


def _alone(state: State) -> Array:
    """(m + 1,) the step that each join would take if the others stood still."""
    diagonal = state.diagonal
    step: Array = -state.residual / np.where(diagonal != 0.0, diagonal, 1.0)
    return step
