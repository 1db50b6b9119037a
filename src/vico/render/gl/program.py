"""Shaders as programs that remember what they were told, and the context in which they run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vico.errors import MissingExtraError

_HERE = Path(__file__).parent


class Program:
    """A vertex and a fragment shader, which pull corners out of the scene's buffers.

    Parameters
    ----------
    gl
        The context.
    name
        Of the two files.
    constants
        What shaders share with the processor's renderer, by the names in ``%``.
    """

    def __init__(self, gl: Any, name: str, constants: Mapping[str, object]) -> None:
        fragment = (_HERE / f"{name}.frag").read_text()
        for constant, value in constants.items():
            fragment = fragment.replace(f"%{constant}%", str(value))
        program = gl.program((_HERE / f"{name}.vert").read_text(), fragment)
        self._mode = gl.TRIANGLES
        self._uniforms = {name: program[name] for name in program}
        self._told: dict[str, Any] = {}
        self._corners = gl.vertex_array(program, [])

    def tell(self, values: Mapping[str, Any]) -> None:
        """Set uniforms that are other than before; what the compiler has left out of the shaders is left out."""
        for name, value in values.items():
            if self._told.get(name) != value:
                self._told[name] = value
                if name in self._uniforms:
                    self._uniforms[name].value = value

    def draw(self, triangles: int, instances: int = 1) -> None:
        """Draw some triangles."""
        if triangles > 0:
            self._corners.render(self._mode, vertices=3 * triangles, instances=instances)


def new_context() -> Any:
    """Return a context of OpenGL 4.5, through EGL.

    Raises
    ------
    MissingExtraError
        If moderngl, or a driver, is not there.
    """
    try:
        import moderngl
    except ImportError:
        raise MissingExtraError(
            "the renderer gl needs moderngl: pip install 'virtual-community[gl]', or take the renderer cpu"
        ) from None
    try:
        context = moderngl.create_standalone_context(backend="egl", require=450)
    except Exception as error:  # whatever a driver says
        raise MissingExtraError(
            f"the renderer gl finds no OpenGL 4.5 through EGL ({error}); install a driver (Debian: apt install libegl1 "
            "libgl1-mesa-dri), or take the renderer cpu"
        ) from None
    return context
