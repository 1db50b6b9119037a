"""An S3 server on this machine, for tests of object stores: moto's, in a thread."""

from __future__ import annotations

import logging
import os
import urllib.request
from importlib.util import find_spec

import pytest

_NEEDED = ("s3fs", "moto", "flask_cors")
needs_s3 = pytest.mark.skipif(
    any(find_spec(name) is None for name in _NEEDED),
    reason="no S3 to test against: pip install -e '.[s3]' 'moto[s3]' flask flask-cors",
)


class S3Server:
    """The server; the environment of the block says where it is."""

    def __init__(self) -> None:
        from moto.server import ThreadedMotoServer

        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        self._server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)

    def bucket(self, name: str) -> str:
        """Make a bucket, and return its URL."""
        import boto3

        boto3.client("s3").create_bucket(Bucket=name)
        return f"s3://{name}"

    def __enter__(self) -> S3Server:
        self._server.start()
        host, port = self._server.get_host_and_port()
        # What an earlier server of this process held is still there.
        urllib.request.urlopen(urllib.request.Request(f"http://{host}:{port}/moto-api/reset", method="POST")).close()
        self._before = dict(os.environ)
        os.environ |= {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}", "AWS_ACCESS_KEY_ID": "tests", "AWS_SECRET_ACCESS_KEY": "tests",
            "AWS_DEFAULT_REGION": "us-east-1",
        }  # fmt: skip
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()
        os.environ.clear()
        os.environ |= self._before
