"""The HTTP client against a real server that misbehaves in every way we know."""

import gzip
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from http_server import Answer, Request, serve
from vico.errors import InputError, SourceError
from vico.io.http import USER_AGENT, HttpClient


class Script:
    """Answers in turn (the last one again and again), and remembers what was asked."""

    def __init__(self, *answers: Answer) -> None:
        self.answers = list(answers)
        self.asked: list[Request] = []

    def __call__(self, request: Request) -> Answer:
        self.asked.append(request)
        return self.answers[min(len(self.asked), len(self.answers)) - 1]


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_it_names_itself_and_adds_the_parameters() -> None:
    script = Script(Answer(body=b"yes"))
    with serve(script) as base:
        assert HttpClient().get(f"{base}/a b?x=1", params={"y": "ä&"}, headers={"X-Mine": "2"}) == b"yes"
    (asked,) = script.asked
    assert (asked.method, asked.path, asked.query) == ("GET", "/a%20b", {"x": "1", "y": "ä&"})
    assert asked.headers["user-agent"] == USER_AGENT
    assert asked.headers["x-mine"] == "2"


def test_a_form_is_posted_and_bytes_are_as_they_are() -> None:
    script = Script(Answer())
    with serve(script) as base:
        HttpClient().post(base, data={"data": "a b"})
        HttpClient().post(base, data=b"{}", headers={"Content-Type": "application/json"})
    assert [(r.body, r.headers["content-type"]) for r in script.asked] == [
        (b"data=a+b", "application/x-www-form-urlencoded"),
        (b"{}", "application/json"),
    ]


def test_a_good_answer_is_asked_for_once_whatever_the_key(tmp_path: Path) -> None:
    script = Script(Answer(body=b"one"), Answer(body=b"two"))
    with serve(script) as base:
        web = HttpClient(cache=tmp_path)
        for key in ("SECRET-1", "SECRET-2"):
            assert web.get(base, params={"keyword": "1", "key": key}, headers={"X-Api-Key": key}) == b"one"
        assert web.get(base, params={"keyword": "2", "key": "SECRET-1"}) == b"two"
        assert web.get(base, params={"keyword": "1"}, headers={"X-Mask": "other"}) == b"two"
        assert len(files(tmp_path)) == 3
        web.get(base, params={"q": "3"}, cached=False)
    assert len(script.asked) == 4
    assert len(files(tmp_path)) == 3
    assert not any(b"SECRET" in str(f).encode() + f.read_bytes() for f in files(tmp_path))


@pytest.mark.parametrize("status", [204, 400, 404, 500, 503])
def test_only_200_is_kept(tmp_path: Path, status: int) -> None:
    with serve(Script(Answer(status, b""))) as base:
        try:
            HttpClient(cache=tmp_path, retries=0).get(base)
        except SourceError as error:
            assert error.status == status  # noqa: PT017
    assert files(tmp_path) == []


def test_an_answer_that_the_caller_refuses_is_neither_kept_nor_given(tmp_path: Path) -> None:
    with serve(Script(Answer(body=b'{"remark": "out of memory"}'))) as base:
        with pytest.raises(SourceError, match="holds a remark"):
            HttpClient(cache=tmp_path).get(base, validate=lambda body: "holds a remark" if b"remark" in body else None)
        assert files(tmp_path) == []
        assert b"remark" in HttpClient(cache=tmp_path).get(base)


@pytest.mark.parametrize("status", [429, 500, 502, 503, 504])
def test_a_busy_server_is_asked_again_after_longer_and_longer(status: int) -> None:
    waits: list[float] = []
    script = Script(Answer(status), Answer(status), Answer(status), Answer(body=b"at last"))
    with serve(script) as base:
        assert HttpClient(sleep=waits.append).get(base) == b"at last"
    assert waits == [1.0, 2.0, 4.0]


