"""Every usual way in which an endpoint fails: the right sentence, retries with back-off, never the key in a message."""

from __future__ import annotations

import json
import sys
import threading
from http.server import BaseHTTPRequestHandler
from typing import Any

import httpx2
import pytest

from openeureka.config import RunConfig
from openeureka.errors import ConfigError, ModelError
from openeureka.llm import connection, open_model, openai
from openeureka.llm.openai import EndpointModel

from .endpoint import Answer, Endpoint, Play, answer, failure, sample, streamed, texts

KEY = "sk-canary-0123456789"
GOOD = json.dumps(answer("a")[1]).encode()  # pyright: ignore[reportIndexIssue]


@pytest.fixture(autouse=True)
def key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", KEY)


def raw(body: bytes, *, length: int | None = None) -> Play:
    """Send this body under this Content-Length (by default the true one), then close the connection."""

    def play(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(200)
        handler.send_header("Content-Type", "application/json")
        handler.send_header("Content-Length", str(len(body) if length is None else length))
        handler.end_headers()
        handler.wfile.write(body)
        handler.close_connection = True

    return play


def failing(body: bytes, status: int = 502, **headers: str) -> Play:
    """Send this body as an error that claims to be 100 bytes long, then close the connection."""

    def play(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(status)
        for name, value in {"Content-Length": "100", **headers}.items():
            handler.send_header(name.replace("_", "-"), value)
        handler.end_headers()
        handler.wfile.write(body)
        handler.close_connection = True

    return play


def replaced(**fields: object) -> Play:
    return raw(json.dumps({**json.loads(GOOD), **fields}).encode())


def said(endpoint: Endpoint, **settings: str) -> str:
    with pytest.raises(ModelError) as caught:
        sample(endpoint.model(**settings), 1)
    return str(caught.value)


# --- failures that may pass ------------------------------------------------------------------------------------------

CUT = raw(GOOD[:100], length=len(GOOD))
QUOTA = (
    "You exceeded your current quota, please check your plan and billing details. For more information on this error,"
)


@pytest.mark.parametrize(
    "bad",
    [
        failure(408),
        failure(409),
        failure(429),
        failure(429, f"{QUOTA} head to: https://ai.google.dev/gemini-api/docs/rate-limits."),  # of a minute, perhaps
        failure(500),
        failure(502),
        failure(503),
        failure(529),
        (500, "<html>an error page</html>", {}),
        CUT,  # the stream is cut
        raw(GOOD[:100]),  # the JSON is cut
        raw(b""),
        raw(b" \n" * 1000 + GOOD[:50]),
        replaced(choices=None, error={"message": "the provider is busy", "code": 502}),  # with status 200
        replaced(choices=[], error={"message": "the provider is busy"}),
        failing(b'{"error":'),  # a gateway that goes down in the middle of its error page
        failing(b"no gzip" * 20, 400, Content_Encoding="gzip"),
    ],
)
def test_what_may_pass_is_tried_again(endpoint: Endpoint, bad: Answer):
    endpoint.script = [bad, bad, answer("a")]
    assert texts(sample(endpoint.model(), 1)) == ["a"]
    assert endpoint.waits == [1.0, 2.0]


@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        (CUT, "broke off; try again"),
        (raw(GOOD[:100]), "its answer was cut off"),
        (replaced(choices=None, error={"message": "the provider is busy"}), "the provider is busy"),
    ],
)
def test_what_does_not_pass_is_one_sentence_after_a_minute(endpoint: Endpoint, bad: Answer, sentence: str):
    endpoint.script = lambda body: bad
    assert sentence in said(endpoint)
    assert endpoint.waits == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]


