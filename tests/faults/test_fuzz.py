"""Every reader of a file of somebody else, fed with anything: it is read, or refused in words.

An input is a sound one of `readers.py` with words, numbers and bytes changed. None may cost a
traceback, a warning, a word on the terminal, or a file.
"""

from __future__ import annotations

import random
import re
import tempfile
import warnings
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from readers import READERS, Reader

from bsg_data.errors import BSGError

pytestmark = pytest.mark.heavy
TOKEN = re.compile(rb'"(?:[^"\\]|\\.)*"|[-\w.]+|[^\s\w]|\s')
PLAIN = """
0 -1 0.5 -0.0 1e400 1e-320 NaN -Infinity null true 4294967296 1e308 x id [] {} [[]] sparse
-9223372036854775809 1979-05-27 [null] [1,1] [[0,0]] PAR1 room|999999 '''
"""
HOSTILE = tuple(
    word.encode()
    for word in (
        *PLAIN.split(),
        *('""', '"\\ud800"', '"../../victim"', '"\\u0000"', '"nan"', '"\\u202e"', '"\\u001b[2J"'),
        *("", "9" * 40, "9" * 5_000, '[{"":0}]', '{"a":1,"a":2}', "[" * 30, '"' + "y" * 600 + '"'),
        *("[" * 2_000 + "]" * 2_000, '{"a":' * 2_000 + "1" + "}" * 2_000, "{a=" * 1_500),
        *("\n" * 2_000, "- " * 1_500, "\r\n", "\t", "\0", ";", "#", "\u2028", "|\n", "&a", "*a"),
        *("<<: ", "? ", "!!python/object:x", "%YAML 1.2", "[[model]]", "PK\x01\x02", "PK\x05\x06"),
    )
)


def change(data: bytes, rng: random.Random) -> bytes:
    """Return an input with a few words or bytes of it changed."""
    for _ in range(rng.choice((1, 1, 2, 4))):
        spans = [found.span() for found in TOKEN.finditer(data)] or [(0, 0)]
        (start, end), (first, last) = rng.choice(spans), rng.choice(spans)
        if rng.random() < 0.3:  # anything, as a disk does
            start = rng.randrange(len(data) + 1)
            end = start + rng.choice((0, 1, 1, 8, 40))
        new = rng.choice((data[first:last], data[start:end] * 2, bytes([rng.randrange(256)])))
        data = data[:start] + (rng.choice(HOSTILE) if rng.random() < 0.7 else new) + data[end:]
    return data


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_anything_is_read_or_refused(
    reader: Reader, tmp_path: Path, full: bool, monkeypatch: pytest.MonkeyPatch, capfd: object
) -> None:
    (tmp_path / "input").mkdir()
    (tmp_path / "elsewhere").mkdir()
    sound = reader.seeds()
    for data in sound:  # what libraries make when they are imported is not ours
        reader.read(tmp_path / "input", data)
    monkeypatch.chdir(tmp_path / "elsewhere")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "elsewhere"))

    def feed(data: bytes) -> None:
        try:
            reader.read(tmp_path / "input", data)
        except BSGError as error:
            if not str(error).strip():
                raise AssertionError(data) from error

    @settings(max_examples=2_000 if full else 40, suppress_health_check=list(HealthCheck))
    @given(data=st.sampled_from(sound), seed=st.integers(0, 2**32))
    def run(data: bytes, seed: int) -> None:
        feed(change(data, random.Random(seed)))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run()
    assert capfd.readouterr() == ("", "")  # type: ignore[attr-defined]  # of libraries in C, too
    assert list((tmp_path / "elsewhere").iterdir()) == []
