"""Replies and refusals in the shapes that servers of each family send: recorded, with names and ids changed."""

from __future__ import annotations

import json
from typing import Any

import pytest
from pydantic import BaseModel, ConfigDict

from http_server import Answer
from llm_server import Script, model_server
from vico.errors import LlmReplyError, SourceError
from vico.llm import Connection, Endpoint, LanguageModel, Sampling, user


class Person(BaseModel):
    """What is asked for."""

    model_config = ConfigDict(extra="forbid")

    name: str
    age: int


GOOD = '{"name": "Anna", "age": 41}'
ANNA = Person(name="Anna", age=41)


def completion(message: dict[str, Any], finish: str = "stop", **more: Any) -> dict[str, Any]:
    choice = {"index": 0, "message": {"role": "assistant", **message}, "finish_reason": finish}
    return {"id": "chatcmpl-1", "object": "chat.completion", "created": 1, "model": "m", "choices": [choice], **more}


def answered(content: Any, status: int = 200) -> Answer:
    return Answer(status, json.dumps(content).encode(), {"Content-Type": "application/json"})


class Picky(Script):
    """A server that refuses a part of requests in its own words."""

    def __init__(self, part: str, refusal: Answer, answer: Answer) -> None:
        super().__init__(answer)
        self.part, self.refusal = part, refusal

    def __call__(self, request: Any) -> Answer:
        """Answer as such a server would."""
        answer = super().__call__(request)
        return self.refusal if self.part in self.asked[-1] else answer


def model(base: str) -> LanguageModel:
    sampling = Sampling(seed=0, temperature=0.0, max_tokens=200)
    sent = Connection(timeout=5.0, retries=2, sleep=lambda seconds: None)
    return LanguageModel(Endpoint(base, "m"), sampling=sampling, connection=sent)


USAGE = {"prompt_tokens": 10, "completion_tokens": 20, "total_tokens": 30}


@pytest.mark.parametrize(
    ("family", "content"),
    [
        (
            "OpenAI",
            completion({"content": GOOD, "refusal": None, "annotations": []}, usage=USAGE, service_tier="default"),
        ),
        ("Azure", completion({"content": GOOD}, usage=USAGE, prompt_filter_results=[{"prompt_index": 0}])),
        ("vLLM", completion({"content": GOOD, "reasoning_content": "She is 30? No.", "tool_calls": []}, usage=USAGE)),
        ("vLLM, all among the thoughts", completion({"content": None, "reasoning_content": GOOD}, usage=USAGE)),
        (
            "llama.cpp",
            completion({"content": f"<think>\n\n</think>\n\n{GOOD}"}, timings={"predicted_per_second": 30.1}),
        ),
        (
            "Ollama",
            completion(
                {"content": f"```json\n{GOOD}\n```", "reasoning": "Anna it is."}, system_fingerprint="fp_ollama"
            ),
        ),
        ("Gemini", completion({"content": f"```json\n{GOOD}\n```"}, usage=USAGE)),
        ("Mistral", completion({"content": [{"type": "thinking", "thinking": []}, {"type": "text", "text": GOOD}]})),
    ],
)
def test_a_reply_of_each_family_is_read(family: str, content: dict[str, Any]) -> None:
    with model_server(Script(answered(content))) as (base, script):
        assert model(base).ask([user("Who?")], Person).value == ANNA
    assert len(script.asked) == 1, family


