"""The command line in this process."""

from __future__ import annotations

import pytest

from vico.cli.main import main


def vico(*arguments: object) -> int:
    """Run a command; return its exit code."""
    with pytest.raises(SystemExit) as exit_:
        main([str(argument) for argument in arguments])
    code = exit_.value.code
    assert code is None or isinstance(code, int)
    return code or 0
