"""Words of error messages."""

from vico.errors import some_of


def test_of_many_names_a_message_holds_the_first_and_their_number() -> None:
    assert some_of(["a", "b"]) == "a, b"
    assert some_of([f"resident_{k}" for k in range(1000)], 2) == "resident_0, resident_1, ... (1,000 in all)"
