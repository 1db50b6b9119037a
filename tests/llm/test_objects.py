"""Objects in a text: what is mended, what is broken, and which one is the last that was begun."""

from __future__ import annotations

import time

import pytest

from asked_person import ANNA, DRAFT, GOOD, Person
from vico.llm.replies import is_one_object, objects_in, parse_reply


@pytest.mark.parametrize(
    "final",
    [
        '{"name": "Anna", "age": 41,}',
        '```json\n{"name": "Anna", // hers, "not" {30}\n "age": 41 /* years */}\n```',
        '{"name": "Anna", # hers\n "age": 41}',
        '{\u00a0"name":\u202f"Anna", "age": 41}',
        '[{"name": "Anna", "age": 41,},]',
    ],
)
@pytest.mark.parametrize("before", ["", f"Draft: {DRAFT}\nFinal: ", f"```json\n{DRAFT}\n```\nBetter:\n"])
def test_what_loses_nothing_is_mended_in_the_last_object(before: str, final: str) -> None:
    assert parse_reply(before + final, Person, None).value == ANNA


@pytest.mark.parametrize(
    "final",
    [
        '{"name": "Anna", "a',
        "{",
        '{"name": "Anna" "age": 41}',
        "{'name': 'Anna', 'age': 41}",
        "{name: Anna, age: 41}",
        "{“name”: “Anna”, “age”: 41}",
        '{\\"name\\": \\"Anna\\", \\"age\\": 41}',
        f'{{"name": "Anna" "friend": {DRAFT}}}',
        f'{{"note": "Anna" "or": {DRAFT}',
        f'```json\n{{"name": "Anna", "age: 41\n```\nThat was {DRAFT[:3]}',
    ],
)
def test_a_draft_is_not_taken_where_the_answer_is_broken(final: str) -> None:
    found = parse_reply(f"Draft: {DRAFT}\nFinal: {final}", Person, None)
    assert found.value is None
    assert [one[:25] for one in found.findings] == ["the JSON object is broken"]


@pytest.mark.parametrize(
    "text",
    [
        f'Draft: {{"name": "Bea" "age": 30}}\nFinal: {GOOD}',
        f"A {{person}} in {{words: here}}: {GOOD}",
        f"{GOOD} is {{what}} was asked {{for}}",
        f"{{{GOOD}}}",
        f'<tool_call>{{"name": "Person", "arguments": {GOOD}\n</tool_call>',
    ],
)
def test_an_answer_after_what_is_broken_is_taken(text: str) -> None:
    assert parse_reply(text, Person, None).value == ANNA


def test_literals_of_python_are_mended_outside_strings_only() -> None:
    (one,) = objects_in('{"a": None, "b": [True, False], "c": "None, // True,}"}')
    assert one.content == '{"a": null, "b": [true, false], "c": "None, // True,}"}'


def test_a_mended_reply_that_is_an_object_has_no_thoughts_around_it() -> None:
    assert is_one_object('{"name": "<think>er</think>", "age": 41,}')
    assert not is_one_object(f"{GOOD} {DRAFT}")


@pytest.mark.parametrize(
    "part", ['{"a":"\n"', '{"a":"\n"}', "{a ", "{", "{/**/", '{"a":1,/*', '{"a":1#\n,', "{" + "a" * 99]
)
def test_hostile_braces_are_given_up_soon(part: str) -> None:
    text = part * ((1 << 20) // len(part))
    start = time.process_time()
    objects_in(text)
    assert time.process_time() - start < 5.0
