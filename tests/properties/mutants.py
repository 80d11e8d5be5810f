"""Scenes and recipes as no user writes them: seeded mutations of sound ones."""

import random
import re
from collections.abc import Iterator
from pathlib import Path

#: what is put into texts: odd numbers, odd words, structure in odd places, what readers and terminals choke on
TOKENS = (
    *("nan", "-inf", "-1", "0", "1e400", "1e-400", "9" * 400, "9" * 5000, "0x10", "1_0", "true", "1979-05-27"),
    *("[]", "{}", "[[]]", "{ a = { b = [ {} ] } }", "[1, [2, 'x']]", "[" * 200),
    *('""', '"\\u0000"', '"a.b"', '"$x^"', '"\\u001b[31m"', "'''", '"1 mm"', '"1 a"', f'"1 a{" " * 60_000}"'),
    *("source", '".."', "type", "=", ".", "#", "\n[body.x]\n", "\n[body.source]\n", "\n[[joint]]\n", "a." * 300),
    *('"/dev/zero"', '"x' + "x" * 5000 + '"', '"../../.."', '"a\\u0000b"', '"."', "\x7f", "ё"),
)


def mutant(texts: list[str], seed: int) -> str:
    """One of the texts, changed in one to four places."""
    rng = random.Random(seed)
    text = rng.choice(texts)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        lines = text.splitlines() or [""]
        k = rng.randrange(len(lines))
        lines[k] = rng.choice(CHANGES)(rng, lines, k)
        text = "\n".join(lines)
    return text


def _value(rng: random.Random, lines: list[str], k: int) -> str:
    return f"{lines[k].partition('=')[0]}= {rng.choice(TOKENS)}"


def _key(rng: random.Random, lines: list[str], k: int) -> str:
    return f"{rng.choice(TOKENS)} ={lines[k].partition('=')[2]}"


def _insertion(rng: random.Random, lines: list[str], k: int) -> str:
    at = rng.randrange(len(lines[k]) + 1)
    return lines[k][:at] + rng.choice(TOKENS) + lines[k][at:]


def _character(rng: random.Random, lines: list[str], k: int) -> str:
    at = rng.randrange(len(lines[k]) + 1)
    return lines[k][:at] + chr(rng.randrange(1, 0x250)) + lines[k][at + 1 :]


def _words(rng: random.Random, lines: list[str], k: int) -> str:
    known = re.findall(r"\w{1,40}", "\n".join(lines))
    return re.sub(r"\w{1,40}", lambda m: rng.choice(known) if known and rng.random() < 0.3 else m[0], lines[k])


def _another_line(rng: random.Random, lines: list[str], k: int) -> str:
    return rng.choice(lines)


def _twice(rng: random.Random, lines: list[str], k: int) -> str:
    return f"{lines[k]}\n{rng.choice(lines)}"


def _nothing(rng: random.Random, lines: list[str], k: int) -> str:
    return ""


CHANGES = (_value, _key, _insertion, _character, _words, _another_line, _twice, _nothing)


def sound(folder: Path) -> Iterator[str]:
    """Texts of the files below a folder that stand for themselves."""
    for path in sorted(folder.rglob("*.toml")):
        text = path.read_text()
        if "extends =" not in text:
            yield text
