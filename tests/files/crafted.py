"""Files made by hand that random damage hardly reaches: lying headers, encodings, outlines without an inside.

Each way takes a whole file of a kind and a generator, and puts what it makes at a random place of it.
"""

from __future__ import annotations

import io
import json
import os
import random
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.files.mutators import to_json

Way = Callable[[bytes, random.Random], bytes]

COORDINATES = (
    "NaN", "Infinity", "-Infinity", "1e308", "-1e308", "1e999", "1e-320", "null", '"1"', "[]", "{}",
    "true", "9" * 400, "-0", "0.1e1", "[1, 2]", '"2020-01-01"', "1E+2", "12345678901234567890",
)  # fmt: skip
RINGS: tuple[list[list[float]], ...] = (
    [], [[1, 1]], [[1, 1], [1, 1]], [[1, 1]] * 5, [[0, 0], [5, 0], [9, 0], [0, 0]],
    [[0, 0], [0, 0], [5, 5], [0, 0]], [[0, 0], [9, 9], [9, 0], [0, 9], [0, 0]],
    [[0, 0], [4, 0], [4, 4], [2, 0], [0, 4], [0, 0]],
    [[0, 0], [9, 0], [9, 9], [0, 9], [0, 0], [9, 0], [9, 9], [0, 9], [0, 0]],
    [[1e308, 0], [-1e308, 0], [0, 1e308]], [[0, 0], [1e-300, 0], [1e-300, 1e-300], [0, 1e-300]],
    [[0, 0], [1e9, 0], [1e9, 1e-9], [0, 1e-9]], [[0, 0, 7], [5, 0, 7], [5, 5, 7]], [[0], [1], [2]],
    [[k % 7, k % 5] for k in range(999)],
    [[0, 0], [3, 0], [3, 3], [0, 3], [0, 1], [2, 1], [2, 2], [0, 2]],
)  # fmt: skip
DATES = ("2020-01-01", "2020-01-01T10:00:00Z", "10:00:00", "1979-05-27 07:32:00")
YAML_VALUES = (
    "!!binary aGVsbG8=", "!!set {a, b}", "!!timestamp 2020-01-01", "2020-01-01", "190:20:30", "0o17",
    "0b1", "0x1F", ".inf", "-.INF", ".nan", "~", "yes", "!!float 1", "!!int 0x10", "!!str 5",
    "!!omap [a: 1]", "|\n  text\n", ">-\n  folded\n", "*nowhere", "&a [*a]", "<<: {a: 1}", "!local 3",
    "? [a, b]\n: c", "1e3", "1_000", "\"\\uD800\"", "'", "@x", "%x",
)  # fmt: skip
XML_VALUES = (
    "NaN",
    "INF",
    "1e308",
    "-1e308",
    "",
    " ",
    "1,5",
    "0x10",
    "١٢",
    "9" * 400,
    "1e-320",
    "&#x0;",
    "&lt;",
    "\u2028",
)
XML_PARTS = (
    '<!DOCTYPE a SYSTEM "file:///etc/passwd">', "<![CDATA[ <a> ]]>",
    "<?x y?>", "<!-- -- -->", "<a" + " a='1'" * 2 + "/>", "<a:b/>", "<a>" * 400 + "</a>" * 400,
    "<x>" + "y" * 100_000 + "</x>", "&undefined;",
)  # fmt: skip


def anywhere(pattern: bytes, data: bytes, new: bytes, rng: random.Random) -> bytes:
    """Data with one of the places that a pattern fits replaced; those of a group, where it has one."""
    match = rng.choice(list(re.finditer(pattern, data)))
    begin, end = match.span(1 if match.re.groups else 0)
    return data[:begin] + new + data[end:]


def json_number(data: bytes, rng: random.Random) -> bytes:
    return anywhere(rb"(?<=[\s:,\[])-?\d[\d.eE+-]*", data, rng.choice(COORDINATES).encode(), rng)


def json_ring(data: bytes, rng: random.Random) -> bytes:
    ring = to_json(rng.choice(RINGS)).encode()
    return anywhere(rb"\[(?:\s*\[[^\[\]]*\]\s*,?)+\s*\]", data, ring, rng)


