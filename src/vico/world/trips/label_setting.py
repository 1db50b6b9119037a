"""The compiled part of the search for trips: labels, in what order they are settled, and what may come after each.

What may be ridden from each node, and how far it is, are arrays here: `Timetable` of a network, `GroundWays` of a
query.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY
from vico.io.compiled import compiled, inlined
from vico.rules import BIKE_RATE, BIKE_SPEED, BUS_DWELL, BUS_FARE
from vico.world.trips.model import AHEAD, ALIGHT, BOARD, DISMOUNT, MOUNT

#: Prices are counted in parts of which so many are 1.
CENTS = 100.0
#: `line` of a step on foot, and by bicycle.
ON_FOOT, BY_BICYCLE = -2, -1

# Seconds: arrivals that rounding tells apart may be one and the same.
_ALIKE = 1e-6
# Metres that a bound is below the bee line, so that rounding makes none too high.
_BELOW = 0.02
_FARE, _RATE = round(100 * BUS_FARE), round(100 * BIKE_RATE)
_DAY = float(DAY)

# A way to be somewhere.
LABEL = np.dtype(
    [
        ("least", np.float64),  # when one is at the goal at the earliest; labels are settled in this order
        ("arrive", np.float64),
        ("metres", np.float64),  # on foot so far
        ("depart", np.float64),  # when the bus or bicycle leaves that one came with
        ("price", np.int64),  # so far, in hundredths
        ("node", np.int32),
        ("parent", np.int32),  # label one came from, -1 at the start
        ("line", np.int32),  # how one came: number of the line, or one of the above
        ("first", np.int32),  # indices among the line's stops, counted on past the last
        ("last", np.int32),
        ("steps", np.int32),  # from the start
        ("walked", np.bool_),  # one came on foot, to board or at the goal; else one has just got off, or not set out
    ],
    align=True,
)


class Timetable(NamedTuple):
    """Timetable of all lines, one after another.

    Attributes
    ----------
    calls
        Line and index of the stop among the line's, of each call at each node, int64, shape ``(calls, 2)``.
    first_call
        Where the calls at each node begin, int64, shape ``(nodes + 1,)``.
    first_stop, nodes
        Where the stops of each line begin, int64, shape ``(lines + 1,)``, and the node of each, -1 if it is closed.
    first_time, travel
        Where the seconds of each line begin, and the seconds from the start of a round to each of its stops, then, of
        lines that go round, to the first one again.
    first_departure, departures
        Where the departures of each line begin, and when rounds of a day begin, seconds.
    buses
        Of each line; 0 of those that do not go round.
    gives, takes
        Nodes where a bicycle may be taken, bool, and left, int64, ascending.
    boardable
        Nodes where a ride may begin, int64, ascending.
    """

    calls: NDArray[np.int64]
    first_call: NDArray[np.int64]
    first_stop: NDArray[np.int64]
    nodes: NDArray[np.int64]
    first_time: NDArray[np.int64]
    travel: NDArray[np.float64]
    first_departure: NDArray[np.int64]
    departures: NDArray[np.float64]
    buses: NDArray[np.int64]
    gives: NDArray[np.bool_]
    takes: NDArray[np.int64]
    boardable: NDArray[np.int64]


class GroundWays(NamedTuple):
    """Lengths of ways between the nodes, the start, and the goal, which is the last; of a way not known, a bound.

    Attributes
    ----------
    xy, off
        ENU metres, shape ``(n, 2)``, and metres by which ways from a point may be shorter than the bee line.
    place
        Of each node, by which the known ways are kept.
    row, known
        Row of `known` by place, -1 if no way from there is known; metres, seconds on foot and by bicycle by row and
        place, NaN for what is not known.
    of_start, of_goal
        The same of ways from the start and to the goal, shape ``(n, 3)``.
    bee_line
        Metres from each to the goal, at least.
    """

    xy: NDArray[np.float64]
    off: NDArray[np.float64]
    place: NDArray[np.int64]
    row: NDArray[np.int64]
    known: NDArray[np.float64]
    of_start: NDArray[np.float64]
    of_goal: NDArray[np.float64]
    bee_line: NDArray[np.float64]


class Bounds(NamedTuple):
    """Limits that labels have to keep to, and speeds.

    Attributes
    ----------
    walk_speed, top_speed
        Metres a second on foot, and as the crow flies by whatever is fastest.
    cash
        What rides may cost together.
    latest
        Second by which one has to be there.
    direct
        Whether one may walk all the way.
    all_good
        Whether all labels at the goal are wanted than which none is better; else one of the best.
    """

    walk_speed: float
    top_speed: float
    cash: float
    latest: float
    direct: bool
    all_good: bool


@inlined
def _way(ground, a, b, walk_speed):
    """Return metres, seconds on foot and by bicycle from one node to another, at least."""
    n = len(ground.xy)
    row = np.int64(-1)
    if a == n - 2:
        found = ground.of_start[b]
    elif b == n - 1:
        found = ground.of_goal[a]
    else:
        row = ground.row[ground.place[a]]
        found = ground.known[max(row, 0), ground.place[b]]
    if (row >= 0 or a == n - 2 or b == n - 1) and not math.isnan(found[0]):
        return found[0], found[1], found[2]
    metres = straight_line(ground.xy, ground.off, a, b)
    return metres, metres / walk_speed, metres / BIKE_SPEED


@compiled
def straight_line(xy, off, a, b):
    """Return metres that a way between two points has at least."""
    dx, dy = xy[a, 0] - xy[b, 0], xy[a, 1] - xy[b, 1]
    return max(math.sqrt(dx * dx + dy * dy) - off[a] - off[b] - _BELOW, 0.0)


@compiled
def straight_lines(xy, off, goal):
    """Return metres that ways from each point to one of them have at least."""
    found = np.empty(len(xy))
    for k in range(len(xy)):
        found[k] = straight_line(xy, off, k, goal)
    return found


@compiled
def _is_before(labels, a, b):
    """Return whether a label is settled before another: no two that differ are equal in what is compared."""
    one, other = labels[a], labels[b]
    if one.least != other.least:
        return one.least < other.least
    if one.arrive != other.arrive:
        return one.arrive < other.arrive
    if one.price != other.price:
        return one.price < other.price
    if one.metres != other.metres:
        return one.metres < other.metres
    if one.steps != other.steps:
        return one.steps < other.steps
    # The first step in which they differ decides, which is the last one met on the way back.
    before = False
    while a >= 0:
        one, other = labels[a], labels[b]
        if one.node != other.node:
            before = one.node < other.node
        elif one.line != other.line:
            before = one.line < other.line
        elif one.first != other.first:
            before = one.first < other.first
        elif one.last != other.last:
            before = one.last < other.last
        a, b = one.parent, other.parent
    return before


@compiled
def _push(queue, count, labels, label):
    """Put a label into a heap of `count` of them."""
    k = count
    while k > 0:
        above = (k - 1) // 2
        if not _is_before(labels, label, queue[above]):
            break
        queue[k] = queue[above]
        k = above
    queue[k] = label


@compiled
def _pop(queue, count, labels):
    """Take the first label out of a heap of `count`."""
    first, label = queue[0], queue[count - 1]
    count -= 1
    k = 0
    while 2 * k + 1 < count:
        below = 2 * k + 1
        if below + 1 < count and _is_before(labels, queue[below + 1], queue[below]):
            below += 1
        if not _is_before(labels, queue[below], label):
            break
        queue[k] = queue[below]
        k = below
    queue[k] = label
    return first


@compiled
def _is_beaten(labels, first, then, price, arrive, metres, strictly):
    """Return whether one of a list of labels is as good in everything, and better in something if `strictly`."""
    k = first
    while k >= 0:
        other = labels[k]
        if (
            other.arrive <= arrive
            and other.price <= price
            and other.metres <= metres
            and (not strictly or other.arrive < arrive or other.price < price or other.metres < metres)
        ):
            return True
        k = then[k]
    return False


class _LegOffer(NamedTuple):
    """A leg that leads on from a label.

    Attributes
    ----------
    parent
        The label it comes from.
    node
        Where it leads.
    depart, arrive
        When it begins and ends, seconds.
    metres, price
        On foot, and cents.
    line, first, last
        Of the ride: line, first and last stop.
    """

    parent: int | np.int64
    node: int | np.int64
    depart: float
    arrive: float
    metres: float
    price: int | np.int64
    line: int | np.int64
    first: int
    last: int | np.int64


@compiled
def _offer(labels, lists, queue, counts, leg, bounds, left):
    """Take a label in if it may come to be the best: `counts` are those of labels, of the heap, and the limit."""
    made, then_made, settled, then_settled = lists
    parent, arrive = leg.parent, leg.arrive
    walked = leg.line == ON_FOOT
    total, limit = labels[parent].price + leg.price, counts[2]
    if total / CENTS > bounds.cash or arrive + left > limit:
        return counts
    metres = leg.metres + labels[parent].metres
    place, goal = 2 * leg.node + walked, len(made) - 1
    if _is_beaten(labels, settled[place], then_settled, total, arrive, metres, False):
        return counts
    if bounds.all_good:
        if _is_beaten(labels, settled[goal], then_settled, total, arrive + left, metres, False):
            return counts
    elif place == goal:
        limit = min(limit, arrive)
    count, waiting = counts[0], counts[1]
    if _is_beaten(labels, made[place], then_made, total, arrive, metres, True):
        return count, waiting, limit
    one = labels[count]
    one.least, one.arrive, one.metres, one.depart, one.price = arrive + left, arrive, metres, leg.depart, total
    one.node, one.parent, one.walked = leg.node, parent, walked
    one.line, one.first, one.last = leg.line, leg.first, leg.last
    one.steps = labels[parent].steps + 1
    then_made[count], made[place] = made[place], count
    _push(queue, waiting, labels, count)
    return count + 1, waiting + 1, limit


@inlined
def _next_round(timetable, line, stop, second):
    """Return the number of the first round of a line that leaves a stop at a time or after it."""
    begin, end = timetable.first_departure[line], timetable.first_departure[line + 1]
    if timetable.buses[line] > 0:
        at = timetable.departures[begin]
        second -= 0.0 if stop == 0 else at + timetable.travel[timetable.first_time[line] + stop] + BUS_DWELL - at
    else:
        second = second - timetable.travel[timetable.first_time[line] + stop] - BUS_DWELL
    of_the_day = second % _DAY
    return np.searchsorted(timetable.departures[begin:end], of_the_day) + (end - begin) * np.int64(second // _DAY)


@inlined
def _begins(timetable, line, number):
    """Return when a round of a line begins, seconds from the midnight before the first."""
    begin, n = timetable.first_departure[line], timetable.first_departure[line + 1] - timetable.first_departure[line]
    return timetable.departures[begin + number % n] + _DAY * (number // n)


@compiled
def ride_along(timetable, call, ready, rides):
    """Write where one may get off the next bus or tram that makes a call, for who is there at `ready`, and when.

    Parameters
    ----------
    timetable, call
        The call by number.
    ready
        Second of the day.
    rides
        Node, second, and index among the line's stops of each, float64, shape ``(stops, 3)``; written.

    Returns
    -------
    tuple
        Index of the stop among the line's, when the bus leaves it, and how many rides were written.
    """
    line, k = timetable.calls[call]
    at, n = timetable.first_stop[line], timetable.first_stop[line + 1] - timetable.first_stop[line]
    travel = timetable.travel[timetable.first_time[line] :]
    round_trip = timetable.buses[line] > 0
    turn = _next_round(timetable, line, k, ready + BOARD + (0.0 if round_trip and k == 0 else AHEAD))
    begins = _begins(timetable, line, turn)
    leaves = begins if round_trip and k == 0 else begins + travel[k] + BUS_DWELL
    onward = 0.0
    if round_trip:
        onward = max(_begins(timetable, line, turn + timetable.buses[line]), begins + travel[n] + BUS_DWELL)
    count = 0
    for last in range(k + 1, k + n if round_trip else n):
        to = timetable.nodes[at + last % n]
        if to >= 0 and to != timetable.nodes[at + k]:
            # At the end of its round the bus stands at the first stop until its next departure.
            arrives = begins + travel[last] if last <= n else onward + travel[last - n]
            rides[count, 0], rides[count, 1], rides[count, 2] = to, arrives + ALIGHT, last
            count += 1
    return k, leaves, count


@compiled
def _most_rides(timetable):
    """Return how many rides there are at most from one node."""
    most = 0
    for node in range(len(timetable.first_call) - 1):
        count = 0
        for call in range(timetable.first_call[node], timetable.first_call[node + 1]):
            line = timetable.calls[call, 0]
            count += timetable.first_stop[line + 1] - timetable.first_stop[line]
        most = max(most, count)
    return most + len(timetable.takes)


@compiled
def _on_wheels(label, memory, counts, rules, rides):
    """Offer what may be ridden from where one has come on foot."""
    labels, lists, queue = memory
    timetable, ground, bounds = rules
    node, ready = labels[label].node, labels[label].arrive
    for call in range(timetable.first_call[node], timetable.first_call[node + 1]):
        line = timetable.calls[call, 0]
        k, leaves, count = ride_along(timetable, call, ready, rides)
        for j in range(count):
            to = np.int64(rides[j, 0])
            left = ground.bee_line[to] / bounds.top_speed
            ride = _LegOffer(label, to, leaves, rides[j, 1], 0.0, _FARE, line, k, np.int64(rides[j, 2]))
            counts = _offer(labels, lists, queue, counts, ride, bounds, left)
    if timetable.gives[node]:
        for to in timetable.takes:
            seconds = _way(ground, node, to, bounds.walk_speed)[2]
            left = ground.bee_line[to] / bounds.top_speed
            if to == node or seconds == math.inf or ready + seconds + left > counts[2]:
                continue
            arrive = ready + MOUNT + seconds + DISMOUNT
            price = _RATE * np.int64(math.ceil((seconds + DISMOUNT) / 60.0))
            cycled = _LegOffer(label, to, ready, arrive, 0.0, price, np.int64(BY_BICYCLE), 0, 0)
            counts = _offer(labels, lists, queue, counts, cycled, bounds, left)
    return counts


@compiled
def _walks(label, memory, counts, rules):
    """Offer the walks from where one has got off, or begins: to the goal, and to where a ride begins."""
    labels, lists, queue = memory
    timetable, ground, bounds = rules
    node, now = labels[label].node, labels[label].arrive
    goal = len(ground.xy) - 1
    if bounds.direct or labels[label].parent >= 0:
        metres, seconds, _ = _way(ground, node, goal, bounds.walk_speed)
        if seconds < math.inf:
            walk = _LegOffer(label, goal, now, now + seconds, metres, 0, np.int64(ON_FOOT), 0, 0)
            counts = _offer(labels, lists, queue, counts, walk, bounds, 0.0)
    for to in timetable.boardable:
        metres, seconds, _ = _way(ground, node, to, bounds.walk_speed)
        if to == node:
            # Changing where one got off costs no way.
            metres, seconds = 0.0, 0.0
        if seconds < math.inf:
            walk = _LegOffer(label, to, now, now + seconds, metres, 0, np.int64(ON_FOOT), 0, 0)
            left = ground.bee_line[to] / bounds.top_speed
            counts = _offer(labels, lists, queue, counts, walk, bounds, left)
    return counts


@compiled
def settle(timetable, ground, bounds, depart):
    """Search for ways to the goal.

    Returns
    -------
    tuple
        The labels that were made, `LABEL`, and the numbers of those at the goal that are asked for, int64.
    """
    n = len(ground.xy)
    goal, new = n - 1, max(len(timetable.boardable) + 1, _most_rides(timetable))
    labels, queue = np.empty(4 * new, LABEL), np.empty(4 * new, np.int32)
    made, settled = np.full(2 * n, -1, np.int32), np.full(2 * n, -1, np.int32)
    then_made, then_settled = np.empty(4 * new, np.int32), np.empty(4 * new, np.int32)
    rides = np.empty((len(timetable.nodes), 3))
    first = labels[0]
    first.least, first.arrive, first.metres, first.depart, first.price = depart, depart, 0.0, depart, 0
    first.node, first.parent, first.line, first.first, first.last = n - 2, -1, ON_FOOT, 0, 0
    first.steps, first.walked = 0, False
    queue[0] = 0
    counts = np.int64(1), np.int64(1), bounds.latest
    found = [np.int64(0)]
    found.pop()
    while counts[1] > 0:
        label = np.int64(_pop(queue, counts[1], labels))
        counts = counts[0], counts[1] - 1, counts[2]
        if len(found) > 0 and not bounds.all_good and labels[label].least > labels[found[0]].arrive + _ALIKE:
            break
        node, walked = np.int64(labels[label].node), labels[label].walked
        price, arrive, metres = labels[label].price, labels[label].arrive, labels[label].metres
        place = 2 * node + walked
        if _is_beaten(labels, settled[place], then_settled, price, arrive, metres, False):
            continue
        then_settled[label], settled[place] = settled[place], label
        if node == goal:
            found.append(label)
            continue
        if counts[0] + new > len(labels):
            more = 2 * len(labels)
            labels, queue = _longer(labels, more), _longer(queue, more)
            then_made, then_settled = _longer(then_made, more), _longer(then_settled, more)
        memory = labels, (made, then_made, settled, then_settled), queue
        if walked:
            counts = _on_wheels(label, memory, counts, (timetable, ground, bounds), rides)
        else:
            counts = _walks(label, memory, counts, (timetable, ground, bounds))
    return labels[: counts[0]], np.array(found, np.int64)


@compiled
def _longer(array, length):
    longer = np.empty(length, array.dtype)
    longer[: len(array)] = array
    return longer
