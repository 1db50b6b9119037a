"""HTTP, politely: one exchange with its bounds, retries with back-off, and a client with a cache on top of both.

It stands on Python's own `urllib`. The libraries that were held against it (requests, urllib3, httpx) would bring
connection pools that we do not need, and leave to us what these modules are about: redirects to http and https alone
that take no key to another host, answers bounded in size after unpacking and in time, `Retry-After` obeyed up to a
bound, environment proxies (urllib3), errors free of keys, and no cached errors.
"""

from vico.io.http.client import HttpClient
from vico.io.http.exchange import USER_AGENT, HttpError, HttpRequest, Limits, send
from vico.io.http.retries import Backoff, with_retries

__all__ = ["USER_AGENT", "Backoff", "HttpClient", "HttpError", "HttpRequest", "Limits", "send", "with_retries"]
