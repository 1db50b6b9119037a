"""Reading a small feed-forward network out of an ONNX file, without the ONNX libraries.

An ONNX file is a protocol-buffers message. Only what a chain of dense layers needs is read: the graph's nodes and its
float32 initialisers. Anything else in the graph is refused, so that a network is never evaluated wrongly.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingFileError, SchemaError

# Field numbers of onnx.proto (ModelProto, GraphProto, NodeProto, TensorProto, AttributeProto).
_MODEL_GRAPH = 7
_GRAPH_NODE, _GRAPH_INITIALISER = 1, 5
_NODE_INPUT, _NODE_OUTPUT, _NODE_KIND, _NODE_ATTRIBUTE = 1, 2, 4, 5
_TENSOR_DIMS, _TENSOR_TYPE, _TENSOR_FLOATS, _TENSOR_NAME, _TENSOR_RAW = 1, 2, 4, 8, 9
_ATTRIBUTE_NAME, _ATTRIBUTE_FLOAT, _ATTRIBUTE_INT = 1, 2, 3
_FLOAT32 = 1

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


@dataclass
class _Node:
    kind: str = ""
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    attributes: dict[str, float] = field(default_factory=dict)


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number is longer than 64 bits")


def _fields(data: memoryview) -> Iterator[tuple[int, int, memoryview]]:
    """Field number, integer value (0 if it has none) and payload of every field of a message."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if wire == 0:
            value, at = _varint(data, at)
            yield number, value, data[:0]
            continue
        if wire == 2:
            size, at = _varint(data, at)
        elif wire in (1, 5):
            size = 8 if wire == 1 else 4
        else:
            raise ValueError(f"wire type {wire}")
        if at + size > len(data):
            raise ValueError("a field leaves the file")
        yield number, 0, data[at : at + size]
        at += size


def _text(data: memoryview) -> str:
    return bytes(data).decode()


def _tensor(data: memoryview) -> tuple[str, NDArray[np.float32]]:
    dims: list[int] = []
    name, kind = "", 0
    raw = b""
    for number, value, payload in _fields(data):
        if number == _TENSOR_DIMS:
            if len(payload):  # packed
                at = 0
                while at < len(payload):
                    size, at = _varint(payload, at)
                    dims.append(size)
            else:
                dims.append(value)
        elif number == _TENSOR_TYPE:
            kind = value
        elif number == _TENSOR_NAME:
            name = _text(payload)
        elif number in (_TENSOR_RAW, _TENSOR_FLOATS):
            raw += bytes(payload)
    if kind != _FLOAT32:
        raise ValueError(f"tensor {name} is of type {kind}, not float32")
    return name, np.frombuffer(raw, "<f4").reshape(dims).astype(np.float32)


def _node(data: memoryview) -> _Node:
    node = _Node()
    for number, _, payload in _fields(data):
        if number == _NODE_INPUT:
            node.inputs.append(_text(payload))
        elif number == _NODE_OUTPUT:
            node.outputs.append(_text(payload))
        elif number == _NODE_KIND:
            node.kind = _text(payload)
        elif number == _NODE_ATTRIBUTE:
            name, amount = "", 0.0
            for part, value, inner in _fields(payload):
                if part == _ATTRIBUTE_NAME:
                    name = _text(inner)
                elif part == _ATTRIBUTE_FLOAT:
                    amount = float(np.frombuffer(inner, "<f4")[0])
                elif part == _ATTRIBUTE_INT:
                    amount = float(value)
            node.attributes[name] = amount
    return node


def dense_layers(path: Path) -> list[Layer]:
    """Read a network of dense layers with ELU (alpha 1) between them.

    Returns
    -------
    list
        Weights, float32, shape ``(outputs, inputs)``, and biases, shape ``(outputs,)``, first layer first.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged, or holds anything but such a chain.
    """
    try:
        content = memoryview(path.read_bytes())
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    try:
        graphs = [payload for number, _, payload in _fields(content) if number == _MODEL_GRAPH]
        if len(graphs) != 1:
            raise ValueError(f"{len(graphs)} graphs")
        nodes = [_node(payload) for number, _, payload in _fields(graphs[0]) if number == _GRAPH_NODE]
        tensors = dict(_tensor(payload) for number, _, payload in _fields(graphs[0]) if number == _GRAPH_INITIALISER)
        return _chain(nodes, tensors)
    except (ValueError, IndexError, KeyError, UnicodeDecodeError) as error:
        raise SchemaError(f"{path}: not a network of dense layers ({error}); fetch the package anew") from None


def _chain(nodes: list[_Node], tensors: dict[str, NDArray[np.float32]]) -> list[Layer]:
    layers: list[Layer] = []
    for position, node in enumerate(nodes):
        if position and node.inputs[0] != nodes[position - 1].outputs[0]:
            raise ValueError("its layers do not form one chain")
        if node.kind != ("Elu" if position % 2 else "Gemm"):
            raise ValueError(f"node {position} is {node.kind}")
        if node.kind == "Elu":
            if node.attributes.get("alpha", 1.0) != 1.0:
                raise ValueError("an ELU has another alpha than 1")
            continue
        scaled = node.attributes.get("alpha", 1.0) != 1.0 or node.attributes.get("beta", 1.0) != 1.0
        if scaled or node.attributes.get("transB", 0.0) != 1.0 or node.attributes.get("transA", 0.0):
            raise ValueError("a dense layer is scaled or transposed in another way")
        weights, bias = tensors[node.inputs[1]], tensors[node.inputs[2]]
        if bias.shape != (len(weights),) or (layers and weights.shape[1] != len(layers[-1][1])):
            raise ValueError("the shapes of its layers do not fit")
        layers.append((weights, bias))
    if not layers or len(nodes) % 2 == 0:
        raise ValueError("it does not end with a dense layer")
    return layers
