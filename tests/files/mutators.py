"""Damaged files: bytes that flip, texts with hostile values, trees and archives with wrong parts."""

from __future__ import annotations

import io
import json
import random
import re
import struct
import tomllib
import zipfile
import zlib
from typing import Any

import cv2
import numpy as np
import safetensors.numpy
import yaml

from layoutexplore.files.archives import CHECKSUM, checksum


def deep(levels: int) -> Any:
    value: Any = 1
    for k in range(levels):
        value = [value] if k % 2 else {"a": value}
    return value


HOSTILE: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 5, 2**31, -(2**31), 2**32, 2**63, 2**64, 10**400, 10**4999, 0.1, -0.0,
    1e-320, 1e300, 1e308, float("nan"), float("inf"), float("-inf"), "", "x", "\ud800", "a\0b", "../../x",
    "/any/x", "x" * 5000, "\n", "1e5", "nan", [], {}, [[]], [None], {"": 0}, {"a": 5}, [1, 2, 3], ["x"] * 9,
    [[0, 0], [1, 0], [1, 1]], [float("nan")] * 4, [0.5] * 2, list(range(300)),
    {"type": "Polygon", "coordinates": [[[0, 0], [9, 9], [9, 0], [0, 9]]]},
)  # fmt: skip
"""Values that readers must take or refuse."""

NUMBERS = (
    b"0", b"-1", b"1e400", b"-1e400", b"nan", b"inf", b"-inf", b"1" * 400, b"1" * 5000, b"0x" + b"f" * 5000,
    b"1e-400", b"2147483648", b"9223372036854775808", b"true", b"''", b"[]", b"0.0000001", b"99999999",
    b"1_000", b".5",
)  # fmt: skip

BOMBS = {
    "json": (b"[" * 100_000, b'{"a":' * 60_000, b"[1" + b"0" * 5000 + b"]", b"[" + b"[]," * 300_000 + b"1]"),
    "toml": (
        b"a=" + b"[" * 5000,
        b"a=" + b"{a=" * 3000,
        b".".join([b"a"] * 20_000) + b"=1",
        b"[" + b".".join([b"a"] * 5000) + b"]",
        b"a=0x" + b"f" * 5000,
        b"a=" + b"9" * 5000,
    ),
    "yaml": (
        b"a: &a [x,x,x,x,x,x,x,x,x]\n"
        + b"".join(
            b"%c: &%c [%s]\n" % (98 + k, 98 + k, b",".join([b"*%c" % (97 + k)] * 9)) for k in range(9)
        ),
        b"[" * 5000,
        b"{a: " * 3000,
        b"image: !!python/object/apply:os.system [ls]",
        b"a: &a\n  - *a",
        b"a: 2020-99-99",
        b"resolution: " + b":".join([b"59"] * 500),
    ),
    "xml": (
        b"<a>" * 100_000,
        b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]><a>&b;</a>',
        b'<?xml version="1.0" encoding="martian"?><a/>',
        b'<?xml version="1.0" encoding="utf-7"?><a/>',
        "<building/>".encode("utf-16"),
    ),
}