def json_duplicate(data: bytes, rng: random.Random) -> bytes:
    """A key twice, with another value first."""
    match = rng.choice(list(re.finditer(rb'"[^"\\]+"\s*:', data)))
    value = rng.choice((b"1", b"null", b"[]", b'"x"', b"{}"))
    return data[: match.start()] + match[0] + value + b"," + data[match.start() :]


def json_nested(data: bytes, rng: random.Random) -> bytes:
    depth = rng.choice((30, 49, 51, 900, 50_000))
    return anywhere(rb"(?<=[\s:,\[])-?\d[\d.eE+-]*", data, b"[" * depth + b"1" + b"]" * depth, rng)


def json_key(data: bytes, rng: random.Random) -> bytes:
    key = json.dumps(
        rng.choice(("", "\0", "\ud800", "__class__", "a" * 70_000, "\u202e", "id", "type", "geometry"))
    )
    return anywhere(rb'"[^"\\]+"(?=\s*:)', data, key.encode(), rng)


def toml_date(data: bytes, rng: random.Random) -> bytes:
    return anywhere(rb"= *([^\n]+)", data, rng.choice(DATES).encode(), rng)


def toml_twice(data: bytes, rng: random.Random) -> bytes:
    """A line or a table twice, dotted keys and arrays of tables where none belong."""
    line = rng.choice(data.split(b"\n"))
    other = rng.choice(
        (line, b"[[" + line.strip(b"[]") + b"]]", b"a.b.c = 1", b"[a]\n[a.b]\n[a]", b'"" = 1', b"'a\n'=1")
    )
    return anywhere(rb"\n", data, b"\n" + other + b"\n", rng)


def yaml_value(data: bytes, rng: random.Random) -> bytes:
    return anywhere(rb": *([^\n]+)", data, rng.choice(YAML_VALUES).encode(errors="surrogatepass"), rng)


def yaml_document(data: bytes, rng: random.Random) -> bytes:
    """More than one document, tabs, keys twice, keys of other kinds."""
    more = (
        b"\n---\n",
        b"\n...\n",
        b"\n\tx: 1\n",
        b"\n? {a: 1}\n: 2\n",
        b"\n1: 2\n",
        b"\nnull: 3\n",
        b"\n- x\n",
        b"%YAML 9.9\n",
    )
    return anywhere(rb"\n", data, rng.choice(more), rng) if rng.random() < 0.7 else data + data


def xml_value(data: bytes, rng: random.Random) -> bytes:
    value = rng.choice(XML_VALUES).encode()
    return anywhere(
        rb'"([^"<>]*)"' if b'="' in data and rng.random() < 0.6 else rb">([^<>]+)<", data, value, rng
    )


def xml_part(data: bytes, rng: random.Random) -> bytes:
    return anywhere(rb"<(?=[a-zA-Z])", data, rng.choice(XML_PARTS).encode() + b"<", rng)


def csv_wide(data: bytes, rng: random.Random) -> bytes:
    """A line of 100 000 columns, a field of a megabyte, quotes that never end, zero bytes."""
    lines = data.split(b"\n")
    more = (
        b"," * 100_000,
        b"x" * 1_000_000,
        b'"',
        b'"a\nb",',
        b"\0",
        b"\r",
        b",,,",
        b'""""',
        b"=1+1",
        b";",
        b"\t",
        b"1e999,",
    )
    k = rng.randrange(len(lines))
    lines[k] = rng.choice((lines[k] + rng.choice(more), rng.choice(more) + lines[k], rng.choice(more)))
    return b"\n".join(lines)


def npz_zip(data: bytes, rng: random.Random) -> bytes:
    """Entries twice, with other names, stored or packed in another way; sizes that lie."""
    out, way = io.BytesIO(), rng.randrange(4)
    with zipfile.ZipFile(io.BytesIO(data)) as old:
        names = old.namelist()
        methods = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
        with warnings.catch_warnings(), zipfile.ZipFile(out, "w", rng.choice(methods)) as new:
            warnings.simplefilter("ignore")  # a name that stands twice
            chosen = rng.choice(names)
            for name in names:
                other = rng.choice(
                    ("../x.npy", "/x.npy", "x" * 60_000, "", "x/", "ä.npy", name.upper(), "x.txt", "a\0b.npy")
                )
                new.writestr(other if way == 0 and name == chosen else name, old.read(name))
                if way == 1 and name == chosen:
                    new.writestr(zipfile.ZipInfo(name), old.read(rng.choice(names)))
    made = bytearray(out.getvalue())
    if way >= 2:  # a field of a header of an entry, or of the directory, or of its end
        places = [m.start() for m in re.finditer(rb"PK\x01\x02|PK\x03\x04|PK\x05\x06", bytes(made))]
        place = rng.choice(places) + rng.choice((4, 6, 8, 10, 14, 16, 18, 20, 22, 24, 26, 28, 42))
        value = rng.choice((0, 1, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 99, 9))
        made[place : place + 4] = struct.pack("<I", value)[: rng.choice((2, 4))]
    return bytes(made)


