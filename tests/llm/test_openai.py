"""Requests to good endpoints and to those with quirks; `test_endpoint_failures` has the bad ones."""

import socket
import threading
from typing import Any

import pytest

from openeureka.errors import BudgetError, ModelError
from openeureka.llm.openai import EndpointModel
from openeureka.llm.price import Price, afford
from openeureka.reward import extract

from .endpoint import PROMPT, Answer, Endpoint, answer, failure, sample, streamed, texts


def test_one_request_gives_all_samples(endpoint: Endpoint):
    endpoint.script = [answer("a", "b", "c")]
    replies = sample(endpoint.model(temperature=0.7), 3)
    assert texts(replies) == ["a", "b", "c"]
    assert endpoint.bodies[0]["n"] == 3 and endpoint.bodies[0]["temperature"] == 0.7
    assert endpoint.bodies[0]["messages"][1] == {"role": "user", "content": "u" * 40}


def test_tokens_and_cost_of_a_request_are_shared_by_its_replies(endpoint: Endpoint):
    endpoint.script = [answer("a", "b")]
    first, second = sample(endpoint.model(price=Price(2.0, 10.0)), 2)
    assert (first.usage.prompt_tokens, first.usage.completion_tokens) == (100, 10)
    assert (second.usage.prompt_tokens, second.usage.completion_tokens) == (0, 10)
    # 100 tokens at 2 $/M in and 10 tokens at 10 $/M out, each
    assert first.usage.cost_usd == pytest.approx(0.0003)
    assert second.usage.cost_usd == pytest.approx(0.0001)


def test_without_a_count_of_tokens_the_cost_is_guessed_from_the_texts(
    endpoint: Endpoint, caplog: pytest.LogCaptureFixture
):
    def silent(body: dict) -> Answer:
        status, payload, headers = answer(*["a" * 4000] * body.get("n", 1))
        return status, {key: value for key, value in payload.items() if key != "usage"}, headers

    endpoint.script = silent
    model = endpoint.model(price=Price(2.0, 10.0))
    first, second = sample(model, 2)
    sample(model, 1)
    asked = sum(len(message.content) for message in PROMPT.messages) // 4
    # Each reply has 1000 tokens at 10 $/M. The prompt is paid once, at 2 $/M.
    assert first.usage.cost_usd == pytest.approx(0.01 + asked * 2e-6) and second.usage.cost_usd == pytest.approx(0.01)
    assert first.usage.prompt_tokens == first.usage.completion_tokens == 0
    assert [record.message.partition(" ")[2] for record in caplog.records] == [
        "does not count tokens: costs are guessed from the length of its replies."
    ]
    with pytest.raises(BudgetError, match=r"0\.02 are spent"):
        afford(0.03, [first, second], Price(2.0, 10.0), PROMPT, 2)
    with caplog.at_level("WARNING"):
        assert sample(endpoint.model(), 1)[0].usage.cost_usd == 0.0


def test_an_endpoint_that_ignores_n_is_asked_in_parallel_from_then_on(endpoint: Endpoint):
    endpoint.script = lambda body: answer("x")
    model = endpoint.model()
    assert texts(sample(model, 4)) == ["x"] * 4
    assert [body.get("n") for body in endpoint.bodies] == [4, None, None, None]
    sample(model, 2)
    assert [body.get("n") for body in endpoint.bodies[4:]] == [None, None]


def test_an_endpoint_that_refuses_n_is_asked_in_parallel(endpoint: Endpoint):
    endpoint.script = lambda body: failure(400, "n must be 1") if "n" in body else answer("x")
    assert texts(sample(endpoint.model(), 3)) == ["x"] * 3


def test_an_endpoint_that_refuses_n_as_if_it_were_in_trouble_is_asked_in_parallel(endpoint: Endpoint):
    refusal = failure(500, "Only one completion choice is allowed")  # llama.cpp
    endpoint.script = lambda body: refusal if "n" in body else answer("x")
    model = endpoint.model()
    assert texts(sample(model, 3)) == ["x"] * 3
    assert endpoint.waits == [1.0]
    endpoint.script = lambda body: answer(*["y"] * body["n"])  # after an error 500, n is tried again
    assert texts(sample(model, 3)) == ["y"] * 3


