"""A thought is never the answer, in whatever form a server leaves it in the text."""

from __future__ import annotations

import pytest

from asked_person import ANNA, DRAFT, GOOD, Person
from vico.llm.replies import parse_reply, reply_text, without_thoughts


@pytest.mark.parametrize(
    "text",
    [
        f"<think>perhaps {DRAFT}</think>\n{GOOD}",
        f"perhaps {DRAFT}\n</think>{GOOD}",
        f"<thinking>{DRAFT}</thinking>{GOOD}",
        f"<Reasoning>{DRAFT}</Reasoning>{GOOD}",
        f"<thought>{DRAFT}</thought>{GOOD}",
        f"<scratchpad>{DRAFT}</scratchpad>{GOOD}",
        f"<analysis>\n{DRAFT}\n</analysis>{GOOD}",
        f'<think effort="high">{DRAFT}</think>{GOOD}',
        f"<seed:think>{DRAFT}</seed:think>{GOOD}",
        f"[THINK]{DRAFT}[/THINK]{GOOD}",
        f"<|begin_of_thought|>{DRAFT}<|end_of_thought|><|begin_of_solution|>{GOOD}<|end_of_solution|>",
        f"<|START_THINKING|>{DRAFT}<|END_THINKING|>{GOOD}",
        f"◁think▷{DRAFT}◁/think▷{GOOD}",
        f"<think>{DRAFT}<think>again</think>{DRAFT}</think>{GOOD}",
        f"{GOOD}\n<think>was {DRAFT} better?</think>",
        f"<|channel|>analysis<|message|>{DRAFT}<|end|><|start|>assistant<|channel|>final<|message|>{GOOD}<|return|>",
        f"<|channel|>analysis<|message|>{DRAFT}<|end|><|channel|>final <|constrain|>json<|message|>{GOOD}",
        f"<|channel|>analysis<|message|>{DRAFT}<|end|><|channel|>commentary to=functions.reply<|message|>{GOOD}",
        f"<|channel|>analysis<|message|>{DRAFT}<|end|><|start|>assistant to=functions.reply<|channel|>commentary json"
        f"<|message|>{GOOD}<|call|>",
        f"analysisWe take {DRAFT}?assistantfinal{GOOD}",
        f"Here is my thought process: {DRAFT}\n\nHere is my response: {GOOD}",
        f"Draft: {DRAFT}\nFinal: {GOOD}",
        f"<answer>{GOOD}</answer>",
        f"{DRAFT} is my first idea. <answer>{GOOD}</answer>",
        f"```json\n{GOOD}\n```\nAnything else?",
    ],
)
def test_the_answer_is_taken_and_the_thought_is_not(text: str) -> None:
    assert parse_reply(text, Person, None).value == ANNA


@pytest.mark.parametrize(
    "text",
    [
        f"<think>perhaps {DRAFT}",
        f"<thinking>perhaps {DRAFT}</thinking>",
        f"<|channel|>analysis<|message|>perhaps {DRAFT}<|end|>",
        f"<think>{DRAFT}</think> I can't decide.",
    ],
)
def test_a_thought_without_an_answer_is_no_answer(text: str) -> None:
    found = parse_reply(text, Person, None)
    assert found.value is None
    assert found.findings in (["the reply is thought and no answer"], ["the reply holds no JSON object"])


def test_words_in_a_record_are_no_thought() -> None:
    named = parse_reply('{"name": "<think>er</think>", "age": 41}', Person, None).value
    assert named is not None
    assert named.name == "<think>er</think>"


def test_a_draft_is_not_taken_where_the_answer_is_refused() -> None:
    found = parse_reply(f"{DRAFT} or rather {GOOD}", Person, lambda one: ["too old"] if one.age > 40 else [])
    assert (found.value, found.findings) == (None, ["too old"])


def test_text_without_thoughts_stays_as_it_is() -> None:
    text = "[1] see <b>here</b> and {braces} [planned]"
    assert without_thoughts(text) == text


