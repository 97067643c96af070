import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.recorded.clouds.lzf import compress, decompress


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.binary(max_size=40), st.integers(1, 60)), max_size=6))
def test_what_is_compressed_comes_back(parts: list[tuple[bytes, int]]) -> None:
    data = b"".join(piece * times for piece, times in parts)
    assert decompress(compress(data), len(data)) == data


def test_repetitions_become_short() -> None:
    assert len(compress(bytes(100_000))) < 100_000 / 80
    far = bytes(range(256)) * 32  # 8,192 bytes: the farthest that a reference reaches
    assert decompress(compress(far + far), 2 * len(far)) == far + far


def test_streams_of_the_format() -> None:
    # literal "abc", then 9 bytes from 3 back: overlapping, as lzf_d.c expands it
    assert decompress(b"\x02abc" + bytes([7 << 5, 0, 2]), 12) == b"abcabcabcabc"
    assert decompress(b"\x00a" + bytes([1 << 5, 0]), 4) == b"aaaa"


@pytest.mark.parametrize("data", [b"\x20\x00", b"\x05abc", b"\xe0", b"\xe0\x00", b"\x00a\x20"])
def test_damaged_streams_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"expected|beginning"):
        decompress(data, 12)