@pytest.mark.parametrize(
    "refusal",
    [
        failure(400, "Unsupported value: 'temperature'"),
        (400, {"error": "temperature must be 1"}, {}),
        (422, {"detail": [{"loc": ["body", "temperature"], "msg": "extra fields not permitted"}]}, {}),
        (400, "no temperature, please", {}),
    ],
)
def test_a_model_that_refuses_a_temperature_is_asked_without_one(endpoint: Endpoint, refusal: Answer):
    endpoint.script = [refusal, answer("a", "b")]
    assert texts(sample(endpoint.model(), 2)) == ["a", "b"]
    assert "temperature" not in endpoint.bodies[1]


@pytest.mark.parametrize(
    ("status", "refusal"),
    [
        (400, "System role not supported"),  # Gemma by vLLM
        (400, "Unsupported value: 'messages[0].role' does not support 'system' with this model."),  # o1-mini
        (500, "Conversation roles must alternate user/assistant/user/assistant/..."),  # Mistral by llama.cpp
    ],
)
def test_a_model_without_a_system_role_is_told_the_same_by_the_user(endpoint: Endpoint, status: int, refusal: str):
    endpoint.script = lambda body: (
        failure(status, refusal) if body["messages"][0]["role"] == "system" else answer(*["x"] * body.get("n", 1))
    )
    model = endpoint.model()
    assert texts(sample(model, 2)) == ["x", "x"]
    assert endpoint.bodies[-1]["messages"] == [{"role": "user", "content": f"{'s' * 40}\n\n{'u' * 40}"}]
    assert endpoint.waits == [] and endpoint.bodies[-1]["n"] == 2
    sample(model, 1)
    assert len(endpoint.bodies) == 3


def test_a_model_that_only_streams_is_asked_to_stream(endpoint: Endpoint):
    def script(body: dict[str, Any]) -> Answer:
        if not body.get("stream"):
            return failure(400, "This model only support stream mode, please enable the stream parameter.")
        pieces = [(0, "a", None), (1, "\u2028", None), (0, "b", "stop"), (1, "c", "stop")]
        choices = [{"index": at, "delta": {"content": text}, "finish_reason": end} for at, text, end in pieces]
        events = [{"choices": [choice], "usage": None} for choice in choices]
        events.append({"choices": [], "usage": {"prompt_tokens": 100, "completion_tokens": 20}})
        return streamed(*events)

    endpoint.script = script
    model = endpoint.model()
    replies = sample(model, 2)
    assert texts(replies) == ["ab", "\u2028c"]
    assert endpoint.bodies[1]["stream_options"] == {"include_usage": True} and endpoint.waits == []
    assert sum(reply.usage.prompt_tokens for reply in replies) == 100
    assert [reply.usage.completion_tokens for reply in replies] == [10, 10]
    sample(model, 2)
    assert len(endpoint.bodies) == 3


def test_requests_that_were_under_way_with_a_temperature_are_all_asked_again_without(endpoint: Endpoint):
    together = threading.Barrier(3)

    def script(body: dict[str, Any]) -> Answer:
        if "n" in body:
            return failure(400, "n must be 1")
        if "temperature" not in body:
            return answer("x")
        together.wait()
        return failure(400, "Unsupported value: 'temperature'")

    endpoint.script = script
    assert texts(sample(endpoint.model(), 3)) == ["x"] * 3


def test_waits_double_and_a_stated_wait_is_honoured(endpoint: Endpoint):
    endpoint.script = [failure(500), failure(429), failure(503, Retry_After="7.5"), failure(500), answer("a")]
    assert texts(sample(endpoint.model(), 1)) == ["a"]
    assert endpoint.waits == [1.0, 2.0, 7.5, 8.0]


def test_retries_end(endpoint: Endpoint):
    endpoint.script = lambda body: failure(500, "overloaded")
    with pytest.raises(ModelError, match=r"cannot answer now .*overloaded"):
        sample(endpoint.model(), 1)
    assert endpoint.waits == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]


@pytest.mark.parametrize(
    ("response", "sentence"),
    [
        (failure(401, "Incorrect API key"), "OPENAI_API_KEY"),
        (failure(404), "no model `m`"),
        (failure(429, code="insufficient_quota"), "no credit left"),
        (failure(400, "context too long"), "context too long"),
        ((200, "<html>welcome</html>", {}), "ends in /v1"),
    ],
)
def test_what_waiting_cannot_mend_is_one_sentence_at_once(endpoint: Endpoint, response: Answer, sentence: str):
    endpoint.script = [response]
    with pytest.raises(ModelError, match=sentence):
        sample(endpoint.model(), 1)
    assert endpoint.waits == []