def test_a_wait_is_logged_without_the_key(caplog: pytest.LogCaptureFixture) -> None:
    with serve(Script(Answer(503, b"key AIza-1"), Answer(body=b"ok"))) as base, caplog.at_level("INFO", "vico"):
        HttpClient(sleep=lambda _: None).get(base, params={"key": "AIza-1"})
    assert [record.getMessage() for record in caplog.records] == ["HTTP 503; trying again in 1 s"]


def test_retry_after_is_obeyed_in_seconds_and_as_a_date() -> None:
    waits: list[float] = []
    date = {"Date": "Sun, 06 Nov 1994 08:49:00 GMT", "Retry-After": "Sun, 06 Nov 1994 08:49:37 GMT"}
    script = Script(Answer(429, headers={"Retry-After": "7"}), Answer(503, headers=date), Answer(body=b"ok"))
    with serve(script) as base:
        HttpClient(sleep=waits.append).get(base)
    assert waits == [7.0, 37.0]


def test_a_server_that_asks_for_hours_is_left_alone() -> None:
    script = Script(Answer(429, headers={"Retry-After": "7200"}))
    with serve(script) as base, pytest.raises(SourceError, match="7200 s") as caught:
        HttpClient(sleep=lambda _: None).get(base)
    assert len(script.asked) == 1
    assert caught.value.status == 429


def test_what_will_not_help_is_not_repeated() -> None:
    script = Script(Answer(403, b"<html><head><title>x</title></head><body><p>no&nbsp;quota</p></body></html>"))
    with serve(script) as base, pytest.raises(SourceError, match=r"refuses \(403\).*\(no quota\)"):
        HttpClient().get(base)
    assert len(script.asked) == 1


def test_it_gives_up_in_one_sentence_without_the_key() -> None:
    def echo(request: Request) -> Answer:
        return Answer(500, f"bad key {request.query['key']} in {request.headers['x-goog-api-key']}".encode())

    with serve(echo) as base, pytest.raises(SourceError) as caught:
        HttpClient(retries=1, sleep=lambda _: None).get(
            base, params={"key": "AIza 1/2", "session": "s3ss10n"}, headers={"X-Goog-Api-Key": "AIza+other"}
        )
    text = str(caught.value)
    assert "fails (500)" in text
    assert "\n" not in text
    assert not any(secret in text for secret in ("AIza", "s3ss10n"))


def test_a_silent_server_is_left_after_its_time() -> None:
    gone = threading.Event()

    def silent(_: Request) -> Answer:
        gone.wait(5)
        return Answer()

    with serve(silent) as base:
        with pytest.raises(SourceError, match=r"no answer within 0\.1 s after 2 tries"):
            HttpClient(timeout=0.1, retries=1, sleep=lambda _: None).get(base)
        gone.set()


def test_nobody_listening_is_said_at_once() -> None:
    with serve(Script(Answer())) as base:
        pass
    waits: list[float] = []
    with pytest.raises(SourceError, match="nobody listens"):
        HttpClient(sleep=waits.append).get(base)
    assert waits == []


def test_an_answer_that_breaks_off_is_fetched_again(tmp_path: Path) -> None:
    script = Script(Answer(body=b"a" * 1000, cut=500), Answer(body=b"a" * 1000))
    with serve(script) as base:
        assert len(HttpClient(cache=tmp_path, sleep=lambda _: None).get(base)) == 1000
    script = Script(Answer(body=b"a" * 1000, cut=500))
    with serve(script) as base, pytest.raises(SourceError, match="breaks off at byte 500 of 1,000"):
        HttpClient(retries=0).get(base)


def test_packed_answers_are_unpacked_also_in_parts() -> None:
    body = gzip.compress(b"x" * 100_000) + gzip.compress(b"y")
    with serve(Script(Answer(body=body, headers={"Content-Encoding": "gzip"}))) as base:
        assert HttpClient().get(base) == b"x" * 100_000 + b"y"


def test_a_packed_answer_that_breaks_off_is_no_answer() -> None:
    body = gzip.compress(bytes(range(256)) * 100)[:-20]
    script = Script(Answer(body=body, headers={"Content-Encoding": "gzip"}))
    with serve(script) as base, pytest.raises(SourceError, match="packed answer breaks off"):
        HttpClient(retries=0).get(base)


