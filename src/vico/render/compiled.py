"""Compiler options of the renderer's kernels: cached, without the interpreter's lock, with C's rules for division.

An `inlined` function costs nothing where it is called: the compiler puts its body there. Rules that one loop applies to
every pixel, triangle or instance are such functions.
"""

from __future__ import annotations

from typing import Any

from vico.io.compiled import compiled

# Optimised alone before it is linked: drawing is a fifth slower without.
kernel: Any = compiled(nogil=True, error_model="numpy", optimised_alone=True)
inlined: Any = compiled(nogil=True, error_model="numpy", forceinline=True, optimised_alone=True)
