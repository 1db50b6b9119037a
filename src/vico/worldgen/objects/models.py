"""The models of what stands in a world, and whom to thank for those that are not ours."""

from __future__ import annotations

from collections.abc import Sequence

from vico.assets.furniture_pack import credits_of, our_models, read_things
from vico.assets.vehicles import vehicle_prototypes
from vico.world.mesh import Surface
from vico.world.model import Source
from vico.world.objects import Objects


def models_of(objects: Objects, *, installed: bool) -> tuple[dict[str, Sequence[Surface]], list[Source]]:
    """Return the surfaces of every prototype that `objects` use, and the sources of those that are not ours."""
    pack = read_things() if installed else None
    stand_ins = pack[0] if pack is not None else {}
    used = set(objects.prototype.tolist())
    models: dict[str, Sequence[Surface]] = {
        name: list(stand_ins.get(name, model.surfaces)) for name, model in our_models().items() if name in used
    }
    credits = [
        Source(kind="things", name=name, licence=credit.licence, attribution=credit.words, sha256=credit.sha256)
        for name, model in our_models().items()
        if name in models and name not in stand_ins and (credit := model.credit) is not None
    ]
    models |= {name: surfaces for name, surfaces in vehicle_prototypes().items() if name in used}
    foreign = [name for name in models if name in stand_ins]
    if pack is None or not foreign:
        return models, credits
    credits += [
        Source(kind="things", name=c.collection, licence=c.licence, attribution=c.words, sha256=pack[2])
        for c in credits_of(foreign)
    ]
    return models, credits