@pytest.mark.parametrize(
    "answer",
    [
        Answer(body=bytes(2000)),
        Answer(body=gzip.compress(bytes(50_000_000)), headers={"Content-Encoding": "gzip"}),
        Answer(body=b"a", headers={"Content-Length": "999999999999"}),
        Answer(
            body=b"".join(b"3e8\r\n" + bytes(1000) + b"\r\n" for _ in range(5)) + b"0\r\n\r\n",
            headers={"Transfer-Encoding": "chunked"},
        ),
    ],
)
def test_more_than_is_wanted_is_not_read(answer: Answer) -> None:
    with serve(Script(answer)) as base, pytest.raises(SourceError, match="more than 1,000 bytes"):
        HttpClient(retries=0).get(base, max_bytes=1000)


@pytest.mark.parametrize("target", ["file:///etc/passwd", "ftp://127.0.0.1/a", "data:,x", "gopher://a/"])
def test_redirects_lead_to_the_web_alone(target: str) -> None:
    with serve(Script(Answer(302, headers={"Location": target}))) as base, pytest.raises(SourceError, match="redirect"):
        HttpClient().get(base)


def test_a_redirect_to_another_host_takes_no_key_along() -> None:
    there = Script(Answer(body=b"there"))
    with serve(there) as other, serve(Script(Answer(302, headers={"Location": f"{other}/moved"}))) as base:
        assert HttpClient().get(base, headers={"Authorization": "Bearer abc", "X-Mine": "1"}) == b"there"
    assert "authorization" not in there.asked[0].headers
    assert there.asked[0].headers["x-mine"] == "1"


def test_redirects_in_a_circle_end() -> None:
    script = Script(Answer(302, headers={"Location": "/again"}))
    with serve(script) as base, pytest.raises(SourceError, match="redirects"):
        HttpClient().get(base)
    assert len(script.asked) < 10


@pytest.mark.parametrize(
    "url", ["file:///etc/passwd", "ftp://a/b", "/etc/passwd", "http://", "http://[1/", "http://a:b@c/", "http://a b/"]
)
def test_other_addresses_are_refused(url: str) -> None:
    with pytest.raises(InputError):
        HttpClient().get(url)


def test_a_host_is_left_in_peace_between_two_calls() -> None:
    waits: list[float] = []
    with serve(Script(Answer())) as base:
        web = HttpClient(pause=3.0, sleep=waits.append)
        for _ in range(3):
            web.get(base)
    assert waits[0] == pytest.approx(3.0, abs=1.0)
    assert waits[1] == pytest.approx(6.0, abs=1.0)


def test_a_server_that_drips_is_left() -> None:
    def drip(_: Request) -> Answer:
        return Answer(headers={"Content-Length": "100000"}, body=b"a")

    clock = iter(range(0, 10**6, 400))
    with serve(drip) as base, pytest.MonkeyPatch.context() as patch:
        patch.setattr("vico.io.http.time.monotonic", lambda: float(next(clock)))
        with pytest.raises(SourceError, match="sent 1 bytes in"):
            HttpClient(retries=0, timeout=30).get(base)


def test_two_threads_may_share_it(tmp_path: Path) -> None:
    def body(request: Request) -> Answer:
        time.sleep(0.01)
        return Answer(body=request.path.encode() * 1000)

    web = HttpClient(cache=tmp_path)
    wrong: list[str] = []

    def work(base: str) -> None:
        for k in range(10):
            if web.get(f"{base}/{k}") != f"/{k}".encode() * 1000:
                wrong.append(str(k))

    with serve(body) as base:
        threads: list[threading.Thread] = [threading.Thread(target=work, args=(base,)) for _ in range(4)]
        run: Callable[[threading.Thread], None] = threading.Thread.start
        for thread in threads:
            run(thread)
        for thread in threads:
            thread.join()
    assert wrong == []
    assert len(files(tmp_path)) == 10
