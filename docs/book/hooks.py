"""What MkDocs calls while it builds the book: pages that are not in docs/, and links to what is beside it."""

import ast
import os
import re
import shutil
import subprocess
from pathlib import Path
from posixpath import dirname, normpath, relpath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
# Files above docs/ that are pages of the book. README is the first page on GitHub; here that is docs/README.md.
ABOVE = ("SECURITY.md", "CONTRIBUTING.md", "CHANGELOG.md")
# What any other file above docs/ is copied to.
SOURCES = "source"
LINK = re.compile(r"\[([^\]\n]*)\]\(([^)\s#]+)((?:#[^)\s]*)?)\)")
# Lines of code are longer than Material's column.
STYLE = ".md-grid { max-width: 84rem; }\n.md-typeset pre > code { font-size: 0.76em; }\n"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    for name in ABOVE:
        files.append(File.generated(config, name, content=(ROOT / name).read_text()))
    files.append(File.generated(config, "options.md", content=options()))
    files.append(File.generated(config, "module.md", content=names()))
    files.append(File.generated(config, "book.css", content=STYLE))
    for page in files.documentation_pages():
        for _, link, _ in LINK.findall(page.content_string):
            path = beside(page.src_uri, link)
            if path and (ROOT / path).is_file() and not files.get_file_from_path(f"{SOURCES}/{path}"):
                files.append(File.generated(config, f"{SOURCES}/{path}", abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Page, files: Files, **_: object) -> str:
    def target(link: re.Match[str]) -> str:
        text, path, anchor = link.groups()
        uri = place(page.file.src_uri, path)
        if uri is None:
            return link[0]
        other = files.get_file_from_path(uri)
        # On GitHub a link is the name of a file, here the title of a page.
        if other and other.is_documentation_page() and text.removeprefix("docs/") == path.rpartition("/")[2]:
            text = re.search(r"^# (.+)", other.content_string, re.M)[1]
        return f"[{text}]({relpath(uri, dirname(page.file.src_uri) or '.')}{anchor})"

    return LINK.sub(target, markdown)


def repository_path(page: str, link: str) -> str | None:
    """Where a link of a page leads to in the repository."""
    if ":" in link or link.startswith("/"):
        return None
    return normpath(link if page in ABOVE else f"docs/{dirname(page)}/{link}")


def beside(page: str, link: str) -> str | None:
    """The same of a link to a file beside docs/ that is no page."""
    path = repository_path(page, link)
    if path is None or path.startswith("docs/") or path in (*ABOVE, "README.md"):
        return None
    return path


def place(page: str, link: str) -> str | None:
    """Where that is in the book."""
    path = repository_path(page, link)
    if path is None:
        return None
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    if path in (*ABOVE, "README.md"):
        return path
    return f"{SOURCES}/{path}"


def options() -> str:
    """Help of the command and of all commands in it, as it prints them."""
    program = os.environ.get("PILOTAGE") or shutil.which("pilotage")
    if program is None:
        raise PluginError("the options of all commands come from `pilotage`: put it on the search path, or name it in PILOTAGE")
    parts = ["# Options of all commands\n\nAs `pilotage --help` and `pilotage COMMAND --help` print them.\n"]

    def describe(words: list[str]) -> None:
        asked = subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=True)
        title = " ".join(["pilotage", *words])
        parts.append(f"{'#' * (2 + bool(words[1:]))} {title}\n\n```text\n{asked.stdout.rstrip()}\n```\n")
        _, _, commands = asked.stdout.partition("\nCommands:\n")
        for name in re.findall(r"^  ([a-z][\w-]*)(?:  |$)", commands.partition("\n\n")[0], re.M):
            if name != "help":
                describe([*words, name])

    describe([])
    return "\n".join(parts)


def names() -> str:
    """A page with all that the Python module exports, as its docstrings describe it."""
    tree = ast.parse((ROOT / "python/pilotage/__init__.py").read_text())
    (exported,) = (
        ast.literal_eval(own.value)
        for own in tree.body
        if isinstance(own, ast.Assign) and isinstance(own.targets[0], ast.Name) and own.targets[0].id == "__all__"
    )
    begin = "# All names of the Python module\n\n[The guide](python.md) shows how they are used.\n"
    return "\n\n".join([begin, *(f"::: pilotage.{name}" for name in sorted(exported, key=str.lower))])