def npz_header(data: bytes, rng: random.Random) -> bytes:
    """The header of an array: another version, length, order, a text that is no table."""
    headers = (
        "{'descr': '<f8', 'fortran_order': True, 'shape': (3, 4), }",
        "{'descr': '<f8', 'shape': (3,), }", "[]", "1", "",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (10**9, 10**9), }", "__import__('os')",
        "{" * 3000, "(" * 99, "{'descr': '<i8', 'fortran_order': 0, 'shape': (2147483648, 0, 4), }",
        "{'descr': 'O', 'fortran_order': False, 'shape': ()}",
        "{'descr': [('a', '<f8', (9999999, 9999999))], 'fortran_order': False, 'shape': (1,)}",
        "x" * 60_000, "{'descr': '<U0', 'fortran_order': False, 'shape': (99999999999,), }",
        "{'descr': '>f8', 'fortran_order': False, 'shape': (1,)}",
    )  # fmt: skip
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        chosen = rng.choice(old.namelist())
        for name in old.namelist():
            content = old.read(name)
            if name == chosen:
                text = rng.choice(headers).encode() + b"\n"
                length = rng.choice((len(text), len(text), 0, 0xFFFF)) & 0xFFFF
                version = rng.choice(((1, 0), (1, 0), (2, 0), (3, 0), (9, 9)))
                size = struct.pack("<H" if version[0] == 1 else "<I", length)
                content = b"\x93NUMPY" + bytes(version) + size + text + content[128:]
            new.writestr(name, content)
    return out.getvalue()


def tensor_header(data: bytes, rng: random.Random) -> bytes:
    """A table of tensors that lie over each other, outside of the file, of unknown types or shapes."""
    size = int.from_bytes(data[:8], "little")
    header: dict[str, Any] = json.loads(data[8 : 8 + size])
    entry = header[rng.choice([name for name in header if name != "__metadata__"])]
    way = rng.randrange(6)
    if way == 0:
        entry["data_offsets"] = rng.choice(
            ([0, 10**18], [-1, 4], [8, 4], [0], "x", [0, 0], [1.5, 2], [0, None])
        )
    elif way == 1:
        entry["shape"] = rng.choice(([10**10, 10**10], [-1], [], "x", [0], [1] * 99, [1.0], [2**64], [None]))
    elif way == 2:
        entry["dtype"] = rng.choice(("F128", "BF16", "F8_E4M3", "BOOL", "", 5, None, "I64", "U8"))
    elif way == 3:
        header["__metadata__"] = rng.choice(
            ({"a": 1}, [], None, {"": ""}, {"card": "x" * 99_999}, {"a": {"b": "c"}})
        )
    text = to_json(header).encode()
    if way == 4:
        text = text[:-1] + b',"a":{"dtype":"F32","shape":[0],"data_offsets":[0,0]},"a":{"dtype":"F32"}}'
    length = rng.choice((0, 1, 10**8, 2**63, 2**64 - 1, len(text) + 1)) if way == 5 else len(text)
    return struct.pack("<Q", length) + text + data[8 + size :]


def png_chunk(data: bytes, rng: random.Random) -> bytes:
    """Chunks that unpack to much, lie about their length, stand twice or in the wrong order."""
    body = rng.choice(
        (b"", b"x" * 70_000, b"a\0\0" + zlib.compress(b"\0" * 9_000_000), b"\xff" * 9, b"\0" * 26)
    )
    name = rng.choice(
        (
            b"IDAT",
            b"IHDR",
            b"PLTE",
            b"tRNS",
            b"iCCP",
            b"zTXt",
            b"iTXt",
            b"acTL",
            b"gAMA",
            b"eXIf",
            b"IEND",
            b"xxxx",
        )
    )
    size = rng.choice((len(body), len(body), 0, 2**31 - 1, 2**32 - 1))
    chunk = struct.pack(">I", size) + name + body + struct.pack(">I", zlib.crc32(name + body))
    starts = [m.start() - 4 for m in re.finditer(rb"IHDR|IDAT|IEND|PLTE", data)]
    return data[: (k := max(rng.choice(starts), 8))] + chunk * rng.choice((1, 1, 2, 300)) + data[k:]