def test_a_refused_port_is_one_sentence_after_one_more_try(endpoint: Endpoint):
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))  # nobody else gets this port, and nobody listens
        model = endpoint.model(base_url=f"http://127.0.0.1:{bound.getsockname()[1]}/v1")
        with pytest.raises(ModelError, match=r"cannot be reached \(.*refused\); check base_url and"):
            sample(model, 1)
    assert endpoint.waits == [1.0]


def test_a_port_that_is_refused_after_an_answer_is_tried_for_a_minute(endpoint: Endpoint):
    endpoint.script = [answer("a")]
    model = endpoint.model()
    sample(model, 1)
    endpoint.close()
    with pytest.raises(ModelError, match="broke off; try again"):
        sample(model, 1)
    assert len(endpoint.waits) == 6


def test_empty_and_truncated_replies_are_asked_for_again_and_their_cost_is_kept(endpoint: Endpoint):
    endpoint.script = [answer("a", None), answer("cut", finish="length"), answer("b")]
    replies = sample(endpoint.model(), 2)
    assert texts(replies) == ["a", "b"]
    assert sum(reply.usage.completion_tokens for reply in replies) == 40
    assert sum(reply.usage.prompt_tokens for reply in replies) == 300


@pytest.mark.parametrize(
    "reason",
    [
        "length",
        "MAX_TOKENS",
        "content_filter",
        "error",
        "abort",
        "insufficient_system_resource",
        "content_filter: RECITATION",
    ],
)
def test_a_reply_that_was_not_ended_by_the_model_is_asked_for_again(endpoint: Endpoint, reason: str):
    endpoint.script = [answer("cut", finish=reason), answer("a", finish="eos")]
    assert texts(sample(endpoint.model(), 1)) == ["a"]


@pytest.mark.parametrize(
    "message",
    [
        {"content": "a", "reasoning_content": "thoughts"},  # DeepSeek, SGLang
        {
            "content": "a",
            "reasoning": "thoughts",
            "reasoning_details": [{"text": "thoughts"}],
        },  # OpenRouter, vLLM, Groq
        {
            "content": [{"type": "thinking", "thinking": [{"text": "thoughts"}]}, {"type": "text", "text": "a"}]
        },  # Mistral
    ],
)
def test_thoughts_beside_a_text_are_no_part_of_it(endpoint: Endpoint, message: dict):
    status, payload, headers = answer("")
    thoughts = {**message, "content": None if isinstance(message["content"], str) else message["content"][:1]}
    endpoint.script = [
        (status, {**payload, "choices": [{"message": said, "finish_reason": "stop"}]}, headers)
        for said in (thoughts, message)  # thoughts alone are no reply
    ]
    assert texts(sample(endpoint.model(), 1)) == ["a"]


def test_a_program_is_kept_where_only_the_text_after_it_is_cut(endpoint: Endpoint):
    reply = extract.fenced("def compute_reward(x):\n    return x, {}\n") + "\nThis works because"
    endpoint.script = [answer(reply, reply, finish="length")]
    assert texts(sample(endpoint.model(), 2)) == [reply, reply]
    assert len(endpoint.bodies) == 1


def test_a_slot_is_given_what_there_is_after_three_rounds(endpoint: Endpoint, caplog: pytest.LogCaptureFixture):
    endpoint.script = lambda body: answer(*["cut"] * body.get("n", 1), finish="length")
    model = endpoint.model()
    assert texts(sample(model, 2)) == ["cut", "cut"]
    assert len(endpoint.bodies) == 3
    sample(model, 1)
    assert sum("cuts replies off" in record.message for record in caplog.records) == 1


def test_replies_that_were_paid_for_are_handed_over_before_an_error(endpoint: Endpoint):
    answers = [answer("a"), failure(401), answer("b")]
    endpoint.script = lambda body: failure(400) if "n" in body else answers.pop()
    got = []
    with pytest.raises(ModelError, match="refused the key"):
        got.extend(endpoint.model().sample(PROMPT, n=3, seed=0))
    assert texts(got) == ["a", "b"]


def test_half_a_reply_that_was_paid_for_is_handed_over_before_an_error(endpoint: Endpoint):
    endpoint.script = [answer("cut", finish="length"), answer(None), failure(401)]
    got = []
    with pytest.raises(ModelError, match="refused the key"):
        got.extend(endpoint.model().sample(PROMPT, n=1, seed=0))
    (reply,) = got
    assert (reply.usage.prompt_tokens, reply.usage.completion_tokens) == (200, 20)


