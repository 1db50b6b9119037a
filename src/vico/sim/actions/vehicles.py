"""Getting on and off buses and bicycles; `vico.sim.rides` carries who rides."""

from __future__ import annotations

from vico.clock import DAY, clock_of
from vico.rules import BIKE_RATE, BIKE_REACH, BUS_DOOR_REACH, BUS_FARE, ReasonCode
from vico.sim import rides
from vico.sim.actions.model import ActionType, Refusal, Situation, Values
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Vehicle
from vico.sim.transit import TransitSystem

_NEAR_STOP = 6.0  # metres from the place to wait within which a stop is told of
_NO_TRANSIT = "this run has no transit"


def check_enter_bus(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge boarding: a bus that stands with a door near, a seat, the fare."""
    transit, p = state.transit, state.people
    if transit is None:
        return Refusal(ReasonCode.NO_TRANSIT, f"enter_bus: {_NO_TRANSIT}")
    refusal = _refuse_unless_on_foot_outdoors("enter_bus", i, state)
    if refusal is not None:
        return refusal
    bus = transit.bus_at(p.position[i])
    if bus is None:
        line = transit.goes_round(p.position[i], _NEAR_STOP)
        if line is not None:
            said = f"enter_bus: bus {line} does not come by here: it goes round a street that is closed"
            return Refusal(ReasonCode.CLOSED, said)
        said = (
            f"enter_bus: no bus or tram stands with a door within {BUS_DOOR_REACH:g} m{_from_depot(i, state, transit)}"
        )
        return Refusal(ReasonCode.NO_VEHICLE, said)
    if transit.ends(bus):
        what, _, name = transit.service_of(bus)
        return Refusal(ReasonCode.NO_VEHICLE, f"enter_bus: {what} {name} ends here{_from_depot(i, state, transit)}")
    if transit.aboard(bus) >= transit.capacity(bus):
        what, _, name = transit.service_of(bus)
        return Refusal(ReasonCode.FULL, f"enter_bus: {what} {name} is full with {transit.capacity(bus)} people")
    return _refuse_unless_paid("enter_bus", "the fare is", BUS_FARE, i, state)


def _from_depot(i: int, state: SimulationState, transit: TransitSystem) -> str:
    """Say which bus is awaited from the depot where somebody stands, if one is."""
    expected = transit.expected_from_depot(state.people.position[i], _NEAR_STOP)
    if expected is None:
        return ""
    return f"; bus {expected[0]} is in the depot until shortly before {clock_of(expected[1] % DAY)}"


def check_exit_bus(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge getting off: at a stop, with free ground at a door."""
    transit = state.transit
    if transit is None:
        return Refusal(ReasonCode.NO_TRANSIT, f"exit_bus: {_NO_TRANSIT}")
    if state.people.vehicle[i] != Vehicle.BUS:
        return Refusal(ReasonCode.NOT_RIDING, "exit_bus: not in a bus or tram")
    bus = rides.bus_of(i, state, transit)
    if transit.stopped_at(bus) is None:
        return Refusal(ReasonCode.MOVING, f"exit_bus: the {transit.service_of(bus)[0]} is moving")
    if rides.spot_beside(bus, state, transit) is None:
        return Refusal(ReasonCode.NO_FREE_SPOT, "exit_bus: no free ground at the doors")
    return None


def check_enter_bike(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge mounting: a free bicycle near, and room to ride off."""
    transit = state.transit
    if transit is None:
        return Refusal(ReasonCode.NO_TRANSIT, f"enter_bike: {_NO_TRANSIT}")
    refusal = _refuse_unless_on_foot_outdoors("enter_bike", i, state)
    if refusal is not None:
        return refusal
    bike = transit.bicycles.at(state.people.position[i])
    if bike is None:
        return Refusal(ReasonCode.NO_VEHICLE, f"enter_bike: no free bicycle within {BIKE_REACH:g} m")
    if rides.room_to_ride(i, bike, state, transit) is None:
        return Refusal(ReasonCode.NO_FREE_SPOT, "enter_bike: no room to get on here")
    return _refuse_unless_paid("enter_bike", "the first minute costs", BIKE_RATE, i, state)


def check_exit_bike(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge dismounting."""
    if state.transit is None:
        return Refusal(ReasonCode.NO_TRANSIT, f"exit_bike: {_NO_TRANSIT}")
    if state.people.vehicle[i] != Vehicle.BIKE:
        return Refusal(ReasonCode.NOT_RIDING, "exit_bike: not on a bicycle")
    if rides.spot_beside_bicycle(i, state, state.transit) is None:
        return Refusal(ReasonCode.NO_FREE_SPOT, "exit_bike: no free ground beside the bicycle; ride on a little")
    return None


def _refuse_unless_paid(kind: str, what: str, price: float, i: int, state: SimulationState) -> Refusal | None:
    cash, owed = float(state.people.cash[i]), float(state.people.owed[i])
    if owed > 0.0:
        return Refusal(ReasonCode.NO_MONEY, f"{kind}: you owe {owed:.2f} for an earlier ride")
    if cash < price:
        return Refusal(ReasonCode.NO_MONEY, f"{kind}: {what} {price:g}, and you have {cash:.2f}")
    return None


def _refuse_unless_on_foot_outdoors(kind: str, i: int, state: SimulationState) -> Refusal | None:
    if state.people.vehicle[i] != Vehicle.NONE:
        return Refusal(ReasonCode.RIDING_ALREADY, f"{kind}: riding already")
    if state.people.room[i] >= 0:
        return Refusal(ReasonCode.INDOORS, f"{kind}: go outdoors first")
    return None


VEHICLES = (
    ActionType(
        "enter_bus",
        "Board a bus or tram that stands with a door near; the fare is 2.",
        lambda values, i, state: rides.board(i, state),
        check_enter_bus,
    ),
    ActionType(
        "exit_bus",
        "Get off the bus or tram at a stop.",
        lambda values, i, state: rides.alight(i, state),
        check_exit_bus,
        when=Situation.ON_FOOT | Situation.IN_BUS,
    ),
    ActionType(
        "enter_bike",
        "Get on a free bicycle within 2 m.",
        lambda values, i, state: rides.mount(i, state),
        check_enter_bike,
    ),
    ActionType(
        "exit_bike",
        "Get off the bicycle, and pay: 0.2 a started minute, 20 more away from a station.",
        lambda values, i, state: rides.dismount(i, state),
        check_exit_bike,
        when=Situation.ON_FOOT | Situation.ON_BIKE,
    ),
)