@pytest.mark.parametrize(
    ("family", "part", "status", "page"),
    [
        (
            "OpenAI",
            "temperature",
            400,
            {
                "error": {
                    "message": "Unsupported value: 'temperature' does not support 0 with this "
                    "model. Only the default (1) value is supported.",
                    "type": "invalid_request_error",
                    "param": "temperature",
                    "code": "unsupported_value",
                }
            },
        ),
        (
            "OpenAI",
            "max_tokens",
            400,
            {
                "error": {
                    "message": "Unsupported parameter: 'max_tokens' is not supported with this "
                    "model. Use 'max_completion_tokens' instead.",
                    "type": "invalid_request_error",
                    "param": "max_tokens",
                    "code": "unsupported_parameter",
                }
            },
        ),
        (
            "Azure",
            "response_format",
            400,
            {
                "error": {
                    "message": "Invalid parameter: 'response_format' of type 'json_schema' "
                    "is not supported with this model.",
                    "type": "invalid_request_error",
                    "param": "response_format",
                    "code": None,
                }
            },
        ),
        (
            "Azure AI",
            "seed",
            422,
            {
                "error": {
                    "code": "Invalid input",
                    "status": 422,
                    "message": "invalid input error",
                    "details": {"loc": ["body", "seed"], "input": "value_error"},
                }
            },
        ),
        (
            "vLLM",
            "response_format",
            400,
            {
                "object": "error",
                "message": "The provided JSON schema contains features not supported by xgrammar.",
                "type": "BadRequestError",
                "param": None,
                "code": 400,
            },
        ),
        (
            "vLLM before 0.6",
            "response_format",
            422,
            {
                "detail": [
                    {
                        "type": "extra_forbidden",
                        "loc": ["body", "response_format", "json_schema"],
                        "msg": "Extra inputs are not permitted",
                    }
                ]
            },
        ),
        (
            "llama.cpp",
            "response_format",
            500,
            {"error": {"code": 500, "message": "failed to parse grammar", "type": "server_error"}},
        ),
        (
            "llama.cpp",
            "response_format",
            400,
            {"error": {"code": 400, "message": "Unrecognized schema: true", "type": "invalid_request_error"}},
        ),
        (
            "Ollama",
            "response_format",
            500,
            {"error": {"message": "invalid JSON schema in format", "type": "api_error"}},
        ),
        ("Ollama", "response_format", 500, {"error": {"message": "something went wrong", "type": "api_error"}}),
        (
            "Gemini",
            "seed",
            400,
            [
                {
                    "error": {
                        "code": 400,
                        "message": 'Invalid JSON payload received. Unknown name "seed": Cannot find field.',
                        "status": "INVALID_ARGUMENT",
                    }
                }
            ],
        ),
        (
            "OpenRouter",
            "response_format",
            404,
            {"error": {"message": "No endpoints found that can handle the requested parameters.", "code": 404}},
        ),
        (
            "OpenRouter",
            "temperature",
            404,
            {"error": {"message": "No endpoints found that can handle the requested parameters.", "code": 404}},
        ),
        (
            "OpenRouter",
            "seed",
            404,
            {"error": {"message": "No endpoints found that support the parameter seed", "code": 404}},
        ),
        (
            "a gateway",
            "response_format",
            403,
            {"error": {"message": "structured outputs are not available in your plan"}},
        ),
        ("a gateway", "temperature", 500, {"error": {"message": "temperature must be > 0"}}),
        ("a gateway", "seed", 400, {"message": "`seed` is not permitted"}),
        ("a gateway", "temperature", 400, {"detail": "Bad Request"}),
    ],
)
def test_what_a_family_refuses_is_left_out_and_not_sent_again(family: str, part: str, status: int, page: Any) -> None:
    server = Picky(part, answered(page, status), answered(completion({"content": GOOD})))
    with model_server(server) as (base, _):
        asker = model(base)
        assert asker.ask([user("Who?")], Person).value == ANNA, family
        asked = len(server.asked)
        assert asker.ask([user("Who else?")], Person).value == ANNA
    assert len(server.asked) == asked + 1
    if part == "max_tokens":
        assert server.asked[-1]["max_completion_tokens"] == 200


def test_a_wait_of_an_hour_is_named() -> None:
    busy = Answer(429, b'{"error": {"message": "daily limit"}}', {"Retry-After": "3600"})
    with model_server(Script(busy)) as (base, _), pytest.raises(SourceError, match="it asks to wait 1 hour"):
        model(base).ask([user("Who?")], Person)


