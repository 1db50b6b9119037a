"""The influence challenge: two main agents court the members of a community for a day."""

from vico.challenges.influence.challenge import Influence

#: The challenge, for whoever runs challenges.
INFLUENCE = Influence()

__all__ = ["INFLUENCE", "Influence"]
