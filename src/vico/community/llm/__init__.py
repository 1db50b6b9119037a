"""Communities written by a language model, held to the validator, with the procedural author behind it."""

from vico.community.llm.author import LlmCommunityAuthor

__all__ = ["LlmCommunityAuthor"]
