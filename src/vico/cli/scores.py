"""`vico score-pictures`: FID and KID of a folder of pictures against one of photos."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from vico.cli.output import print_json, print_table
from vico.viewer.picture_scores import FeatureNetwork, pictures_in, scores


def score(pictures: Path, *, photos: Path, weights: Path, scale: str, json: bool) -> int:
    """Print the scores."""
    network = FeatureNetwork(weights, scale=scale)
    found = asdict(scores(network.features(pictures_in(pictures)), network.features(pictures_in(photos))))
    found |= {"weights": weights.name, "scale": scale}
    if json:
        print_json(found)
    else:
        print_table(f"{pictures} beside {photos}", found)
    return 0