@pytest.mark.parametrize(
    "text",
    [
        '{"name": "Anna", "age": "41"}',
        '{"name": "Anna", "age": 41.0}',
        '{"name": "Anna", "age": 41, "note": "hope this helps"}',
        f'{{"answer": {GOOD}}}',
        f'{{"Person": {GOOD}}}',
        f"[{GOOD}]",
        f'{{"reasoning": "She is 41.", "answer": {GOOD}}}',
        f'{{"reasoning": {DRAFT}, "result": {GOOD}, "confidence": 0.9}}',
        f'{{"people": [{GOOD}]}}',
        f'{{"name": "Person", "arguments": {GOOD}}}',
        f'<tool_call>\n{{"name": "Person", "arguments": {GOOD}}}\n</tool_call>',
        '{"type": "function", "function": "Person", "arguments": "{\\"name\\": \\"Anna\\", \\"age\\": 41}"}',
    ],
)
def test_what_is_plainly_meant_is_taken(text: str) -> None:
    assert parse_reply(text, Person, None).value == ANNA


@pytest.mark.parametrize(
    "text",
    [
        '{"name": "Anna", "age": "about 41"}',
        '{"name": "Anna", "age": "41.5"}',
        '{"name": "Anna", "ages": 41}',
        '{"name": "Anna", "age": 41, "names": "Anna Maria"}',
        '{"name": 41, "age": 41}',
        f'{{"type": "object", "properties": {GOOD}}}',
        f'{{"one": {DRAFT}, "other": {GOOD}}}',
        f'{{"name": 41, "friend": {GOOD}}}',
    ],
)
def test_what_is_not_plain_is_asked_for_again(text: str) -> None:
    found = parse_reply(text, Person, None)
    assert found.value is None
    assert found.findings


@pytest.mark.parametrize(
    ("message", "finish"),
    [
        ({"content": GOOD, "reasoning_content": DRAFT}, "stop"),
        ({"content": None, "reasoning_content": GOOD}, "stop"),
        ({"content": "", "reasoning": f"perhaps {DRAFT}, no: {GOOD}"}, "stop"),
        (
            {
                "content": [
                    {"type": "thinking", "thinking": [{"type": "text", "text": DRAFT}]},
                    {"type": "text", "text": GOOD},
                ]
            },
            "stop",
        ),
        ({"content": [{"type": "text", "text": DRAFT, "thought": True}, {"type": "text", "text": GOOD}]}, "stop"),
        ({"content": None, "tool_calls": [{"function": {"name": "Person", "arguments": GOOD}}]}, "tool_calls"),
        (
            {"content": "", "tool_calls": [{"function": {"name": "Person", "arguments": {"name": "Anna", "age": 41}}}]},
            "stop",
        ),
        ({"content": None, "function_call": {"name": "Person", "arguments": GOOD}}, "function_call"),
        ({"content": {"name": "Anna", "age": 41}}, "stop"),
        ({"content": "Let me do that.", "tool_calls": [{"function": {"arguments": GOOD}}]}, "tool_calls"),
        ({"content": f"<think>{DRAFT}</think>", "tool_calls": [{"function": {"arguments": GOOD}}]}, "stop"),
        ({"content": GOOD, "tool_calls": [{"function": {"arguments": "{}"}}]}, "stop"),
        (
            {"content": None, "tool_calls": [{"function": {"arguments": GOOD}}, {"function": {"arguments": "{}"}}]},
            "stop",
        ),
        ({"content": [{"type": "tool_use", "name": "reply", "input": {"name": "Anna", "age": 41}}]}, "stop"),
        ({"content": [GOOD[:9], GOOD[9:]]}, "stop"),
        ({"content": {"parts": [{"text": DRAFT, "thought": True}, {"text": GOOD}]}}, "stop"),
        ({"role": "model", "parts": [{"text": GOOD}]}, "STOP"),
        ({"content": "", "thinking": GOOD}, "stop"),
    ],
)
def test_the_answer_is_found_wherever_a_server_puts_it(message: dict[str, object], finish: str) -> None:
    assert parse_reply(reply_text(message, finish), Person, None).value == ANNA


@pytest.mark.parametrize(
    ("message", "finish"),
    [
        ({"content": "", "reasoning_content": f"perhaps {DRAFT}"}, "length"),
        ({"content": "", "reasoning_content": f"{DRAFT}? She could be older, too."}, "stop"),
    ],
)
def test_a_thought_beside_an_empty_answer_is_no_answer(message: dict[str, object], finish: str) -> None:
    assert reply_text(message, finish) == ""


def test_what_a_tool_says_to_the_model_is_no_answer() -> None:
    text = f"<|start|>functions.look to=assistant<|channel|>commentary<|message|>{DRAFT}<|end|>"
    assert parse_reply(text, Person, None).value is None