def mutate(data: bytes, kind: str, rng: random.Random) -> bytes:
    """A damaged copy: by its structure where that can be, otherwise byte by byte."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        ways = WAYS.get(kind, ())
        try:
            data = (
                rng.choice(ways)(data, rng) if ways and rng.random() < 0.65 else rng.choice(BYTES)(data, rng)
            )
        except Exception:  # what was damaged before has no structure any more
            data = rng.choice(BYTES)(data, rng)
        data = data[: 1 << 24]  # a line of a megabyte, repeated, would fill the memory
    return data


def flip(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data or b"\0")
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def splice(data: bytes, rng: random.Random) -> bytes:
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    place = rng.randrange(len(data) + 1)
    return data[:place] + data[a : min(b, a + 4000)] + data[place:]


def drop(data: bytes, rng: random.Random) -> bytes:
    a = rng.randrange(len(data) + 1)
    return data[:a] + data[a + rng.choice((1, 4, 50, 1000)) :]


def insert(data: bytes, rng: random.Random) -> bytes:
    place = rng.randrange(len(data) + 1)
    return data[:place] + rng.randbytes(rng.choice((1, 2, 8, 100))) + data[place:]


BYTES = (flip, flip, cut, splice, drop, insert)


def number(data: bytes, rng: random.Random) -> bytes:
    """Replace a number of a text."""
    found = list(re.finditer(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?", data))
    match = rng.choice(found)
    return data[: match.start()] + rng.choice(NUMBERS) + data[match.end() :]


def word(data: bytes, rng: random.Random) -> bytes:
    """Replace a word of a text by another of its words, or by a hostile one."""
    found = list(re.finditer(rb"[A-Za-z_]{2,}", data))
    match, other = rng.choice(found), rng.choice(found)[0]
    hostile = rng.choice((other, other, b"", b"x" * 3000, b"\\ud800", b"\xff\xfe", b"\0", b"/any/x", b"../x"))
    return data[: match.start()] + hostile + data[match.end() :]


def line(data: bytes, rng: random.Random) -> bytes:
    """Swap, repeat or drop a line."""
    lines = data.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    way = rng.randrange(3)
    if way == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif way == 1:
        lines[a:a] = [lines[b]] * rng.choice((1, 3, 400))
    else:
        del lines[a]
    return b"\n".join(lines)


def change_tree(data: Any, rng: random.Random) -> Any:
    """Replace, remove, repeat or swap a part of nested lists and tables."""
    places: list[tuple[Any, Any]] = []
    waiting = [data]
    while waiting:
        node = waiting.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
        for key in keys:
            places.append((node, key))
            waiting.append(node[key])
    if not places or rng.random() < 0.02:
        return rng.choice((*HOSTILE, deep(500), deep(5000)))
    (node, key), (other, place) = rng.choice(places), rng.choice(places)
    way = rng.random()
    if way < 0.6:
        node[key] = rng.choice(HOSTILE) if rng.random() < 0.95 else deep(rng.choice((60, 900, 5000)))
    elif way < 0.75:
        node[key] = other[place]
    elif way < 0.9:
        del node[key]
    elif isinstance(node, dict):
        node[str(rng.choice((place, "x", "__proto__")))] = node.pop(key)
    else:
        node.extend([node[key]] * rng.choice((1, 2, 200)))
    return data


def json_tree(data: bytes, rng: random.Random) -> bytes:
    return to_json(change_tree(json.loads(data), rng)).encode(errors="surrogatepass")


def to_json(value: Any) -> str:
    """As JSON, whatever it is: numbers of any length, any depth."""
    if isinstance(value, int) and abs(value) > 10**4000:
        return "1" + "0" * 5000
    try:
        return json.dumps(value)
    except (ValueError, RecursionError):
        return '{"a": [' * 2000 + "]}" * 2000 if not isinstance(value, dict) else to_parts(value)


def to_parts(value: dict[str, Any]) -> str:
    return "{" + ", ".join(f"{json.dumps(str(k))}: {to_json(v)}" for k, v in value.items()) + "}"


def toml_tree(data: bytes, rng: random.Random) -> bytes:
    if data.count(b".") > 3000:
        raise ValueError("a bomb: reading it takes gigabytes")
    table = change_tree(tomllib.loads(data.decode()), rng)
    return "\n".join(toml_lines(table, "")).encode(errors="surrogatepass")


def toml_lines(table: dict[str, Any], path: str) -> list[str]:
    lines, tables = [], []
    for key, value in table.items():
        name = json.dumps(str(key))
        if isinstance(value, dict):
            where = f"{path}.{name}" if path else name
            tables += [f"[{where}]", *toml_lines(value, where)]
        else:
            lines.append(f"{name} = {toml_value(value)}")
    return lines + tables


def toml_value(value: Any) -> str:
    if value is None:
        return '""'
    if isinstance(value, float) and not abs(value) < 1e400:
        return str(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(str(k))} = {toml_value(v)}" for k, v in value.items()) + "}"
    return to_json(value)


def yaml_tree(data: bytes, rng: random.Random) -> bytes:
    return yaml.safe_dump(change_tree(yaml.safe_load(data), rng)).encode(errors="surrogatepass")


def xml_part(data: bytes, rng: random.Random) -> bytes:
    """Replace an attribute or a text, or repeat, nest or drop an element."""
    way = rng.randrange(4)
    if way == 0:
        match = rng.choice(list(re.finditer(rb'"[^"]*"|\'[^\']*\'', data)))
        return (
            data[: match.start()] + b'"' + rng.choice(NUMBERS).replace(b'"', b"") + b'"' + data[match.end() :]
        )
    if way == 1:
        match = rng.choice(list(re.finditer(rb">[^<>]+<", data)))
        return data[: match.start()] + b">" + rng.choice(NUMBERS) + b"<" + data[match.end() :]
    match = rng.choice(list(re.finditer(rb"<(\w+)[^<>]*/>|<(\w+)[^<>/]*>[^<>]*</\2>", data)))
    again = b"" if way == 2 else match[0] * rng.choice((2, 3, 500))
    return data[: match.start()] + again + data[match.end() :]


def hostile_array(values: Any, rng: random.Random) -> Any:
    """Another type, shape or value."""
    way = rng.randrange(8)
    if values.dtype.kind == "U" and values.ndim == 0 and str(values).startswith("{"):
        inside = rng.choice(WAYS["json"])(str(values).encode(), rng)
        return np.array(inside.decode(errors="replace"))
    if way == 0:
        return values.astype(
            rng.choice((np.float64, np.float32, np.int64, np.uint8, np.bool_, np.complex128, "U5"))
        )
    if way == 1:
        return values.reshape(-1)
    if way == 2:
        return values[: rng.randrange(len(values) + 1)] if values.ndim else values.reshape(1)
    if way == 3:
        return np.zeros(rng.choice(((), (0,), (0, 0), (1,), (3, 3), (2, 0, 5), (70_000,))), values.dtype)
    if way == 4:
        return np.concatenate([values, values]) if values.ndim else np.stack([values, values])
    if way == 5:
        return values.T
    out = np.array(values)
    if out.size and out.dtype.kind in "iuf":
        wanted: tuple[float, ...] = (-1, 0, 100, 127, 2**31 - 1, 2**40, -(2**40))
        if out.dtype.kind == "f":
            wanted = (float("nan"), float("inf"), -1, 1e30, 2**31, -(2**40), 1e300)
        info = np.iinfo(out.dtype) if out.dtype.kind != "f" else None
        value = rng.choice(wanted)
        with np.errstate(over="ignore"):
            out.flat[rng.randrange(out.size)] = min(max(value, info.min), info.max) if info else value
    return out


def npz_arrays(data: bytes, rng: random.Random) -> bytes:
    with np.load(io.BytesIO(data)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    name = rng.choice([name for name in arrays if name != CHECKSUM])
    way = rng.random()
    if way < 0.7:
        arrays[name] = hostile_array(arrays[name], rng)
    elif way < 0.8:
        del arrays[name]
    elif way < 0.9:
        arrays[rng.choice(list(arrays))] = arrays[name]
    else:
        arrays[name + rng.choice(("0", "x", "\ud800"[:0]))] = arrays.pop(name)
    if rng.random() < 0.5:
        arrays[CHECKSUM] = np.array(checksum(arrays))
    elif rng.random() < 0.5:
        arrays.pop(CHECKSUM, None)
    out = io.BytesIO()
    (np.savez if rng.random() < 0.3 else np.savez_compressed)(out, **arrays)
    return out.getvalue()


SHAPES = (
    b"(9999999999,)", b"(-1, 3)", b"(1e9,)", b"()", b"(True,)", b"(" * 20, b"(0, 2)",
    b"(0, 4611686018427387904)",
)  # fmt: skip
TYPES = (b"'|O'", b"'<U99999999'", b"'<f8'", b"'<c16'", b"[('a', '<f8')]", b"'V8'", b"'<M8[s]'")


def npz_header(data: bytes, rng: random.Random) -> bytes:
    """An array of another declared shape or type, its archive whole."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        chosen = rng.choice(old.namelist())
        for name in old.namelist():
            content = old.read(name)
            head, body = content[:128], content[128:]
            if name == chosen and rng.random() < 0.6:
                begin, end = head.index(b"("), head.index(b")") + 1
                head = head[:begin] + rng.choice(SHAPES) + head[end:]
            elif name == chosen:
                begin, end = head.index(b"'descr': ") + 9, head.index(b", 'fortran")
                head = head[:begin] + rng.choice(TYPES) + head[end:]
            new.writestr(name, head.rstrip().ljust(127)[:127] + b"\n" + body)
    return out.getvalue()


