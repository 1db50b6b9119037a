"""Makes parts of datasets; the first process that is asked for the second one ends at once."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

from vico.datasets.worker import player


def dying(options: Any, tell: Any) -> Any:
    make = player(options, tell)

    def made(task: Any) -> Any:
        flag = Path(os.environ["VICO_TEST_FLAG"])
        if task["folder"].startswith("000001") and not flag.exists():
            flag.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return make(task)

    return made
