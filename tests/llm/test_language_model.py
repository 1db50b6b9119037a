"""Asking a model for records: against a real server, with all the ways in which servers and models go wrong."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field

from http_server import Answer, Request, serve
from llm_server import KEY, Script, model_server, refuses, says
from vico.errors import InputError, LlmBudgetError, LlmReplyError, MissingFileError, SchemaError, SourceError
from vico.llm import Budget, Connection, Endpoint, LanguageModel, Sampling, system, user


class Shop(BaseModel):
    """What the tests ask for."""

    model_config = ConfigDict(extra="forbid")

    name: str = Field(min_length=1)
    kind: Literal["bakery", "bar"]
    seats: int = Field(default=0, ge=0)


GOOD = '{"name": "Kulma", "kind": "bar", "seats": 12}'
KULMA = Shop(name="Kulma", kind="bar", seats=12)
MESSAGES = [system("You invent shops."), user("Invent one.")]


def model(base: str, **options: Any) -> LanguageModel:
    sampling = Sampling(
        **{name: options.pop(name) for name in ("seed", "temperature", "max_tokens") if name in options}
    )
    sent = {"timeout": 5.0, "sleep": lambda seconds: None}
    sent |= {name: options.pop(name) for name in ("timeout", "retries", "sleep") if name in options}
    endpoint = Endpoint(base, "tiny", key=KEY, price=(1.0, 2.0))
    return LanguageModel(endpoint, sampling=sampling, connection=Connection(**sent), **options)


def test_a_record_comes_back_with_what_it_took() -> None:
    with model_server(Script(says(GOOD, read=1000, written=500), key=KEY)) as (base, script):
        reply = model(base, seed=3, temperature=0.5, max_tokens=900).ask(MESSAGES, Shop)
    assert reply.value == KULMA
    assert reply.attempts == 1
    assert (reply.usage.calls, reply.usage.read, reply.usage.written) == (1, 1000, 500)
    assert reply.usage.cost == pytest.approx(0.002)  # 1000 tokens at $1 and 500 at $2 a million
    (asked,) = script.asked
    assert (asked["model"], asked["seed"], asked["temperature"], asked["max_tokens"]) == ("tiny", 3, 0.5, 900)
    assert asked["messages"] == MESSAGES
    sent = asked["response_format"]["json_schema"]
    assert sent["strict"] is True
    assert sent["schema"]["required"] == ["name", "kind", "seats"]
    assert sent["schema"]["additionalProperties"] is False
    assert "minLength" not in json.dumps(sent)


def test_what_is_wrong_is_said_to_the_model_until_it_is_right() -> None:
    bad = ['{"name": "Kulma", "kind": "castle", "seats": "12"}', '{"name": "Kulma", "kind": "bar", "seats": 99}']
    with model_server(*bad, GOOD) as (base, script):
        reply = model(base).ask(MESSAGES, Shop, check=lambda s: ["seats: 99 don't fit"] if s.seats > 50 else [])
    assert (reply.value, reply.attempts, reply.usage.calls) == (KULMA, 3, 3)
    assert "kind: Input should be 'bakery' or 'bar'" in script.last_words(1)
    assert "seats: Input should be a valid integer" in script.last_words(1)
    assert '"additionalProperties":false' in script.last_words(1)
    assert script.asked[1]["messages"][-2] == {"role": "assistant", "content": bad[0]}
    assert "seats: 99 don't fit" in script.last_words(2)
    assert len(script.asked[2]["messages"]) == len(script.asked[1]["messages"])


def test_a_model_that_never_gets_it_right_is_given_up_with_the_last_findings() -> None:
    with (
        model_server('{"name": ""}') as (base, script),
        pytest.raises(LlmReplyError, match=r"tiny: no usable reply in 3; the last: name: .*\(and 1 more\)") as caught,
    ):
        model(base).ask(MESSAGES, Shop, rounds=2)
    assert len(script.asked) == 3
    assert caught.value.findings[1] == "kind: Field required"
    assert caught.value.answer == '{"name": ""}'


@pytest.mark.parametrize(
    "text",
    [
        f"Sure! Here you are:\n```json\n{GOOD}\n```\nAnything else?",
        f'<think>{{"name": "No", "kind": "bakery"}} is dull</think>{GOOD}',
        f"It has the form {{name, kind}}: {GOOD} {{}}",
        f'{{"example": 1}} {GOOD}',
    ],
)
def test_the_object_is_found_in_what_is_said_around_it(text: str) -> None:
    with model_server(text) as (base, _):
        assert model(base).ask(MESSAGES, Shop, rounds=0).value == KULMA


@pytest.mark.parametrize(
    ("answer", "finding"),
    [
        ("", "no JSON object"),
        ('{"name": "a", "kind": "bar", "kinds\\u001b": 1}', "kinds : Extra inputs"),
        ("I would rather not.", "no JSON object"),
        ('{"name": "Kulma", "kind": ', "broken at character"),
        ('{"name": "Kul", "tags": [{"kind": "bar"}, {"kin', "broken at character"),
        ("{" * 5000, "broken at character"),
        ('{"a":' * 20_000, "broken at"),
        ('{"name": "' + "x" * (1 << 20) + '"}', "at most 1,048,576"),
        (json.dumps({"name": "\ud800", "kind": "b"}), "Invalid JSON"),
        ('{"name": "\ud800", "kind": "b"}', "kind"),
    ],
)
def test_what_is_no_record_is_refused_quickly(answer: str, finding: str) -> None:
    start = time.process_time()
    with model_server(answer) as (base, _), pytest.raises(LlmReplyError) as caught:
        model(base).ask(MESSAGES, Shop, rounds=0)
    assert finding in caught.value.findings[0]
    assert str(caught.value).isprintable()
    assert time.process_time() - start < 2.0


def test_a_reply_that_is_cut_off_is_asked_for_shorter() -> None:
    with model_server(says('{"name": "Kul', finish="length"), GOOD) as (base, script):
        assert model(base).ask(MESSAGES, Shop).value == KULMA
    assert "too long" in script.last_words(1)


def test_a_server_that_takes_no_schema_is_told_it_in_words_from_then_on() -> None:
    with model_server(Script(f"Gladly. {GOOD}", formats=False)) as (base, script):
        asker = model(base)
        assert [asker.ask(MESSAGES, Shop).value for _ in range(2)] == [KULMA, KULMA]
    assert ["response_format" in body for body in script.asked] == [True, False, False]
    assert '"enum":["bakery","bar"]' in script.last_words(1)
    assert [message["role"] for message in script.asked[1]["messages"]] == ["system", "user"]


def test_options_that_a_server_refuses_are_left_out() -> None:
    def strict(request: Request) -> Answer:
        body = json.loads(request.body)
        for name in ("temperature", "max_tokens"):
            if name in body:
                error = {"message": f"Unsupported value: '{name}'", "param": name, "code": "unsupported_value"}
                return Answer(400, json.dumps({"error": error}).encode())
        assert body["max_completion_tokens"] == 50
        assert "response_format" in body
        return says(GOOD)

    with serve(strict) as base:
        assert model(f"{base}/v1", temperature=0.1, max_tokens=50).ask(MESSAGES, Shop).value == KULMA


def test_a_busy_or_failing_server_is_asked_again_after_as_long_as_it_says() -> None:
    waits: list[float] = []
    answers = [refuses(429, "slow down", Retry_After="7"), refuses(500, "oops"), Answer(502, b"<h1>Bad</h1>"), GOOD]
    with model_server(*answers) as (base, script):
        assert model(base, sleep=waits.append).ask(MESSAGES, Shop).value == KULMA
    assert waits == [7.0, 2.0, 4.0]
    assert len(script.asked) == 4


@pytest.mark.parametrize(
    ("answer", "words", "tries"),
    [
        (refuses(503, "overloaded"), r"it fails \(503\) \(overloaded\) \(tried 3 times\)", 3),
        (refuses(429, "later", Retry_After="4000"), "asked too often", 1),
        (Answer(200, b'{"choices": []}'), "no chat completion", 1),
        (Answer(200, b"<html>Log in</html>"), "does not answer in JSON", 1),
        (Answer(200, b'{"error": {"message": "upstream is gone", "code": 404}}'), "upstream is gone", 1),
        (Answer(200, b"{}", {"Content-Length": str(9 << 20)}), "more than 8,388,608 bytes", 1),
        (Answer(200, b'{"choices": [1]}', cut=5), "breaks off at byte 5 of 16.*tried 3 times", 3),
        (refuses(404, "no model tiny"), "VICO_LLM_MODEL", 1),
        (refuses(400, "picture too small"), "picture too small", 2),  # the second time without response_format
        (Answer(307, b"", {"Location": "http://127.0.0.1:9/v1"}), "redirects", 1),
        (
            Answer(429, b'{"error": {"message": "pay first", "code": "insufficient_quota"}}'),
            "no quota left.*pay first",
            1,
        ),
    ],
)
def test_a_server_that_fails_for_good_is_given_up_in_a_sentence(answer: Answer, words: str, tries: int) -> None:
    with (
        model_server(answer) as (base, script),
        pytest.raises(SourceError, match=rf"^language model at http://127.*{words}"),
    ):
        model(base, retries=2).ask(MESSAGES, Shop)
    assert len(script.asked) == tries


def test_a_wrong_key_is_answered_with_the_variable_to_set_and_without_the_key() -> None:
    with (
        model_server(Script(GOOD, key="another")) as (base, _),
        pytest.raises(SourceError, match=r"refuses the key \(401\): set VICO_LLM_KEY") as caught,
    ):
        model(base).ask(MESSAGES, Shop)
    assert caught.value.status == 401
    assert KEY not in str(caught.value)
    assert "***" in str(caught.value)


def test_silence_ends_after_the_timeout() -> None:
    release = threading.Event()

    def silent(request: Request) -> Answer:
        release.wait(10)
        return says(GOOD)

    with serve(silent) as base:
        try:
            with pytest.raises(SourceError, match=r"no answer within 0\.2 s \(tried 2 times\)"):
                model(f"{base}/v1", timeout=0.2, retries=1).ask(MESSAGES, Shop)
        finally:
            release.set()


def test_nobody_there_is_said_at_once() -> None:
    with pytest.raises(SourceError, match="is the server running"):
        model("http://127.0.0.1:9/v1").ask(MESSAGES, Shop)


@pytest.mark.parametrize("answer", [says("", refusal="I can't."), says("", finish="content_filter")])
def test_a_refusal_is_not_argued_with(answer: Answer) -> None:
    with (
        model_server(answer) as (base, script),
        pytest.raises(LlmReplyError, match=r"tiny: (refuses: I can't|the provider's filter)"),
    ):
        model(base).ask(MESSAGES, Shop)
    assert len(script.asked) == 1


def test_a_budget_is_kept_by_all_who_share_it() -> None:
    with model_server(says(GOOD, read=100, written=50)) as (base, script):
        calls = Budget(calls=2)
        for _ in range(2):
            model(base, budget=calls).ask(MESSAGES, Shop)
        with pytest.raises(LlmBudgetError, match="all 2 calls"):
            model(base, budget=calls).ask(MESSAGES, Shop)
        tokens = Budget(tokens=200)
        model(base, budget=tokens).ask(MESSAGES, Shop)
        with pytest.raises(LlmBudgetError, match="150 of 200 tokens"):
            model(base, budget=tokens).ask([user("x" * 400)], Shop)
        cost = Budget(cost=0.0003)
        model(base, budget=cost).ask(MESSAGES, Shop)
        assert cost.spent.cost == pytest.approx(0.0002)
        with pytest.raises(LlmBudgetError, match=r"\$0\.0002 of \$0\.0003"):
            model(base, budget=cost).ask([user("x" * 4000)], Shop)
    assert len(script.asked) == 4
    with pytest.raises(InputError, match="VICO_LLM_PRICE"):
        LanguageModel(Endpoint(base, "tiny"), budget=cost)
    with pytest.raises(InputError, match="must not be negative"):
        Budget(calls=-1)


def test_calls_that_fail_are_not_charged() -> None:
    budget = Budget(calls=1)
    with model_server(refuses(503, "oops"), GOOD) as (base, _):
        with pytest.raises(SourceError):
            model(base, budget=budget, retries=0).ask(MESSAGES, Shop)
        assert budget.spent.calls == 0
        assert model(base, budget=budget).ask(MESSAGES, Shop).value == KULMA
    assert budget.spent.calls == 1


def test_threads_share_a_model_and_its_budget() -> None:
    budget = Budget(calls=8)
    outcomes: list[str] = []
    with model_server(GOOD) as (base, script):
        asker = model(base, budget=budget)

        def work() -> None:
            try:
                outcomes.append(asker.ask(MESSAGES, Shop).value.name)
            except LlmBudgetError:
                outcomes.append("spent")

        threads = [threading.Thread(target=work) for _ in range(12)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert sorted(outcomes) == ["Kulma"] * 8 + ["spent"] * 4
    assert len(script.asked) == 8


def test_an_accepted_reply_is_kept_and_not_asked_for_again(tmp_path: Path) -> None:
    with model_server("nonsense", GOOD) as (base, script):
        first = model(base, cache=tmp_path).ask(MESSAGES, Shop)
        again = model(base, cache=tmp_path).ask(MESSAGES, Shop)
        assert (first.attempts, again.attempts, again.usage.calls) == (2, 0, 0)
        assert again.value == first.value
        assert len(script.asked) == 2
        # Another question, option or demand is another matter, and a damaged file is made anew.
        model(base, cache=tmp_path).ask([user("Another.")], Shop)
        model(base, cache=tmp_path, temperature=0.3).ask(MESSAGES, Shop)
        with pytest.raises(LlmReplyError):
            model(base, cache=tmp_path).ask(MESSAGES, Shop, check=lambda s: ["no"], rounds=0)
        for path in tmp_path.glob("*/*.json"):
            path.write_bytes(path.read_bytes()[:9])
        model(base, cache=tmp_path).ask(MESSAGES, Shop)
        assert len(script.asked) == 6
    assert all(KEY.encode() not in path.read_bytes() for path in tmp_path.glob("*/*.json"))


REPLAYED = """
import sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from test_language_model import MESSAGES, Shop, model_of_recording
asker = model_of_recording(Path(sys.argv[1]))
for _ in range(2):
    reply = asker.ask(MESSAGES, Shop)
    print(reply.value.model_dump_json(), reply.attempts, reply.usage.calls, reply.usage.tokens)
