"""Watch a run that goes on, and reach into it, from a program of one's own: a client of the viewer's protocol.

python examples/15_live.py --world out/demo/world --community out/demo/community --out out/live-example

Needs the extra "viewer". Nothing of vico's code is used by the client: docs/viewer_protocol.md says all that it knows.
"""

import argparse
import json
import struct
import subprocess
import sys
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
from websockets.sync.client import connect

QUIET = ["--robots", "none", "--cars", "4", "--pedestrians", "4"]


class Client:
    """Asks the server of one run."""

    def __init__(self, url: str, stack: ExitStack) -> None:
        parts = urlsplit(url)
        self.host, token = parts.netloc, parse_qs(parts.query)["token"][0]
        self.headers = {"Authorization": f"Bearer {token}"}
        self.socket = stack.enter_context(
            connect(f"ws://{self.host}/stream", additional_headers=self.headers, max_size=None)
        )
        self._asked = 0

    def get(self, path: str) -> dict:
        """Return what the server answers to a path, JSON."""
        request = urllib.request.Request(f"http://{self.host}{path}", headers=self.headers)
        with urllib.request.urlopen(request) as answer:
            return json.load(answer)

    def command(self, name: str, /, **arguments: object) -> dict:
        """Have something done between two steps; return the reply."""
        self._asked += 1
        message = {"type": "command", "id": self._asked, "command": name, "arguments": arguments}
        self.socket.send(json.dumps(message))
        reply = self._next("reply", id=self._asked)
        if not reply["ok"]:
            raise SystemExit(f"{name}: {reply['error']}")
        return reply

    def steps(self, number: int) -> int:
        """Make some steps, and wait until they are made; return the step that the run is at then."""
        at = self.get("/api/run")["control"]["step"]
        self.command("step", steps=number)
        return self.wait_for("paused", at + number)

    def wait_for(self, status: str, step: int = 0) -> int:
        """Wait until the run is paused or has ended, at a step or after it; return the step."""
        while True:
            told = self._next("control")  # comes once a second at least; a stream that nobody reads is closed
            if told["step"] >= step and told["status"] == status:
                return told["step"]

    def frame(self, step: int) -> bytes:
        """Return a step as a binary frame."""
        self._asked += 1
        self.socket.send(json.dumps({"type": "range", "id": self._asked, "first": step, "last": step}))
        while True:
            content = self.socket.recv(timeout=60)
            if isinstance(content, bytes) and struct.unpack_from("<I", content, 36)[0] == self._asked:
                return content

    def _next(self, kind: str, **fields: object) -> dict:
        while True:
            content = self.socket.recv(timeout=60)
            message = {} if isinstance(content, bytes) else json.loads(content)
            if message.get("type") == kind and all(message[name] == value for name, value in fields.items()):
                return message


def positions(frame: bytes) -> dict[int, list[float]]:
    """Return where every body is in a frame, metres by entity."""
    (count,) = struct.unpack_from("<I", frame, 16)
    # The first columns: entity, x, y and z of all bodies, the latter in millimetres.
    entity, *place = np.frombuffer(frame, "<i4", 4 * count, 104).reshape(4, count)
    return dict(zip(entity.tolist(), (np.transpose(place) / 1000).round(1).tolist(), strict=True))


def rain(frame: bytes) -> float:
    """Return how much rain falls in a frame, mm/h."""
    return struct.unpack_from("<16f", frame, 40)[5]


def look(client: Client) -> None:
    """Reach into a run that waits before its first step."""
    head = client.get("/api/run")
    names = {agent["entity"]: agent["person"]["name"] for agent in head["agents"] if agent["person"]}
    print(f"{head['world']['name']}: {len(names)} residents; the run is {head['control']['status']}")

    step = client.steps(5)
    for entity, place in positions(client.frame(step)).items():
        if entity in names:
            print(f"step {step}: {names[entity]} is at {place}")

    client.command("snapshot", name="before the rain")
    client.command("weather", kind="rain", over=0)
    step = client.steps(5)
    print(f"step {step}: {rain(client.frame(step)):.1f} mm of rain an hour")

    branch = client.command("branch", step=5)
    step = client.steps(5)
    print(f"what if it stayed dry, in {Path(branch['path']).name}")
    print(f"step {step}: {rain(client.frame(step)):.1f} mm of rain an hour")
    client.command("stop")
    client.wait_for("ended")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--community", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    where = [str(given.world), str(given.community), "--out", str(given.out)]
    command = [sys.executable, "-m", "vico.cli.main", "live", *where, *QUIET, "--paused", "--speed", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server, ExitStack() as stack:
        stack.callback(server.terminate)  # it shows its page until somebody ends it; the run itself is over by then
        assert server.stdout is not None
        look(Client(server.stdout.readline().split()[-1], stack))


if __name__ == "__main__":
    main()