def test_half_a_reply_that_was_paid_for_is_handed_over_before_a_stop(
    endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch
):
    endpoint.script = [answer("cut", finish="length")]
    model = endpoint.model(price=Price(2.0, 10.0))
    ask, kept = model._call, []

    def stopped_later(*args: Any) -> Any:
        if endpoint.bodies:
            raise KeyboardInterrupt
        return ask(*args)

    monkeypatch.setattr(model, "_call", stopped_later)
    with pytest.raises(KeyboardInterrupt):
        kept.extend(model.sample(PROMPT, n=1, seed=0))
    (reply,) = kept
    assert reply.text == "cut" and reply.usage.cost_usd == pytest.approx(0.0003)


def test_an_empty_answer_has_no_tokens_and_is_no_sign_of_an_endpoint_that_counts_none(
    endpoint: Endpoint, caplog: pytest.LogCaptureFixture
):
    status, payload, headers = answer("")  # type: ignore[misc]
    payload["usage"] = {"prompt_tokens": 100, "completion_tokens": 0, "total_tokens": 100}
    endpoint.script = lambda body: (status, payload, headers)
    (reply,) = sample(endpoint.model(price=Price(2.0, 10.0)), 1)
    assert reply.usage.prompt_tokens == 300 and not caplog.records  # asked for three times


def test_a_temperature_that_is_refused_is_said_once(endpoint: Endpoint, caplog: pytest.LogCaptureFixture):
    endpoint.script = lambda body: failure(400, "temperature is too high") if "temperature" in body else answer("x")
    model = endpoint.model(temperature=3.0)
    sample(model, 1), sample(model, 1)
    assert [record.message for record in caplog.records if "temperature" in record.message] == [
        "m does not accept temperature=3: it uses its own."
    ]


def test_an_unknown_price_is_said_once(endpoint: Endpoint, caplog: pytest.LogCaptureFixture):
    endpoint.script = lambda body: answer("a")
    model = endpoint.model()
    sample(model, 1)
    sample(model, 1)
    assert [record.message for record in caplog.records if "price" in record.message] == [
        "The price of m is not known: its replies count as free. Add price=INPUT,OUTPUT."
    ]


def test_without_key_and_base_url_it_says_what_to_set():
    with pytest.raises(ModelError, match="OPENAI_API_KEY, set base_url="):
        EndpointModel("gpt-5", price=Price(1, 1))


def test_a_key_never_shows_in_an_error(endpoint: Endpoint, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret")
    endpoint.script = [failure(400, "bad header Bearer sk-secret")]
    with pytest.raises(ModelError) as caught:
        sample(endpoint.model(), 1)
    assert "sk-secret" not in str(caught.value) and "***" in str(caught.value)


@pytest.mark.parametrize(
    ("usage", "completion_tokens"),
    [
        # Gemini and xAI leave thoughts out of completion_tokens: 5150 in all less 100 of the prompt are 5050.
        ({"prompt_tokens": 100, "completion_tokens": 50, "total_tokens": 5150}, 5050),
        ({"prompt_tokens": 100, "completion_tokens": 5050, "total_tokens": 5150}, 5050),
        ({"prompt_tokens": 100, "completion_tokens": 50, "total_tokens": 0}, 50),
        ({"completion_tokens": 50, "total_tokens": 5150}, 50),  # the prompt may be most of the total
    ],
)
def test_thoughts_that_only_the_total_counts_are_paid_for(
    endpoint: Endpoint, usage: dict[str, int], completion_tokens: int
):
    status, payload, headers = answer("a")
    endpoint.script = [(status, {**payload, "usage": usage}, headers)]
    (reply,) = sample(endpoint.model(price=Price(0.0, 10.0)), 1)
    assert reply.usage.completion_tokens == completion_tokens
    assert reply.usage.cost_usd == pytest.approx(completion_tokens * 1e-5)


def test_requests_that_nobody_waits_for_are_not_tried_again_and_hold_no_exit_up(endpoint: Endpoint):
    first = threading.Semaphore(1)

    def script(body: dict[str, Any]) -> Answer:
        if "n" in body:
            return failure(400, "n must be 1")
        return answer("x") if first.acquire(blocking=False) else failure(503, Retry_After="100")

    endpoint.script = script
    replies = endpoint.model(patient=True).sample(PROMPT, n=9, seed=0)
    next(replies)
    asking = [thread for thread in threading.enumerate() if thread.name == "openeureka: asks"]
    assert asking and all(thread.daemon for thread in asking)
    replies.close()  # as Ctrl-C does
    for thread in asking:
        thread.join(90.0)  # less than the stated wait
        assert not thread.is_alive()
