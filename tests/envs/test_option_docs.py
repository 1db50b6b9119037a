"""The options of environments: typed, and documented where they are given."""

from __future__ import annotations

import re
from dataclasses import MISSING, fields

import vico
from vico.envs.spec import EnvOptions, EnvSpec

#: What `make` takes by other names.
FOLDERS = {"world", "community"}


def test_every_setting_of_an_environment_is_a_typed_option() -> None:
    assert set(EnvOptions.__annotations__) == {field.name for field in fields(EnvSpec)} - FOLDERS


def test_make_documents_every_option_with_its_default() -> None:
    documented = dict(re.findall(r"``(\w+)=(.+?)``", vico.make.__doc__ or ""))
    defaults = {
        field.name: repr(field.default if field.default_factory is MISSING else field.default_factory())
        for field in fields(EnvSpec)
        if field.name not in FOLDERS
    }
    assert documented == defaults
