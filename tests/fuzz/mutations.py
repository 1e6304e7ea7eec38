"""Damage to valid files: to their bytes, and to what a format's parts mean, so that parsers are entered, not only met.

Every mutator takes the valid bytes and a generator and gives other bytes. Names that a file may carry come from
`HOSTILE_NAMES`; numbers from `ODD_NUMBERS`.
"""

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Generator = np.random.Generator
Mutator = Callable[[bytes, Generator], bytes]

DECOY = "secret.txt"
"""A file beside the folder of a case: whoever opens it was led out of that folder by a name."""
HOSTILE_NAMES = (
    "two words", "it's", 'say "hi"', "!rm -rf x", "# comment", "two\nlines", "a\r\n!id", "😀 лампа", "x" * 10_000,
    f"../{DECOY}", f"a/../../{DECOY}", f"..\\{DECOY}", f"%2e%2e/{DECOY}", "/etc/passwd", "file:///etc/passwd",
    "http://example.invalid/a.png", "C:\\Windows\\win.ini", "\\\\host\\share\\a", "nul\0byte", "CON", "nul.png", "COM1",
    "aux.mtl", "-rf", "$(id)", "`id`", "~root", ".", "..", "", " ", "\x1b[2J", "\u202eabc", "a;b,c", "{}", "%s%n",
)  # fmt: skip
ODD_NUMBERS = (
    "nan", "inf", "-inf", "-1", "0", "-0.0", "1e308", "1e999", "-1e999", "1e-400", "99999999999999999999",
    "2147483648", "4294967295", "-2147483649", "0x10", "1_000", "١٢", "", "1,5", "true", "null", "1e", "--1", "1" * 400,
)  # fmt: skip
ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 255, 65536, 2**31, 2**32 - 1, 2**63, 10**30, -(2**53), 0.5, -1e308, 1e308, "", "0", [],
    {}, [[]], [None], [0] * 17, "NaN", "\ud800.png", [1e300, 1e300, 1e300],
)  # fmt: skip
_TOKEN = re.compile(rb"[^\s,;:|=\[\](){}<>\"']+")
_NUMBER = re.compile(rb"[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?")


def one_of(options: Sequence[Any], rng: Generator) -> Any:
    """An element by lot."""
    return options[int(rng.integers(len(options)))]


def any_of(*mutators: Mutator) -> Mutator:
    """One of several mutators by lot, and one time in five another after it."""

    def mutate(data: bytes, rng: Generator) -> bytes:
        data = one_of(mutators, rng)(data, rng)
        return mutate(data, rng) if rng.random() < 0.2 else data

    return mutate


# --- bytes


def cut_bytes(data: bytes, rng: Generator) -> bytes:
    """Cut off at the end."""
    return data[: int(rng.integers(len(data) + 1))]