@pytest.mark.parametrize(
    ("status", "message", "told"),
    [
        (404, "model 'seed-m' not found", "no such page, or no model"),
        (403, "seed-m is not in your plan", "wants a key"),
        (401, "Incorrect API key provided", "wants a key"),
    ],
)
def test_a_refusal_that_names_no_part_is_of_keys_and_names(status: int, message: str, told: str) -> None:
    with model_server(Script(answered({"error": {"message": message}}, status))) as (base, script):
        asker = LanguageModel(Endpoint(base, "seed-m"), sampling=Sampling(seed=0, temperature=0.0))
        with pytest.raises(SourceError, match=told):
            asker.ask([user("Who?")], Person)
    assert len(script.asked) == 1


CONTEXT, FILTER = "longer than the model reads", "the provider's filter refuses"


@pytest.mark.parametrize(
    ("family", "status", "told", "error"),
    [
        (
            "Azure",
            400,
            FILTER,
            {
                "message": "The response was filtered due to the prompt triggering Azure OpenAI's content management "
                "policy.",
                "param": "prompt",
                "code": "content_filter",
            },
        ),
        ("OpenRouter", 403, FILTER, {"message": 'Your input was flagged for "violence".', "code": 403}),
        ("Alibaba", 400, FILTER, {"message": "Input data may be inappropriate", "code": "data_inspection_failed"}),
        (
            "OpenAI",
            400,
            CONTEXT,
            {
                "message": "This model's maximum context length is 4096 tokens.",
                "code": "context_length_exceeded",
                "param": "messages",
            },
        ),
        (
            "llama.cpp",
            400,
            CONTEXT,
            {
                "message": "the request exceeds the available context size, try increasing it",
                "type": "exceed_context_size_error",
                "code": 400,
            },
        ),
        ("llama.cpp", 500, CONTEXT, {"message": "the request exceeds the available context size.", "code": 500}),
        (
            "vLLM",
            400,
            CONTEXT,
            {"message": "This model's maximum context length is 4096 tokens. However, you requested 5000 tokens"},
        ),
        (
            "vLLM",
            400,
            CONTEXT,
            {"message": "The decoder prompt (length 5000) is longer than the maximum context length of 4096"},
        ),
        ("Anthropic", 400, CONTEXT, {"message": "prompt is too long: 210000 tokens > 200000 maximum"}),
        (
            "Gemini",
            400,
            CONTEXT,
            {"message": "The input token count (5000) exceeds the maximum number of tokens allowed (4096)."},
        ),
    ],
)
def test_what_is_wrong_with_the_messages_is_told_after_one_request(
    family: str, status: int, told: str, error: dict[str, Any]
) -> None:
    with (
        model_server(Script(answered({"error": error}, status))) as (base, script),
        pytest.raises(SourceError, match=told),
    ):
        model(base).ask([user("Who?")], Person)
    assert len(script.asked) == 1, family


@pytest.mark.parametrize(
    ("choice", "told"),
    [
        (
            {"finish_reason": "stop", "message": {"content": [{"type": "refusal", "refusal": "I can't."}]}},
            "refuses: I can",
        ),
        ({"finish_reason": "stop", "message": {"content": "", "refusal": "I can't."}}, "refuses: I can't"),
        ({"finish_reason": "content_filter", "message": {}}, "the provider's filter held the answer back"),
        ({"finish_reason": "content_filter: SAFETY", "index": 0}, "the provider's filter held the answer back"),
    ],
)
def test_a_refusal_is_told_after_one_request(choice: dict[str, Any], told: str) -> None:
    with (
        model_server(Script(answered({"choices": [choice]}))) as (base, script),
        pytest.raises(LlmReplyError, match=told),
    ):
        model(base).ask([user("Who?")], Person)
    assert len(script.asked) == 1


def test_a_chunk_that_is_sent_whole_is_read() -> None:
    whole = {"choices": [{"index": 0, "delta": {"content": GOOD}, "finish_reason": "stop"}]}
    with model_server(Script(answered(whole))) as (base, _):
        assert model(base).ask([user("Who?")], Person).value == ANNA