@pytest.mark.parametrize(
    ("header", "wait"),
    [
        ("3", 3.0),
        ("0", 0.0),
        ("-5", 0.0),
        ("1e9", connection.MAX_WAIT),
        ("inf", connection.MAX_WAIT),
        ("nan", 1.0),
        ("soon", 1.0),
        ("Sun, 06 Nov 1994 08:49:57 GMT", 20.0),  # by the endpoint's own clock, which says 08:49:37
        ("Sun, 06 Nov 1994 08:00:00 GMT", 0.0),
    ],
)
def test_a_wait_is_stated_in_seconds_or_as_a_date(endpoint: Endpoint, header: str, wait: float):
    busy = json.dumps({"error": {"message": "slow down"}}).encode()

    def play(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response_only(429)
        for name, value in {"Date": "Sun, 06 Nov 1994 08:49:37 GMT", "Retry-After": header}.items():
            handler.send_header(name, value)
        handler.send_header("Content-Length", str(len(busy)))
        handler.end_headers()
        handler.wfile.write(busy)

    endpoint.script = [play, answer("a")]
    assert texts(sample(endpoint.model(), 1)) == ["a"]
    assert endpoint.waits == [wait]


def test_a_wait_is_stated_in_milliseconds(endpoint: Endpoint):
    endpoint.script = [failure(429, Retry_After="2", retry_after_ms="1500"), answer("a")]
    sample(endpoint.model(), 1)
    assert endpoint.waits == [1.5]


def _openrouter(reset: str) -> dict[str, Any]:
    headers = {"X-RateLimit-Limit": "20", "X-RateLimit-Remaining": "0", "X-RateLimit-Reset": reset}
    return {"error": {"message": "free-models-per-min", "code": 429, "metadata": {"headers": headers}}}


@pytest.mark.parametrize(
    ("body", "wait"),
    [
        (
            [{"error": {"code": 429, "message": "limit: 5, model: gemini\nPlease retry in 38.25s.", "details": []}}],
            38.25,
        ),
        ({"error": {"message": "Please try again in 1m2s. Visit"}}, 62.0),
        ({"error": {"message": "Please try again in 20ms. Visit"}}, 0.02),
        ({"error": {"message": "Please retry after 33 seconds."}}, 33.0),  # Azure
        ({"error": {"message": "Please try again in 114h18m0s."}}, 1.0),  # no wait outlasts it
        ({"error": {"message": "Please try again in a moment."}}, 1.0),
        (_openrouter("784111777042"), 1.0),  # not 13 digits
        (_openrouter("1784111819500"), 42.5),
        (_openrouter("1784111700000"), 1.0),  # over
        (_openrouter("1784160000000"), 1.0),  # tomorrow
        ({"error": {"message": f"OpenrouterException - {json.dumps(_openrouter('1784111819500'))}"}}, 42.5),  # LiteLLM
    ],
)
def test_a_wait_is_stated_in_the_error_where_no_header_does(endpoint: Endpoint, body: dict | list, wait: float):
    busy = json.dumps(body).encode()

    def play(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response_only(429)
        handler.send_header("Date", "Wed, 15 Jul 2026 10:36:17 GMT")  # 1784111777 s after 1970
        handler.send_header("Content-Length", str(len(busy)))
        handler.end_headers()
        handler.wfile.write(busy)

    endpoint.script = [play, answer("a")]
    assert texts(sample(endpoint.model(), 1)) == ["a"]
    assert endpoint.waits == [pytest.approx(wait)]


@pytest.mark.parametrize("status", [408, 504, 524])
def test_a_gateway_that_waited_long_for_the_model_is_asked_twice(
    endpoint: Endpoint, status: int, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(openai, "GATEWAY", 0.0)
    endpoint.script = lambda body: failure(status, "timed out")
    assert "cannot answer now" in said(endpoint)
    assert endpoint.waits == [1.0]
    endpoint.script = lambda body: failure(503, "no worker is free")  # no model was at work
    assert "cannot answer now" in said(endpoint)
    assert endpoint.waits[1:] == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]


@pytest.mark.parametrize("before", [[], [answer("a")], [failure(503), failure(503)]])
def test_an_endpoint_that_hangs_is_asked_twice(endpoint: Endpoint, before: list[Answer]):
    done, asked, model = threading.Event(), len(before) + 2, endpoint.model()
    patient, hasty = model._client.timeout, httpx2.Timeout(0.5, connect=20.0)
    left = threading.Semaphore(0)

    def hang(handler: BaseHTTPRequestHandler) -> None:
        left.release()
        done.wait()

    def script(body: dict[str, Any]) -> Answer:
        if not before:
            return hang
        play = before.pop()
        model._client.timeout = patient if before else hasty  # from the next request on: an answer may take its time
        return play

    model._client.timeout = patient if before else hasty
    endpoint.script = script
    try:
        with pytest.raises(ModelError, match="did not answer: it has"):
            for _ in range(2):
                sample(model, 1)
        for _ in range(2):  # the server may read a request after its sender has gone
            left.acquire()
    finally:
        done.set()
    assert len(endpoint.bodies) == asked


def test_an_endpoint_that_answers_blanks_for_ever_is_left(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(openai, "PATIENCE", 0.3)
    done = threading.Event()

    def blanks(handler: BaseHTTPRequestHandler) -> None:
        handler.send_response(200)
        handler.send_header("Content-Length", "1000000")
        handler.end_headers()
        while not done.wait(0.02):
            try:
                handler.wfile.write(b"\n")
            except OSError:
                return

    endpoint.script = lambda body: blanks
    try:
        assert "did not answer: it has" in said(endpoint)
    finally:
        done.set()
    assert len(endpoint.bodies) == 1


def test_an_endpoint_that_is_slow_is_waited_for(endpoint: Endpoint):
    late = threading.Event()

    def play(handler: BaseHTTPRequestHandler) -> None:
        late.wait(0.3)
        raw(GOOD)(handler)

    endpoint.script = [play]
    assert texts(sample(endpoint.model(), 1)) == ["a"]
    assert endpoint.waits == []


# --- failures that stay ----------------------------------------------------------------------------------------------


TOO_LONG: list[tuple[int, dict | list]] = [
    (400, {"error": {"message": "This model's maximum context length is 8192 tokens."}}),  # OpenAI, vLLM, DeepSeek
    (400, {"object": "error", "message": "The input is longer than the model's context length", "code": 400}),  # SGLang
    (422, {"error": "Input validation error: `inputs` tokens + `max_new_tokens` must be <= 4096"}),  # TGI
    (400, {"error": {"message": "request (9000 tokens) exceeds the available context size"}}),  # llama.cpp
    (400, [{"error": {"message": "The input token count exceeds the maximum number of tokens allowed"}}]),  # Gemini
    (400, {"object": "error", "message": "Prompt is too large for model with 32768 maximum context length"}),  # Mistral
    (
        400,
        {"error": {"message": "Provider returned error", "metadata": {"raw": "the maximum context length is 8192"}}},
    ),  # OpenRouter
]


@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        (failure(401), "to a valid one, or, if that is a proxy such as LiteLLM, check the key that it uses."),
        (failure(403, "Country not supported"), "refuses access (Error code: 403 - Country not supported); check what"),
        (failure(404, "your data policy"), "no model `m` for you (Error code: 404 - your data policy); check model="),
        (failure(402, "pay first"), "refuses the request (Error code: 402 - pay first); fix that"),
        (failure(400, "9000 tokens are too many"), "(Error code: 400 - 9000 tokens are too many); fix that"),
        ((400, {"error": "9000 tokens are too many"}, {}), "(Error code: 400 - 9000 tokens are too many); fix that"),
        ((402, {"detail": "pay first"}, {}), "(Error code: 402 - pay first); fix that"),
        ((413, "too\nlong", {}), "(Error code: 413 - too long); fix that"),
        ((400, {"message": "no\n\ngroup m"}, {}), "(Error code: 400 - no group m); fix that"),  # LiteLLM
        ((404, "<html>nothing here</html>", {}), "(Error code: 404); check model="),
        (
            (422, {"detail": [{"loc": ["body", "model"], "msg": "none of ours", "input": "temperature"}]}, {}),
            "(Error code: 422 - ['body', 'model']: none of ours); fix that",
        ),  # FastAPI
        (
            (429, {"error": {"message": "Budget has been exceeded!", "type": "budget_exceeded", "code": "429"}}, {}),
            "has no credit left",
        ),  # LiteLLM
        (
            failure(
                429,
                f"litellm.RateLimitError: OpenAIException - {QUOTA} read the docs: https://platform.openai.com/docs",
            ),
            "or one behind it, has no credit left (Error code: 429 - litellm.RateLimitError: OpenAIException - You",
        ),
        ((400, [{"error": {"code": 400, "message": "no such key"}}], {}), "400 - no such key); fix that"),  # Gemini
        (
            (422, {"message": {"detail": [{"loc": ["body", "n"], "msg": "not known"}]}}, {}),
            "(Error code: 422 - ['body', 'n']: not known); fix that",
        ),  # Mistral
        (failure(400, "API key not valid. Please pass a valid API key."), "refused the key; set the environment"),
        (
            failure(400, "Model Not Exist"),
            "has no model `m` for you (Error code: 400 - Model Not Exist); check",
        ),  # DeepSeek
        (failure(400, "m is not a valid model ID"), "has no model `m` for you"),  # OpenRouter
        ((400, {"object": "error", "message": "Invalid model: m", "code": "1500"}, {}), "has no model `m`"),  # Mistral
        (failure(400, "/chat/completions: Invalid model name passed in model=m."), "has no model `m`"),  # LiteLLM
        (
            (404, {"object": "error", "message": "The model `m` does not exist.", "code": 404}, {}),
            "has no model",
        ),  # vLLM
        *(
            ((status, body, {}), "serve the model with a longer context, or start a run with another")
            for status, body in TOO_LONG
        ),
        ((400, [[[[[[[["deep"]]]]]]]], {}), "(Error code: 400); fix that"),
        (raw(b"<html>welcome</html>"), "an OpenAI-compatible endpoint (its answer is a web page); check base_url"),
        (raw(b"[1, 2]"), "does not answer like an OpenAI-compatible endpoint"),
        (raw(b'"choices"'), "does not answer like an OpenAI-compatible endpoint"),
        (raw(b'{"object": "list"}'), "its answer has no choices"),
        (
            raw(b'{"error": "Unexpected endpoint or method. (POST /chat/completions)"}'),
            "which often ends in /v1",
        ),  # LM Studio
        (replaced(choices=None, error={"detail": "Unexpected endpoint"}), "(Unexpected endpoint)"),
        (raw(b"\x00\xff\xfe\x80"), "does not answer like an OpenAI-compatible endpoint"),
    ],
)
def test_what_waiting_cannot_mend_is_said_at_once(endpoint: Endpoint, bad: Answer, sentence: str):
    endpoint.script = [bad]
    assert sentence in said(endpoint)
    assert endpoint.waits == []


@pytest.mark.parametrize(("variable", "status"), [("HTTP_PROXY", 403), ("ALL_PROXY", 503)])
def test_a_proxy_before_a_server_of_this_machine_is_named(monkeypatch: pytest.MonkeyPatch, variable: str, status: int):
    proxy = Endpoint()
    proxy.script = lambda body: failure(status, "nothing there")
    monkeypatch.setenv(variable, proxy.url.replace("http://", "http://me:secret@"))
    told = said(proxy, base_url="http://localhost:1/v1")
    assert f" Requests go through the proxy {proxy.url}; set NO_PROXY=localhost to bypass it." in told
    monkeypatch.setenv("NO_PROXY", "localhost")
    assert "proxy" not in said(proxy, base_url="http://localhost:1/v1")
    proxy.close()


def test_an_answer_without_end_is_not_read_into_memory(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(openai, "MAX_BODY", 1 << 20)
    endpoint.script = [raw(b"x" * (2 << 20))]
    assert "larger than 1 MB" in said(endpoint)


def test_a_redirect_is_not_followed_and_the_key_not_sent_there(endpoint: Endpoint):
    other = Endpoint()
    other.script = lambda body: answer("from elsewhere")
    endpoint.script = lambda body: (307, "", {"Location": f"{other.url}/chat/completions?token={KEY}"})
    sentence = said(endpoint)
    other.close()
    assert f"redirects requests to {other.url}; set base_url=" in sentence
    assert other.bodies == [] and KEY not in sentence


def test_a_redirect_to_another_path_of_the_endpoint_names_the_whole_address(endpoint: Endpoint):
    endpoint.script = [(308, "", {"Location": "/api/v2/chat/completions"})]
    assert f"redirects requests to {endpoint.url.removesuffix('/v1')}/api/v2; set base_url=" in said(endpoint)


def test_a_redirect_to_no_address_is_one_sentence(endpoint: Endpoint):
    endpoint.script = [(307, "", {"Location": "http://["})]
    assert "redirects requests to an invalid address" in said(endpoint)


@pytest.mark.parametrize(
    "url", ["http://localhost:port/v1", "http://[::1/v1", "http://a..b/v1", f"http://{'a' * 64}/v1"]
)
def test_an_address_that_is_none_is_one_sentence(url: str):
    with pytest.raises(ConfigError, match="The address of the model's endpoint is not valid"):
        EndpointModel("m", base_url=url)


@pytest.mark.parametrize(
    ("variable", "value", "sentence"),
    [
        ("HTTPS_PROXY", "ftp://proxy:3128", "is not a valid address"),
        ("ALL_PROXY", "socks://localhost:1080", "write a proxy like http://localhost:3128 or socks5://"),  # GNOME's
        ("HTTP_PROXY", "http://me:secret@proxy:x", "is not a valid address"),
        ("SSL_CERT_FILE", "/nowhere/ca.pem", r"cannot be read \(No such file"),
    ],
)
def test_a_proxy_or_certificates_that_cannot_be_used_are_one_sentence(
    monkeypatch: pytest.MonkeyPatch, variable: str, value: str, sentence: str
):
    monkeypatch.setenv(variable, value)
    with pytest.raises(ConfigError, match=sentence) as caught:
        EndpointModel("m", base_url="https://localhost:1/v1")
    assert "secret" not in str(caught.value)


def test_a_socks_proxy_without_its_package_is_one_sentence(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "socksio", None)
    monkeypatch.setenv("ALL_PROXY", "socks5://localhost:1080")
    with pytest.raises(ConfigError, match="pip install socksio"):
        EndpointModel("m", base_url="http://localhost:1/v1")


# --- odd answers -----------------------------------------------------------------------------------------------------

ODD = [
    [],
    [None],
    ["text"],
    [{}],
    [{"message": None}],
    [{"message": {"content": None}}],
    [{"message": {"content": 7}}],
    [{"message": {"refusal": 7, "tool_calls": [None, {"function": None}, {"function": {"arguments": {}}}]}}],
    [{"message": {"tool_calls": {}}}],
    [{"message": {"content": [{"text": [{"text": "deeper"}]}]}}],
]


@pytest.mark.parametrize("choices", ODD)
def test_choices_without_text_are_asked_for_again_and_then_an_empty_reply(endpoint: Endpoint, choices: list):
    endpoint.script = lambda body: replaced(choices=choices)
    assert texts(sample(endpoint.model(), 1)) == [""]
    assert len(endpoint.bodies) == 3


@pytest.mark.parametrize(
    "message",
    [
        {"content": None, "refusal": "I will not."},
        {"content": "", "tool_calls": [{"id": "1", "type": "function", "function": {"arguments": "I will not."}}]},
        {"content": "I will not.", "refusal": "no", "tool_calls": [{"function": {"arguments": "no"}}]},
    ],
)
def test_a_refusal_and_a_call_of_a_tool_are_replies(endpoint: Endpoint, message: dict):
    endpoint.script = [replaced(choices=[{"message": message}])]
    assert texts(sample(endpoint.model(), 1)) == ["I will not."]


def test_a_stream_that_breaks_off_is_asked_for_again(endpoint: Endpoint):
    piece = {"choices": [{"index": 0, "delta": {"content": "a"}}]}
    failed = {"error": {"message": "the provider is gone"}}
    endpoint.script = [
        streamed(piece, done=False),  # its end is missing
        streamed(piece, failed),
        streamed({"model": "m-1", **piece}, {"choices": [{"delta": {}, "finish_reason": "stop"}]}),
    ]
    (reply,) = sample(endpoint.model(), 1)
    assert (reply.text, reply.model, len(endpoint.bodies)) == ("a", "m-1", 3)
    cut = {"choices": [{"delta": {"content": "a"}, "finish_reason": "length"}]}
    endpoint.script = [streamed(cut, {"choices": [{"delta": {}}]}), answer("b")]  # nothing follows the end but blanks
    assert texts(sample(endpoint.model(), 1)) == ["b"]
    endpoint.script = [streamed(failed), replaced(choices=[{"message": {"content": "b"}}])]
    assert texts(sample(endpoint.model(), 1)) == ["b"]
    assert endpoint.waits == [1.0]


def test_an_error_beside_a_reply_costs_no_second_request(endpoint: Endpoint):
    endpoint.script = [replaced(error={"message": "this was your last token"})]
    assert texts(sample(endpoint.model(), 1)) == ["a"]


def test_a_gateway_that_speaks_of_an_upstream_is_not_asked_to_stream(endpoint: Endpoint):
    endpoint.script = [failure(500, "upstream error"), answer("a")]
    assert texts(sample(endpoint.model(), 1)) == ["a"]
    assert not any("stream" in body for body in endpoint.bodies)


@pytest.mark.parametrize(
    "event", [b"[]", b"{", b'{"choices": 7}', b'{"choices": [null, {"index": "x", "delta": 7}]}', b'{"usage": 7}']
)
def test_events_that_are_none_are_passed_over(endpoint: Endpoint, event: bytes):
    good = b'{"choices": [{"delta": {"content": "a"}}]}'
    endpoint.script = [raw(b": waits\n\ndata: " + event + b"\n\ndata: " + good + b"\n\ndata: [DONE]\n\n")]
    assert texts(sample(endpoint.model(), 1)) == ["a"]


def test_text_in_parts_is_joined(endpoint: Endpoint):
    parts = [{"type": "text", "text": "a"}, {"type": "image"}, {"type": "text", "text": "b"}]
    endpoint.script = [replaced(choices=[{"message": {"content": parts}}])]
    assert texts(sample(endpoint.model(), 1)) == ["ab"]


@pytest.mark.parametrize(
    "usage",
    [None, [], {}, {"prompt_tokens": "many"}, {"prompt_tokens": -1}, {"prompt_tokens": 10**30}, {"prompt_tokens": 0.5}],
)
def test_counts_that_are_none_are_zero(endpoint: Endpoint, usage: object):
    endpoint.script = [replaced(usage=usage)]
    (reply,) = sample(endpoint.model(), 1)
    assert (reply.text, reply.usage.prompt_tokens, reply.usage.completion_tokens) == ("a", 0, 0)


def test_another_encoding_than_it_says_is_read_as_far_as_it_goes(endpoint: Endpoint):
    latin = json.dumps({"choices": [{"message": {"content": "naïve"}}]}, ensure_ascii=False).encode("latin-1")
    utf16 = json.dumps({"choices": [{"message": {"content": "naïve"}}]}, ensure_ascii=False).encode("utf-16")
    endpoint.script = [raw(latin), raw(utf16)]
    model = endpoint.model()
    assert texts(sample(model, 1)) == ["na\N{REPLACEMENT CHARACTER}ve"]
    assert texts(sample(model, 1)) == ["naïve"]


def test_a_reply_of_5_megabytes_arrives(endpoint: Endpoint):
    endpoint.script = [answer("x" * 5_000_000)]
    (reply,) = sample(endpoint.model(), 1)
    assert len(reply.text) == 5_000_000


def test_a_body_nested_too_deep_is_an_answer_that_breaks_off(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(openai, "ATTEMPTS", 1)
    endpoint.script = [raw(b'{"a":' * 100_000), raw(b'{"error":' * 600 + b'"deep"' + b"}" * 600)]
    assert "was cut off" in said(endpoint)
    assert "cannot answer now ({'error': {'error': " in said(endpoint)


# --- the key ---------------------------------------------------------------------------------------------------------


def test_the_key_goes_to_the_endpoint_and_nowhere_else(endpoint: Endpoint):
    endpoint.script = [answer(f"You sent Bearer {KEY}")]
    (reply,) = sample(endpoint.model(), 1)
    assert endpoint.keys == [f"Bearer {KEY}"]
    assert reply.text == "You sent Bearer ***"


@pytest.mark.parametrize("status", [400, 402, 422, 500])
def test_an_error_that_quotes_the_key_is_shown_without(
    endpoint: Endpoint, status: int, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(openai, "ATTEMPTS", 1)
    endpoint.script = [failure(status, f"bad header Bearer {KEY}")]
    sentence = said(endpoint)
    assert KEY not in sentence and "bad header Bearer ***" in sentence


def test_a_password_in_the_address_from_the_environment_is_not_shown(
    endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch
):
    address = endpoint.url.replace("http://", "http://user:canary-password@")
    monkeypatch.setenv("OPENAI_BASE_URL", address)
    endpoint.script = [failure(404)]
    with pytest.raises(ModelError) as caught:
        sample(open_model(RunConfig(model="m")), 1)
    assert "canary" not in str(caught.value) and "user" not in str(caught.value)
    assert endpoint.url in str(caught.value)


def test_a_password_in_base_url_is_refused_without_showing_it():
    for address in ("https://user:canary@host/v1", "https://host/v1?api_key=canary"):
        with pytest.raises(ConfigError, match="must not hold a user name, a password or a `\\?`") as caught:
            RunConfig(base_url=address)
        assert "canary" not in str(caught.value)
    RunConfig(base_url="https://host/a@b/v1")  # no password


def test_an_address_in_the_environment_may_need_no_key(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("OPENAI_API_KEY")
    monkeypatch.setenv("OPENAI_BASE_URL", endpoint.url)
    endpoint.script = [answer("a")]
    assert texts(sample(open_model(RunConfig(model="m")), 1)) == ["a"]


@pytest.mark.parametrize("pasted", ["/chat/completions", "/chat/completions/"])
def test_the_address_of_requests_is_taken_for_that_of_the_endpoint(endpoint: Endpoint, pasted: str):
    model = open_model(RunConfig(model="m", base_url=endpoint.url + pasted))
    assert str(model._client.base_url) == f"{endpoint.url}/"  # type: ignore[attr-defined]


def test_an_empty_address_in_the_environment_is_none(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OPENAI_BASE_URL", " ")
    client = open_model(RunConfig(model="gpt-5"))._client  # type: ignore[attr-defined]
    assert str(client.base_url) == "https://api.openai.com/v1/"


def test_a_connection_that_is_not_made_is_told_from_an_answer_that_does_not_come(
    endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch
):
    def silent(*_: object, **__: object) -> None:
        raise httpx2.ConnectTimeout("")

    model = endpoint.model()
    monkeypatch.setattr(httpx2.HTTPTransport, "handle_request", silent)
    with pytest.raises(ModelError, match=r"cannot be reached \(no reason given\); check base_url and"):
        sample(model, 1)
    assert model._client.timeout == httpx2.Timeout(600.0, connect=20.0)


def test_a_certificate_that_is_not_trusted_is_said_with_what_to_set(
    endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch
):
    def distrusts(*_: object, **__: object) -> None:
        raise httpx2.ConnectError("[SSL: CERTIFICATE_VERIFY_FAILED] certificate verify failed: self-signed certificate")

    monkeypatch.setattr(httpx2.HTTPTransport, "handle_request", distrusts)
    sentence = said(endpoint)
    assert "self-signed certificate); check base_url, or set SSL_CERT_FILE to the certificates" in sentence


def test_https_before_a_server_that_speaks_http_is_said_with_what_to_write(endpoint: Endpoint):
    assert "which may have to begin with http://" in said(endpoint, base_url=endpoint.url.replace("http:", "https:"))


def test_a_key_with_a_line_break_is_trimmed_and_one_that_no_header_takes_is_refused(
    endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("OPENAI_API_KEY", f"{KEY}\n")
    endpoint.script = [answer("a")]
    sample(endpoint.model(), 1)
    assert endpoint.keys == [f"Bearer {KEY}"]
    monkeypatch.setenv("OPENAI_API_KEY", "sk-ключ")
    with pytest.raises(ModelError, match="set it again") as caught:
        endpoint.model()
    assert "ключ" not in str(caught.value)


def test_a_word_that_stands_for_no_key_is_left_in_replies(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OPENAI_API_KEY", "none")
    endpoint.script = [answer("none of it")]
    assert texts(sample(endpoint.model(), 1)) == ["none of it"]