def change_bytes(data: bytes, rng: Generator) -> bytes:
    """Overwrite some bytes, singly or four at a time with a number at an edge of its range."""
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 9))):
        if not changed:
            break
        place = int(rng.integers(len(changed)))
        if rng.random() < 0.5:
            changed[place] = int(rng.integers(256))
        else:
            edge = one_of((0, 1, 0x7F, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7F800000, 0x7FC00000), rng)
            changed[place // 4 * 4 : place // 4 * 4 + 4] = struct.pack("<I", edge)
    return bytes(changed)


def lose_bytes(data: bytes, rng: Generator) -> bytes:
    """Lose a piece."""
    start = int(rng.integers(len(data) + 1))
    return data[:start] + data[start + int(rng.integers(1, 64)) :]


def double_bytes(data: bytes, rng: Generator) -> bytes:
    """Have a piece many times."""
    start = int(rng.integers(len(data) + 1))
    piece = data[start : start + int(rng.integers(1, 64))]
    return data[:start] + piece * int(one_of((2, 3, 1000), rng)) + data[start + len(piece) :]


def random_bytes(data: bytes, rng: Generator) -> bytes:
    """Keep the first bytes only; noise follows."""
    return data[: int(one_of((0, 4, 16), rng))] + rng.bytes(int(rng.integers(0, 300)))


raw = any_of(cut_bytes, change_bytes, change_bytes, lose_bytes, double_bytes, random_bytes)

# --- text


def change_number(data: bytes, rng: Generator) -> bytes:
    """Put an odd number in a number's place."""
    found = list(_NUMBER.finditer(data))
    if not found:
        return change_bytes(data, rng)
    match = one_of(found, rng)
    return data[: match.start()] + str(one_of(ODD_NUMBERS, rng)).encode() + data[match.end() :]


def change_word(data: bytes, rng: Generator) -> bytes:
    """Put a hostile name, or another of the file's own words, in a word's place."""
    found = list(_TOKEN.finditer(data))
    if not found:
        return change_bytes(data, rng)
    match = one_of(found, rng)
    other = one_of(found, rng).group() if rng.random() < 0.4 else str(one_of(HOSTILE_NAMES, rng)).encode()
    return data[: match.start()] + other + data[match.end() :]


def change_lines(data: bytes, rng: Generator) -> bytes:
    """Lose a line, have it twice, or change its place."""
    lines = data.split(b"\n")
    line = lines.pop(int(rng.integers(len(lines))))
    for _ in range(int(rng.integers(0, 3))):
        lines.insert(int(rng.integers(len(lines) + 1)), line)
    return b"\n".join(lines)


def change_encoding(data: bytes, rng: Generator) -> bytes:
    """Another encoding, or other ends of lines."""
    text = data.decode("utf-8", errors="replace")
    kind = int(rng.integers(4))
    if kind == 0:
        return text.encode("utf-16")
    if kind == 1:
        return b"\xef\xbb\xbf" + data
    return data.replace(b"\n", b"\r\n" if kind == 2 else b"\r")


text = any_of(change_number, change_number, change_word, change_word, change_lines, change_encoding, raw)

# --- JSON and glTF


def changed_json(value: Any, rng: Generator) -> Any:
    """A JSON value with one leaf, key or branch changed."""
    if isinstance(value, dict) and value and rng.random() < 0.93:
        key = one_of(list(value), rng)
        rest = {name: part for name, part in value.items() if name != key}
        kind = rng.random()
        if kind < 0.06:
            return rest
        if kind < 0.1:
            return {**rest, str(one_of(HOSTILE_NAMES, rng)): value[key]}
        return {**value, key: changed_json(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.93:
        place = int(rng.integers(len(value)))
        kind = rng.random()
        if kind < 0.06:
            return value[:place] + value[place + 1 :]
        if kind < 0.1:
            return value + [value[place]] * int(one_of((1, 100), rng))
        return [*value[:place], changed_json(value[place], rng), *value[place + 1 :]]
    if isinstance(value, str) and rng.random() < 0.6:
        return one_of(HOSTILE_NAMES, rng)
    return one_of(ODD_VALUES, rng)


def change_json(data: bytes, rng: Generator) -> bytes:
    """Change a JSON text as a tree."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return raw(data, rng)
    for _ in range(int(rng.integers(1, 4))):
        value = changed_json(value, rng)
    return json.dumps(value).encode()


def nest_json(data: bytes, rng: Generator) -> bytes:
    """Brackets as deep as a parser's stack."""
    return b"[" * 100_000 if rng.random() < 0.5 else b'{"a":' * 100_000 + data


def change_glb(data: bytes, rng: Generator) -> bytes:
    """Change a GLB's JSON as a tree, or its binary part, with lengths that fit."""
    size = struct.unpack_from("<I", data, 12)[0]
    head, rest = data[20 : 20 + size], data[20 + size :]
    if rng.random() < 0.75:
        head = change_json(head, rng)
        head += b" " * (-len(head) % 4)
    else:
        rest = rest[:8] + change_bytes(rest[8:], rng)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(head) + len(rest), len(head), 0x4E4F534A) + head + rest


# --- pictures and archives


def change_png(data: bytes, rng: Generator) -> bytes:
    """Change a chunk of a PNG, with a check sum that fits."""
    chunks, place = [], 8
    while place + 12 <= len(data):
        length = struct.unpack_from(">I", data, place)[0]
        chunks.append((data[place + 4 : place + 8], data[place + 8 : place + 8 + length]))
        place += 12 + length
    if not chunks:
        return raw(data, rng)
    index = int(rng.integers(len(chunks)))
    kind, body = chunks[index]
    if kind == b"IHDR" and len(body) == 13:
        width, height = (int(one_of((0, 1, 24, 8192, 60_000, 2**31 - 1, 2**32 - 1), rng)) for _ in range(2))
        depth, color = int(one_of((1, 2, 4, 8, 16, 3), rng)), int(one_of((0, 2, 3, 4, 6, 7), rng))
        body = struct.pack(">IIBB", width, height, depth, color) + body[10:]
    else:
        body = change_bytes(body, rng) if rng.random() < 0.7 else raw(body, rng)
    chunks[index] = (kind, body)
    if rng.random() < 0.3:
        chunks.insert(index, (one_of((b"tRNS", b"iCCP", b"gAMA", b"PLTE", b"zTXt", b"acTL"), rng), rng.bytes(12)))
    return data[:8] + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in chunks
    )


def change_zip(data: bytes, rng: Generator) -> bytes:
    """Change a member of an archive, its name, or blow it up."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [(name, archive.read(name)) for name in archive.namelist()]
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, zlib.error, OSError, EOFError, ValueError):
        return raw(data, rng)
    if not members:
        return raw(data, rng)
    index = int(rng.integers(len(members)))
    name, body = members[index]
    kind = rng.random()
    if kind < 0.6:
        body = raw(body, rng)
    elif kind < 0.85:
        name = str(one_of(HOSTILE_NAMES, rng))[:1000].replace("\0", "") or "a"
    else:
        body = body + bytes(50_000_000)
    members[index] = (name, body)
    stream = io.BytesIO()
    method = zipfile.ZIP_DEFLATED if kind > 0.85 or rng.random() < 0.2 else zipfile.ZIP_STORED
    with zipfile.ZipFile(stream, "w", method) as archive:
        for member, content in members:
            archive.writestr(member, content)
    return stream.getvalue()
