"""Contacts as Genesis solved them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.physics.genesis_scene import BuiltScene
from vico.sim.physics.records import Contacts, Party


def read_contacts(solver: Any) -> NDArray[np.float64]:
    """Return the last step's contacts: two links, position, normal from the first to the second, and normal force.

    Returns
    -------
    ndarray
        float64, shape ``(n, 9)``.
    """
    solver.collider._contact_data_cache.clear()
    found = solver.collider.get_contacts(as_tensor=False, to_torch=False)
    kept = np.zeros((len(found["link_a"]), 9))
    # Genesis' normal points from the second to the first.
    kept[:, 0], kept[:, 1] = found["link_b"], found["link_a"]
    kept[:, 2:5], kept[:, 5:8] = found["position"], found["normal"]
    kept[:, 8] = np.abs(np.einsum("ni,ni->n", found["force"], found["normal"]))
    return kept


def contacts_of(scene: BuiltScene, kept: NDArray[np.float64], entity: NDArray[np.int32]) -> Contacts:
    """Return contacts as the protocol has them, given who stands in each place for movers."""
    links = kept[:, :2].astype(np.int64)
    party, owner = scene.party[links], scene.owner[links]
    movers = party == Party.BODY
    owner = np.where(movers, entity[np.where(movers, owner, 0)], owner).astype(np.int32)
    columns = (kept[:, column].copy() for column in (slice(2, 5), slice(5, 8), 8))
    return Contacts(party, owner, scene.number[links], *columns)
