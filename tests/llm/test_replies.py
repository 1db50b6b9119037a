"""Reading records out of replies: nothing a model says may do more than be refused."""

from __future__ import annotations

import datetime
import json
import time
from email.message import Message
from email.utils import format_datetime

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, Field

from vico.io.http import retry_after
from vico.llm.replies import parse_reply, response_format


class Point(BaseModel):
    """A record with all kinds of fields."""

    x: float = Field(allow_inf_nan=False)
    words: list[str] = []
    inner: Point | None = None


@settings(max_examples=150, deadline=None)
@given(st.text(alphabet=st.sampled_from('{}[]":,\\ truefalsn0123.eE-xyzw\n\x1b\ud800é')))
def test_any_text_is_read_or_refused_with_a_reason(text: str) -> None:
    found = parse_reply(text, Point, None)
    assert (found.value is None) == bool(found.findings)
    assert all(one.isprintable() for one in found.findings)


@settings(max_examples=100, deadline=None)
@given(
    st.floats(allow_nan=False, allow_infinity=False),
    st.lists(st.text(alphabet=st.characters(exclude_categories=["Cs"]))),
    st.text(alphabet=st.characters(exclude_characters="{")),
)
def test_a_record_is_found_whatever_is_said_around_it(x: float, words: list[str], around: str) -> None:
    point = Point(x=x, words=[word for word in words if "</think>" not in word])
    found = parse_reply(f"{around}{point.model_dump_json()}{around.replace('</think>', '')}", Point, None)
    assert found.value == point


@pytest.mark.parametrize(
    "text",
    ['{"a":' + "[" * 500_000, '{"x": [' + "1," * 400_000, '{"x":1,"a":[' + '{"x":"' * 150_000, '{"words":["' * 90_000],
)
def test_hostile_replies_are_given_up_soon(text: str) -> None:
    start = time.process_time()
    assert parse_reply(text, Point, None).findings
    assert time.process_time() - start < 3.0


def test_a_schema_without_fixed_names_is_not_called_strict() -> None:
    class Free(BaseModel):
        points: dict[str, Point]

    assert response_format(Free)["json_schema"]["strict"] is False
    sent = response_format(Point)["json_schema"]
    assert sent["strict"] is True
    assert json.dumps(sent).count('"required": ["x", "words", "inner"]') == 1


@pytest.mark.parametrize("said", ["", "soon", "-5", "inf", "9" * 400])
def test_a_wait_that_is_no_time_is_ignored(said: str) -> None:
    headers = Message()
    headers["Retry-After"] = said
    assert retry_after(headers) is None


def test_a_date_to_wait_for_is_held_against_the_servers_clock() -> None:
    headers = Message()
    now = datetime.datetime(2001, 2, 3, 4, 5, 6, tzinfo=datetime.UTC)
    headers["Date"] = format_datetime(now, usegmt=True)
    headers["Retry-After"] = format_datetime(now + datetime.timedelta(seconds=90), usegmt=True)
    assert retry_after(headers) == 90.0
