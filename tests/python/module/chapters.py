"""Runs what the chapters of docs/ say to type, as a reader would: `chapters.py [docs/NAME.md ...]`.

Blocks of a chapter run one after the other in a folder of their own, which has `examples` and the example flights as `run1.csv`,
... and in `flights`. Of a fenced block

- `sh` is run by bash, which ends at the first failure, and `python` in this process, with the names of those before it;
- with `title="FILE"` it is written to that file, which what runs later must name;
- `toml` without a title is a part of a file: it must be TOML;
- `text` is neither.

A comment before a block says what is different: `<!-- not run: REASON -->`, or `<!-- run with: s/60/6/ -->`, by which sed changes what is
run. `<!-- first: COMMANDS -->` makes files that a reader has; ROOT is the repository there.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent
from time import perf_counter
from typing import NoReturn

from common import FLIGHTS, ROOT

# Seconds that a block may take; a machine that does other things as well needs some.
LIMIT = 300
# A line that is meant to be typed.
TYPED = re.compile(r"\s*(\$ |pilotage |python3? |pip |cargo |import |from \w+ import |\[\[?[\w.]+\]\]?$)")
PIECE = re.compile(
    r"<!-- first:(?P<first>(?s:.*?))-->"
    r"|(?:<!-- (?P<how>not run|run with): (?P<what>[^>]*?) -->\n+)?^(?P<edge> *)(?P<fence>```+)(?P<info>.*)\n(?P<code>(?s:.*?))^ *(?P=fence)$"
    r"|(?:\A|(?<=\n\n))(?P<indented>(?:    .*\n)+)"
    r"|(?P<stray><!-- (?:not run|run with|first).*)",
    re.M,
)


@dataclass
class Chapter:
    """What became of the blocks of a chapter."""

    name: str
    text: str
    place: str = ""
    ran: int = 0
    files: int = 0
    parts: int = 0

    def run(self) -> list[str]:
        """Runs all blocks; gives those that were left out, with the reason."""
        names: dict[str, object] = {"__name__": "chapter"}
        left_out, waiting = [], {}
        for piece in PIECE.finditer(self.text):
            self.place = f"{self.name}:{self.text.count(chr(10), 0, piece.start()) + 1}"
            if piece["stray"]:
                self.fail("a comment that is not understood, or without a block")
            if piece["indented"]:
                if any(TYPED.match(line) for line in piece["indented"].splitlines()):
                    self.fail("what is to be typed stands in a fenced block, with its language")
                continue
            if piece["first"]:
                shell(self, piece["first"])
                continue
            language, _, more = piece["info"].partition(" ")
            if piece["how"] == "not run":
                left_out.append(f"{language}: {piece['what']}")
                continue
            code = dedent(piece["code"])
            if piece["how"]:
                changed = subprocess.run(["sed", "-E", piece["what"]], input=code, capture_output=True, text=True, check=True).stdout
                if changed == code:
                    self.fail(f"`{piece['what']}` changes nothing")
                code = changed
            title = re.fullmatch(r'title="(.+)"', more)
            if title:
                write(title[1], code)
                waiting[title[1]] = self.place
                self.files += 1
            elif language in ("sh", "python"):
                for file in [file for file in waiting if Path(file).name in code or file.split("/")[0] in code]:
                    del waiting[file]
                (shell if language == "sh" else python)(self, code, names)
                self.ran += 1
            elif language == "toml":
                tomllib.loads(code)
                self.parts += 1
            elif language != "text" or any(TYPED.match(line) for line in code.splitlines()):
                self.fail('it is not run: give it a title="FILE", or say why by `<!-- not run: REASON -->`')
        if waiting:
            self.fail(f"nothing reads {', '.join(waiting)}")
        return left_out

    def fail(self, words: str) -> NoReturn:
        sys.exit(f"{self.place}: {words}")


def shell(chapter: Chapter, code: str, _names: object = None) -> None:
    given = ["timeout", str(LIMIT), "bash", "-euo", "pipefail", "-c", code]
    ended = subprocess.run(given, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if ended.returncode:
        chapter.fail(f"exit code {ended.returncode}\n{code}\n{ended.stdout[-3000:]}\n{ended.stderr[-3000:]}")


def python(chapter: Chapter, code: str, names: dict[str, object]) -> None:
    exec(compile(code, chapter.place, "exec"), names)


def write(name: str, content: str) -> None:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)


def run(chapter: Path) -> None:
    """One chapter; prints what became of its blocks."""
    name = str(chapter.relative_to(ROOT))
    program = str(Path(os.environ["PILOTAGE"]).parent)
    os.environ.update(ROOT=str(ROOT), PATH=os.pathsep.join([program, str(Path(sys.executable).parent), os.environ["PATH"]]))
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        shutil.copytree(ROOT / "examples", "examples")
        Path("flights").mkdir()
        for number, flight in enumerate(FLIGHTS, 1):
            shutil.copy(flight, "flights")
            shutil.copy(flight, f"run{number}.csv")
        own = Chapter(name, chapter.read_text())
        left_out = own.run()
        os.chdir(ROOT)
    print(f"{name}: {own.ran} run, {own.files} files, {own.parts} parts of files, {len(left_out)} not run")
    for line in left_out:
        print(f"    {line}")


def main(chapters: list[Path]) -> None:
    if len(chapters) == 1:
        run(chapters[0].resolve())
        return

    def apart(chapter: Path) -> tuple[subprocess.CompletedProcess[str], float]:
        begin = perf_counter()
        ended = subprocess.run([sys.executable, __file__, str(chapter)], capture_output=True, text=True)
        return ended, perf_counter() - begin

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(apart, chapters))
    for chapter, (ended, seconds) in zip(chapters, results, strict=True):
        print(ended.stdout, end="")
        print(f"{seconds:6.1f} s  {chapter.name}", file=sys.stderr)
    failed = [ended.stderr for ended, _ in results if ended.returncode]
    if failed:
        sys.exit("\n".join(failed))


if __name__ == "__main__":
    main([Path(word) for word in sys.argv[1:]] or sorted((ROOT / "docs").glob("*.md")))
