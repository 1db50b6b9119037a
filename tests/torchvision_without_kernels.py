"""Lets torchvision be imported beside a build of torch that its compiled part does not fit: layers need none of it."""

import importlib
import importlib.util
import re
import sys
from functools import cache

_MOST = 40
_KEPT: list[object] = []


@cache
def make_importable() -> str:
    """Declare the operators that torchvision looks for; return why it cannot be imported even so, or nothing."""
    if importlib.util.find_spec("torch") is None or importlib.util.find_spec("torchvision") is None:
        return "torch or torchvision is not installed"
    import torch

    why = ""
    for _ in range(_MOST):
        try:
            importlib.import_module("torchvision")
            return ""
        except (ImportError, RuntimeError) as error:
            why = str(error)
        missing = re.search(r"operator torchvision::(\w+) does not exist", why)
        if missing is None:
            break
        for name in [name for name in sys.modules if name.partition(".")[0] == "torchvision"]:
            del sys.modules[name]
        library = torch.library.Library("torchvision", "FRAGMENT")
        library.define(f"{missing[1]}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        _KEPT.append(library)
    return why