def tensors(data: bytes, rng: random.Random) -> bytes:
    size = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + size])
    arrays = safetensors.numpy.load(data)
    metadata = dict(header.get("__metadata__", {}))
    way = rng.random()
    if way < 0.35:
        name = rng.choice(list(arrays))
        arrays[name] = np.ascontiguousarray(hostile_array(arrays[name], rng))
    elif way < 0.75 and metadata:
        key = rng.choice(list(metadata))
        inside = metadata[key].encode()
        kind = "json" if inside.lstrip().startswith(b"{") else "toml"
        text = rng.choice(WAYS[kind])(inside, rng) if rng.random() < 0.8 else rng.choice(BOMBS[kind])
        metadata[key] = text.decode(errors="replace")
    else:
        text = to_json(change_tree(header, rng)).encode(errors="surrogatepass")
        return struct.pack("<Q", len(text)) + text + data[8 + size :]
    return safetensors.numpy.save(arrays, metadata)


def png_chunks(data: bytes, rng: random.Random) -> bytes:
    """Another header, with the right checksum."""
    header = bytearray(data[12:29])
    way = rng.randrange(4)
    if way == 0:
        struct.pack_into(">II", header, 4, *rng.choices((0, 1, 7, 4000, 20_000, 2**31 - 1, 2**32 - 1), k=2))
    elif way == 1:
        header[12] = rng.choice((1, 2, 4, 8, 16, 99))
    elif way == 2:
        header[13] = rng.choice((0, 2, 3, 4, 6, 9))
    else:
        header[16] = rng.choice((0, 1, 2))
    return data[:12] + bytes(header) + struct.pack(">I", zlib.crc32(header)) + data[33:]


