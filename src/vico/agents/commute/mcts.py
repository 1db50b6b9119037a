"""Monte Carlo tree search over commute decisions (paper, appendix "Single Agent Task").

A node is a position. From it one may walk to an adjacent position, go to the nearest stop and take a bus or tram to any
stop that a line leads to from there, or go to the nearest bicycle station and ride to any station. Nodes are chosen by
UCB1. The reward of a node is minus the seconds that the distances as the crow flies take at estimated speeds, minus
alpha times the metres that are left to the target. The search knows neither timetable nor streets.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from vico.agents.commute.commuter import CommuteQuery
from vico.agents.commute.legs import LegMaker, nearest_point
from vico.rules import BIKE_SPEED, WALK_SPEED
from vico.seeds import rng
from vico.world.model import Point2
from vico.world.public import PublicMap
from vico.world.trips import Leg, Trip

#: Estimated speeds, m/s; a bus in traffic, with its stops.
SPEEDS = {"walk": WALK_SPEED, "bike": BIKE_SPEED, "bus": 10.0}


@dataclass(frozen=True)
class Settings:
    """How the search goes.

    Attributes
    ----------
    iterations
        Nodes that are added.
    alpha
        Weight of the metres left, the paper's.
    exploration
        Weight of UCB1's second term, in the rewards' range so far.
    stride
        How far an adjacent position is, metres.
    depth
        Decisions a simulation makes at most.
    """

    iterations: int = 1500
    alpha: float = 1.0
    exploration: float = math.sqrt(2.0)
    stride: float = 50.0
    depth: int = 12


@dataclass(frozen=True)
class Move:
    """A decision: by what, from which stop or station, and to which point; a walk has no stops."""

    mode: str
    end: Point2
    origin: str = ""
    destination: str = ""


@dataclass
class Node:
    """A position in the tree.

    Attributes
    ----------
    seconds
        Estimated, from the root.
    """

    point: Point2
    seconds: float
    move: Move | None = None
    parent: Node | None = None
    depth: int = 0
    visits: int = 0
    total: float = 0.0
    children: list[Node] = field(default_factory=list)
    untried: list[Move] | None = None


def reward(metres: dict[str, float], to_target: float, *, alpha: float = 1.0) -> float:
    """Return the paper's reward of a node.

    Parameters
    ----------
    metres
        As the crow flies from the root, by mode: walk, bike, bus.
    to_target
        Metres as the crow flies that are left.
    """
    return -sum(metres[mode] / SPEEDS[mode] for mode in metres) - alpha * to_target


class MctsPlanner:
    """Plans each commute by a search from where the agent is.

    Parameters
    ----------
    public_map
        Its stops, lines and stations.
    seed
        Of the episode.
    settings
        How the search goes.
    """

    def __init__(self, public_map: PublicMap, *, seed: int, settings: Settings | None = None) -> None:
        self._legs = LegMaker(public_map)
        self._seed = seed
        self._settings = settings or Settings()
        self._reached = {stop: self._legs.reached_from(stop) for stop in self._legs.stops}
        self._calls = 0

    def __call__(self, question: CommuteQuery) -> Trip | None:
        """Return the trip that the search finds; on a bicycle, that brings it back first."""
        self._calls += 1
        if question.vehicle == "bike":
            return self._legs.brought_back(question.here, question.goal, question.now, question.closed)
        return self._carried_out(self.search(question), question)

    def search(self, question: CommuteQuery) -> list[Move]:
        """Return the decisions of the best node found."""
        chance = rng(self._seed, "mcts", self._calls)
        root = Node(question.here, 0.0)
        best, best_reward = root, self._reward(root, question)
        low = best_reward
        for _ in range(self._settings.iterations):
            node = self._select(root, question, best_reward - low or 1.0)
            node = self._expand(node, question, chance)
            value = self._reward(node, question)
            low = min(low, value)
            if value > best_reward:
                best, best_reward = node, value
            # The reward counts at the node and at all above it.
            above: Node | None = node
            while above is not None:
                above.visits += 1
                above.total += value
                above = above.parent
        moves: list[Move] = []
        walker: Node | None = best
        while walker is not None and walker.move is not None:
            moves.append(walker.move)
            walker = walker.parent
        return moves[::-1]

    def _reward(self, node: Node, question: CommuteQuery) -> float:
        return -node.seconds - self._settings.alpha * math.dist(node.point, question.goal)

    def _select(self, node: Node, question: CommuteQuery, scale: float) -> Node:
        """Go down to a node that has moves left to try, by UCB1."""
        while True:
            if node.untried is None:
                node.untried = self._moves(node, question)
            if node.untried or not node.children:
                return node
            logarithm = math.log(max(node.visits, 1))
            node = max(
                node.children,
                key=lambda child: (
                    child.total / child.visits
                    + self._settings.exploration * scale * math.sqrt(logarithm / child.visits)
                ),
            )

    def _expand(self, node: Node, question: CommuteQuery, chance: np.random.Generator) -> Node:
        if not node.untried:
            return node
        move = node.untried.pop(int(chance.integers(len(node.untried))))
        child = self._child(node, move)
        node.children.append(child)
        return child

    def _child(self, node: Node, move: Move) -> Node:
        seconds = node.seconds
        point = node.point
        if move.origin:
            stop = self._point(move.origin)
            seconds += math.dist(point, stop) / SPEEDS["walk"]
            point = stop
        seconds += math.dist(point, move.end) / SPEEDS[move.mode]
        return Node(move.end, seconds, move, node, node.depth + 1)

    def _moves(self, node: Node, question: CommuteQuery) -> list[Move]:
        """Return what one may decide at a node: 1 + bus stops + bicycle stations at most."""
        if node.depth >= self._settings.depth or math.dist(node.point, question.goal) <= 1.0:
            return []
        moves = [Move("walk", _point_towards(node.point, question.goal, self._settings.stride))]
        stop = nearest_point(node.point, self._legs.stops, question.closed)
        if stop is not None:
            moves += [Move("bus", self._legs.stops[to], stop, to) for to in self._reached[stop]]
        station = nearest_point(node.point, {name: self._point(name) for name in self._legs.stations}, question.closed)
        if station is not None:
            moves += [Move("bike", self._point(to), station, to) for to in self._legs.stations if to != station]
        return moves

    def _point(self, name: str) -> Point2:
        return self._legs.stops[name] if name in self._legs.stops else self._legs.point_of(name)

    # -- decisions into trips ----------------------------------------------------------------------------------------

    def _carried_out(self, moves: list[Move], question: CommuteQuery) -> Trip | None:
        """Return the trip that the decisions come to: walks joined, rides that nobody offers left out."""
        legs: list[Leg] = []
        here, now = question.here, question.now
        for move in moves:
            if move.mode == "walk":
                continue
            walk = self._legs.walk(here, self._point(move.origin), now)
            ready = now if walk is None else walk.arrive
            ride = (
                self._legs.bus(move.origin, move.destination, ready)
                if move.mode == "bus"
                else self._legs.rent(move.origin, move.destination, move.end, ready)
            )
            if ride is None:
                continue
            legs += [ride] if walk is None or walk.metres == 0.0 else [walk, ride]
            here, now = ride.end, ride.arrive
        last = self._legs.walk(here, question.goal, now)
        if last is not None:
            legs.append(last)
        return Trip(question.now, tuple(legs)) if legs else None


def _point_towards(point: Point2, goal: Point2, stride: float) -> Point2:
    away = math.dist(point, goal)
    if away <= stride:
        return goal
    share = stride / away
    return point[0] + share * (goal[0] - point[0]), point[1] + share * (goal[1] - point[1])
