"""The way to an endpoint: its key, its client, its address as it may be shown, and how long to leave it alone."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from email.utils import parsedate_to_datetime
from urllib.parse import urljoin, urlsplit
from urllib.request import getproxies, proxy_bypass

import httpx2
import openai

from ..errors import ConfigError, ModelError

OPENAI = "https://api.openai.com/v1"
CONNECT = 20.0
"""[s] for a connection."""
MAX_WAIT = 120.0
"""[s] between two tries, whatever the endpoint asks for."""
_RETRY_IN = re.compile(r"\b(?:retry|try again) (?:in|after) ((?:\d+(?:\.\d+)? ?(?:ms|h|m|s))+)", re.IGNORECASE)
"""Gemini's words, and OpenAI's and Azure's where a gateway drops the headers: `38.2s`, `6m0s`, `33 seconds`."""
_RESET = re.compile(r"X-RateLimit-Reset\W+(\d{13})\b", re.IGNORECASE)
"""Where OpenRouter tells when a limit ends, in milliseconds since 1970."""
_SECONDS = {"h": 3600.0, "m": 60.0, "s": 1.0, "ms": 0.001}


def api_key(base_url: str) -> str:
    """The key of the environment, or a word for a server that needs none.

    Raises:
        ModelError: no key where one is needed, or a value that cannot be a key.
    """
    key = os.environ.get("OPENAI_API_KEY", "").strip()
    if not key and not base_url:
        raise ModelError(
            "There is no key for the model's endpoint: set the environment variable OPENAI_API_KEY, set base_url= to a "
            "server that needs no key, or choose model=local."
        )
    if not (key.isascii() and key.isprintable()):
        raise ModelError("The environment variable OPENAI_API_KEY has characters that no key has; set it again.")
    return key or "none"


def client(key: str, base_url: str, silence: float) -> openai.OpenAI:
    """A client that gives up after `silence` [s] without receiving anything.

    The package's own retries are off: they do not tell an exhausted quota from a busy endpoint. Its redirects are off:
    it would send prompts wherever the endpoint points, and a person is to decide that.

    Raises:
        ConfigError: an address, a proxy or certificates that cannot be used.
    """
    try:
        http = openai.DefaultHttpxClient(follow_redirects=False)
    except ImportError:
        raise ConfigError(
            "The environment names a SOCKS proxy, which needs another package: pip install socksio, or unset ALL_PROXY."
        ) from None
    except OSError as error:
        raise ConfigError(
            f"The certificates that SSL_CERT_FILE or SSL_CERT_DIR names cannot be read ({error.strerror or error}); "
            "correct the path or unset it."
        ) from None
    except (ValueError, httpx2.InvalidURL):  # their texts may hold a password
        raise ConfigError(
            "HTTP_PROXY, HTTPS_PROXY, ALL_PROXY or NO_PROXY is not a valid address; write a proxy like "
            "http://localhost:3128 or socks5://localhost:1080, or unset it."
        ) from None
    timeout = httpx2.Timeout(silence, connect=CONNECT)
    try:
        address = _endpoint(base_url) or OPENAI  # given none, the package would take even an empty OPENAI_BASE_URL
        made = openai.OpenAI(api_key=key, base_url=address, max_retries=0, timeout=timeout, http_client=http)
        made.base_url.raw_host.decode().encode("idna")  # else a socket would fail at it in the middle of a request
    except (httpx2.InvalidURL, UnicodeError):
        raise ConfigError(
            "The address of the model's endpoint is not valid; write it like base_url=http://localhost:8000/v1."
        ) from None
    return made


def shown(url: str) -> str:
    """The address without a user's name and password, and without the query, which may hold a key."""
    try:
        parts = urlsplit(url)
    except ValueError:
        return "an invalid address"
    return parts._replace(netloc=parts.netloc.rpartition("@")[2], query="", fragment="").geturl()


def base_of(asked: str, location: str) -> str:
    """The base_url= that leads where a redirect of `asked` points to, without passwords and keys."""
    try:
        target = urljoin(asked, location)
    except ValueError:
        return "an invalid address"
    return _endpoint(shown(target))


def _endpoint(url: str) -> str:
    """The address of the endpoint, also where that of its requests is given."""
    return re.sub("/chat/completions/?$", "", url)


def detour(url: str) -> str:
    """A sentence that names the proxy which the environment sets for an address; empty where it sets none."""
    parts, proxies = urlsplit(url), getproxies()
    proxy = proxies.get(parts.scheme) or proxies.get("all")
    if not (proxy and parts.hostname) or proxy_bypass(parts.hostname):
        return ""
    proxy = shown(proxy if "://" in proxy else f"http://{proxy}")  # `shown` finds no password without a scheme
    return f" Requests go through the proxy {proxy}; set NO_PROXY={parts.hostname} to bypass it."


def delay(headers: Mapping[str, str], attempt: int, body: object = None) -> float:
    """Seconds to wait after the attempt: what the endpoint says, else 1, 2, 4, ..."""
    stated = _stated(headers)
    if stated is None:
        stated = _hinted(str(body), headers.get("date", ""))
    return min(2.0**attempt if stated is None else max(stated, 0.0), MAX_WAIT)


def _stated(headers: Mapping[str, str]) -> float | None:
    """Seconds of a `Retry-After` header, which is a number or a date (RFC 9110, 10.2.3). OpenAI and Azure also send a
    more exact one, in milliseconds."""
    value = headers.get("retry-after", "")
    try:
        seconds = float(headers["retry-after-ms"]) / 1000 if "retry-after-ms" in headers else float(value)
    except ValueError:
        try:
            # By the endpoint's own clock: this machine's may be wrong.
            seconds = (parsedate_to_datetime(value) - parsedate_to_datetime(headers["date"])).total_seconds()
        except (KeyError, ValueError, TypeError):
            return None
    return None if math.isnan(seconds) else seconds


def _hinted(body: str, date: str) -> float | None:
    """Seconds that an error names in its body: Gemini and OpenRouter send no `Retry-After`. None for more than
    MAX_WAIT: that is a limit of the day, which no wait outlasts."""
    if found := _RETRY_IN.search(body):
        parts = re.findall(r"([\d.]+) ?(ms|h|m|s)", found[1].lower())
        seconds = sum(float(number) * _SECONDS[unit] for number, unit in parts)
    elif found := _RESET.search(body):
        try:
            seconds = int(found[1]) / 1000 - parsedate_to_datetime(date).timestamp()
        except ValueError:
            return None
    else:
        return None
    return seconds if 0 < seconds <= MAX_WAIT else None
