"""A Ray cluster of several nodes on this machine, whose nodes a test can kill; `python ray_nodes.py` holds it.

Run as a program it starts nodes of one processor each and prints the address; then it obeys lines: ``kill N``, ``add``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed: pip install -e '.[ray]'")
#: Of every process that has to do with the cluster: nobody else may talk to it, and nothing is written at home.
ENVIRONMENT = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": "a" * 64, "RAY_USAGE_STATS_ENABLED": "0"}


class RayNodes:
    """The cluster, held by a process of its own; ended with the block."""

    def __init__(self, nodes: int) -> None:
        here = Path(__file__).parent
        path = os.pathsep.join([str(here), str(here / "challenges"), *sys.path])
        self.environment = {**os.environ, **ENVIRONMENT, "PYTHONPATH": path}
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(nodes)], env=self.environment, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self.address = self._answer()

    def kill(self, node: int) -> None:
        """Kill all processes of a node; 0 is the head."""
        self._ask(f"kill {node}")

    def add(self) -> None:
        """Add a node."""
        self._ask("add")

    def driver(self, program: str) -> subprocess.Popen[str]:
        """Start a program that uses the cluster."""
        return subprocess.Popen([sys.executable, "-c", program], env=self.environment, text=True)

    def _ask(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()
        assert self._answer() == "done"

    def _answer(self) -> str:
        assert self._process.stdout is not None
        while line := self._process.stdout.readline():
            if line.startswith("> "):
                return line[2:].strip()
        raise AssertionError("the process with the cluster has ended")

    def __enter__(self) -> RayNodes:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate(timeout=60)  # which closes its input


def main() -> None:
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    nodes = [cluster.head_node, *(cluster.add_node(num_cpus=1) for _ in range(int(sys.argv[1]) - 1))]
    print(f"> {cluster.address}", flush=True)
    for line in sys.stdin:
        what, *which = line.split()
        if what == "kill":
            cluster.remove_node(nodes[int(which[0])], allow_graceful=False)
        else:
            nodes.append(cluster.add_node(num_cpus=1))
        print("> done", flush=True)
    cluster.shutdown()


if __name__ == "__main__":
    main()
