"""What tests of a language model's replies ask for, and what servers say."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Person(BaseModel):
    """What is asked for."""

    model_config = ConfigDict(extra="forbid")

    name: str
    age: int


DRAFT, GOOD = '{"name": "Bea", "age": 30}', '{"name": "Anna", "age": 41}'
ANNA = Person(name="Anna", age=41)