"""


def model_of_recording(path: Path) -> LanguageModel:
    """A model that the environment names as a recording alone."""
    return LanguageModel.from_environment({"VICO_LLM_REPLAY": str(path)})


@pytest.mark.parametrize("formats", [True, False])
def test_a_recording_answers_a_fresh_process_when_the_server_is_gone(tmp_path: Path, formats: bool) -> None:
    recording = tmp_path / "calls.jsonl"
    told = []
    with model_server(Script("no", GOOD, GOOD.replace("12", "13"), formats=formats)) as (base, _):
        asker = model(base, record=recording)
        for _ in range(2):
            reply = asker.ask(MESSAGES, Shop)
            told.append(f"{reply.value.model_dump_json()} {reply.attempts} {reply.usage.calls} {reply.usage.tokens}")
    assert told[0] != told[1]
    assert KEY not in recording.read_text()
    tests = str(Path(__file__).parent)
    env = {k: v for k, v in os.environ.items() if not k.startswith(("VICO_", "OPENAI_"))}
    env["PYTHONPATH"] = os.pathsep.join([str(Path(tests).parent), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", REPLAYED.format(tests=tests), str(recording)],
        capture_output=True, text=True, env=env, check=False,
    )  # fmt: skip
    assert done.stdout.splitlines() == told, done.stderr


def test_a_replay_says_what_it_has_no_answer_to(tmp_path: Path) -> None:
    recording = tmp_path / "calls.jsonl"
    with model_server(GOOD) as (base, _):
        model(base, record=recording).ask(MESSAGES, Shop)
    replayed = model_of_recording(recording)
    with pytest.raises(InputError, match=r"calls\.jsonl: holds no answer to request .*VICO_LLM_RECORD"):
        replayed.ask([user("Something else.")], Shop)
    replayed.ask(MESSAGES, Shop)
    with pytest.raises(InputError, match="holds no further answer"):
        replayed.ask(MESSAGES, Shop)


def test_what_the_cache_knew_is_recorded_and_replayed_free_of_charge(tmp_path: Path) -> None:
    recording = tmp_path / "calls.jsonl"
    with model_server(GOOD) as (base, _):
        model(base, cache=tmp_path / "cache").ask(MESSAGES, Shop)
        model(base, cache=tmp_path / "cache", record=recording).ask(MESSAGES, Shop)
    endpoint = Endpoint("http://127.0.0.1:9/v1", "tiny")
    replayed = LanguageModel(endpoint, replay=recording, budget=Budget(calls=0))
    assert replayed.ask(MESSAGES, Shop).value == KULMA
    assert replayed.budget.spent.calls == 0


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "no recorded calls"),
        (b"{}\n", "line 1"),
        (b"\xff\n", "line 1"),
        (b'{"base": "x", "model": "m", "digest": "d", "request": {}, "text": "", "usage": {"euros": 2}}\n', "usage"),
        (b'{"base": "x", "model": "m", "digest": "d", "request": {}, "text": "", "version": 2}\n', "line 1"),
    ],
)
def test_a_file_that_is_no_recording_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "calls.jsonl"
    with pytest.raises(MissingFileError, match="no such recording"):
        model_of_recording(path)
    path.write_bytes(content)
    with pytest.raises(SchemaError, match=words):
        model_of_recording(path)


def test_pictures_travel_inside_the_request_and_stay_out_of_the_recording(tmp_path: Path) -> None:
    picture = b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 8
    with model_server(GOOD) as (base, script):
        model(base, record=tmp_path / "calls.jsonl").ask([user("What is sold here?", picture)], Shop)
    text, image = script.asked[0]["messages"][0]["content"]
    assert text["text"] == "What is sold here?"
    assert image["image_url"]["url"].startswith("data:image/png;base64,iVBORw0KGgo")
    assert "iVBORw0KGgo" not in (tmp_path / "calls.jsonl").read_text()
    assert model_of_recording(tmp_path / "calls.jsonl").ask([user("What is sold here?", picture)], Shop).value == KULMA
    with pytest.raises(InputError, match="neither PNG"):
        user("Look.", b"<svg/>")


@pytest.mark.parametrize(
    "messages",
    [
        [],
        [{"role": "tool", "content": "x"}],
        [{"role": "user"}],
        [{"role": "user", "content": [{"type": "image_url", "image_url": {"url": "http://10.0.0.1/x.png"}}]}],
    ],
)
def test_unusable_messages_are_refused_before_anything_is_sent(messages: list[dict[str, Any]]) -> None:
    with pytest.raises(InputError, match="message"):
        model("http://127.0.0.1:9/v1").ask(messages, Shop)


def test_the_environment_names_server_model_and_key() -> None:
    own = {"VICO_LLM_BASE_URL": "http://127.0.0.1:8080/v1/", "VICO_LLM_MODEL": "tiny", "VICO_LLM_PRICE": "0.15,0.6"}
    endpoint = Endpoint.from_environment({**own, "VICO_LLM_KEY": KEY})
    assert (endpoint.url, endpoint.key) == ("http://127.0.0.1:8080/v1/chat/completions", KEY)
    assert endpoint.price == (0.15, 0.6)
    assert KEY not in repr(endpoint)
    # OpenAI's key is for OpenAI, and for what is said to speak in its place.
    assert Endpoint.from_environment({**own, "OPENAI_API_KEY": KEY}).key == ""
    openai = {"OPENAI_API_KEY": KEY, "VICO_LLM_MODEL": "tiny"}
    assert Endpoint.from_environment(openai) == Endpoint("https://api.openai.com/v1", "tiny", KEY)
    assert Endpoint.from_environment({**openai, "OPENAI_BASE_URL": "http://[::1]:1/v1"}).key == KEY


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"VICO_LLM_BASE_URL": ""}, "no language model is named: set VICO_LLM_BASE_URL"),
        ({"VICO_LLM_BASE_URL": "file:///etc/passwd"}, "VICO_LLM_BASE_URL: not an http"),
        ({"VICO_LLM_BASE_URL": "http://[1"}, "VICO_LLM_BASE_URL: not an http"),
        ({"VICO_LLM_BASE_URL": "http://me:pw@host/v1"}, "VICO_LLM_BASE_URL: must hold no user"),
        ({"VICO_LLM_MODEL": ""}, "VICO_LLM_MODEL: name the model"),
        ({"VICO_LLM_KEY": "a\nb"}, "VICO_LLM_KEY: "),
        ({"VICO_LLM_PRICE": "cheap"}, "VICO_LLM_PRICE: 'cheap'"),
        ({"VICO_LLM_PRICE": "1,nan"}, "VICO_LLM_PRICE: "),
    ],
)
def test_an_unusable_environment_is_named_variable_by_variable(changes: dict[str, str], words: str) -> None:
    env = {"VICO_LLM_BASE_URL": "http://127.0.0.1:8080/v1", "VICO_LLM_MODEL": "tiny"}
    with pytest.raises(InputError, match=words):
        LanguageModel.from_environment({**env, **changes})
