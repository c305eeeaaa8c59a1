"""Files as accidents leave them: bytes flipped, a part cut out or off, words swapped; the same for the same seed."""

import re

import numpy as np


def mutated(content: bytes, seed: int) -> bytes:
    """The content after one to three accidents."""
    random = np.random.default_rng(seed)
    for _ in range(random.integers(1, 4)):
        content = ACCIDENTS[random.integers(len(ACCIDENTS))](content, random)
    return content


def flipped(content: bytes, random: np.random.Generator) -> bytes:
    held = bytearray(content)
    for at in random.integers(0, max(1, len(held)), random.integers(1, 9)):
        held[at : at + 1] = bytes([random.integers(256)])
    return bytes(held)


def cut(content: bytes, random: np.random.Generator) -> bytes:
    return content[: random.integers(0, len(content) + 1)]


def gap(content: bytes, random: np.random.Generator) -> bytes:
    begin, end = np.sort(random.integers(0, len(content) + 1, 2))
    return content[:begin] + content[min(end, begin + 200) :]


def swapped(content: bytes, random: np.random.Generator) -> bytes:
    """Two words, of a text or of what looks like one, change places."""
    words = [match.span() for match in re.finditer(rb"[\w.+-]+", content)]
    if len(words) < 2:
        return content
    (a, b), (c, d) = sorted(words[i] for i in random.choice(len(words), 2, replace=False))
    return content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


def odd_number(content: bytes, random: np.random.Generator) -> bytes:
    """A number becomes one that nobody expects."""
    numbers = [match.span() for match in re.finditer(rb"-?\d+(\.\d+)?", content)]
    if not numbers:
        return content
    a, b = numbers[random.integers(len(numbers))]
    odd = [b"-1", b"0", b"1e999", b"nan", b"4294967296", b"99999999999999999999", b"1e-320", b""]
    return content[:a] + odd[random.integers(len(odd))] + content[b:]


ACCIDENTS = (flipped, cut, gap, swapped, odd_number)