def pgm_header(data: bytes, rng: random.Random) -> bytes:
    body = data[15:]
    kind = rng.choice((b"P5", b"P2", b"P1", b"P4", b"P3", b"P6", b"P7", b"Pf", b"PF"))
    side = [
        rng.choice((b"0", b"1", b"40", b"50", b"-5", b"99999999", b"4294967297", b"1e3", b"9" * 400, b""))
        for _ in range(2)
    ]
    most = rng.choice((b"255", b"0", b"65535", b"65536", b"-1", b"1", b"999999999999"))
    comment = rng.choice((b"\n", b"\n#" + b"x" * 100_000 + b"\n", b"\n#" * 50_000, b" ", b"\t\v", b"\r\n"))
    return kind + comment + side[0] + b" " + side[1] + b"\n" + most + b"\n" + body


WAYS: dict[str, tuple[Way, ...]] = {
    "json": (json_number, json_number, json_ring, json_duplicate, json_nested, json_key),
    "toml": (toml_date, toml_twice),
    "yaml": (yaml_value, yaml_value, yaml_document),
    "xml": (xml_value, xml_value, xml_part),
    "csv": (csv_wide,),
    "npz": (npz_zip, npz_zip, npz_header),
    "safetensors": (tensor_header,),
    "png": (png_chunk,),
    "pgm": (pgm_header,),
}
CODES: tuple[Way, ...] = (
    lambda data, rng: b"\xef\xbb\xbf" + data,
    lambda data, rng: data.replace(b"\n", b"\r\n"),
    lambda data, rng: data.replace(b"\n", b"\r"),
    lambda data, rng: data.decode("latin-1").encode(
        rng.choice(("utf-16", "utf-16-le", "utf-32", "utf-7", "cp037"))
    ),
    lambda data, rng: b"",
    lambda data, rng: (
        rng.choice((b" ", b"\n", b"\t\r\n", b"\0", b"\x0c", b"\xa0")) * rng.choice((1, 9, 90_000))
    ),
    lambda data, rng: data + b"\0" * rng.choice((1, 90_000)),
    lambda data, rng: data * 2,
    lambda data, rng: b"\x1f\x8b\x08" + data,
    lambda data, rng: rng.choice(
        (b"PK\x05\x06" + b"\0" * 18, b"%PDF-1.4", b"GIF89a", b"\x89PNG\r\n\x1a\n", b"\x93NUMPY", b"<svg/>")
    ),
)


READ_BY_TESTS = ("specs.txt", "hints.txt")
"""Files that stand for what is typed: no reader of the package opens them."""


def craft(path: Path, kind: str, rng: random.Random) -> str:
    """Make one of these files of a whole one, or put something else in its place; says which."""
    place = rng.random()
    if place < 0.08 and path.name not in READ_BY_TESTS:
        return _put_special(path, rng)
    way = rng.choice(CODES) if place < 0.25 else rng.choice(WAYS[kind])
    data = path.read_bytes()
    for _ in range(rng.choice((1, 1, 2))):
        try:
            data = way(data, rng)
        except Exception:  # what was made before has no such place any more
            break
    path.write_bytes(data[: 1 << 24])
    return getattr(way, "__name__", "")


def _put_special(path: Path, rng: random.Random) -> str:
    """A folder, a pipe, a link to itself, to nowhere, to a device or to a folder."""
    path.unlink()
    way = rng.choice(("folder", "pipe", "loop", "nowhere", "/dev/zero", "/dev/null", ".", "/proc/self/mem"))
    if way == "folder":
        path.mkdir()
    elif way == "pipe":
        os.mkfifo(path)
    elif way == "loop":
        path.symlink_to(path.name)
    elif way == "nowhere":
        path.symlink_to("nowhere\n\udc80")
    else:
        path.symlink_to(way)
    return way