def picture(data: bytes, rng: random.Random) -> bytes:
    """Another picture: noise, stripes, a checkerboard, colours, with and without transparency."""
    seed = np.random.default_rng(rng.randrange(2**32))
    rows, cols = (rng.choice((1, 2, 3, 40, 200, 700)) for _ in range(2))
    shape = (rows, cols, rng.choice((1, 1, 3, 4)))
    way = rng.randrange(4)
    pixels = seed.integers(0, 256, shape, np.uint8)
    if way == 1:
        pixels = np.where((np.indices(shape)[:2].sum(0) % 2 == 0), 255, 0).astype(np.uint8)
    elif way == 2:
        pixels[...] = seed.integers(0, 256)
    elif way == 3:
        pixels = np.kron(seed.integers(0, 256, (5, 7)), np.ones((rows, cols))).astype(np.uint8)[
            :900, :900, None
        ]
    deep_pixels = pixels.astype(np.uint16) * 257 if rng.random() < 0.2 else pixels
    endings = (".png", ".png", ".tif") if deep_pixels.dtype == np.uint16 else (".png", ".bmp", ".tif", ".jpg")
    ending = rng.choice((*endings, ".pgm") if deep_pixels.shape[2] == 1 else endings)
    return cv2.imencode(ending, deep_pixels)[1].tobytes()


def bomb(kind: str) -> Any:
    return lambda data, rng: rng.choice(BOMBS[kind])


WAYS: dict[str, tuple[Any, ...]] = {
    "json": (json_tree, json_tree, json_tree, number, word, line),
    "toml": (toml_tree, toml_tree, toml_tree, number, word, line),
    "yaml": (yaml_tree, yaml_tree, number, word, line),
    "xml": (xml_part, xml_part, xml_part, number, word),
    "csv": (number, number, word, line),
    "npz": (npz_arrays, npz_arrays, npz_arrays, npz_header),
    "safetensors": (tensors, tensors, tensors),
    "png": (png_chunks, picture, picture),
    "pgm": (number, picture, picture),
}
"""Structure-aware damages by kind; a bomb is one of a hundred."""

for _kind in BOMBS:
    WAYS[_kind] = WAYS[_kind] * 8 + (bomb(_kind),)
