"""What other checkers find of the faults planted in tests/it/fmi: writes docs/peers.md again.

    python3 tests/python/peers.py            (Linux on x86-64: FMI Library comes with libcosim)

Somebody wrote the first four columns of the tables, from the sources of the other tools; here they are checked.
fmpy and FMI Library run, and fill the other two. What `validate` finds stands in the snapshots of the tests.
The exit code is 1 if a check of another tool has neither a fault that `validate` finds nor a reason.
"""

import functools
import re
import sys
import tempfile
from collections import Counter
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "casadi"))

import environment

PAGE = ROOT / "docs" / "peers.md"
FMI = ROOT / "tests" / "it" / "fmi"
PACKAGES = ["fmpy", "attrs", "lark", "lxml", "msgpack", "numpy", "libcosimpy"]
SNAPSHOTS = {
    "FMI 2": "findings__every_fault_of_fmi_2_is_found",
    "FMI 3": "findings__every_fault_of_fmi_3_is_found",
    "terminalsAndIcons.xml": "faults_files__every_fault_of_the_files_is_found",
    "buildDescription.xml": "faults_files__every_fault_of_the_files_is_found",
}
RUN = ["fmpy", "FMI Library"]
HEAD = "| section | check | message of `validate` | planted fault contains | fmpy | FMI Library |"


@functools.cache
def planted(corpus):
    """Each fault: what is replaced, by what, and what `validate` finds. Of FMUs as a whole: their names."""
    if corpus not in SNAPSHOTS:
        text = (FMI / "faults.rs").read_text() + (FMI / "behaviour.toml").read_text()
        names = re.findall(r"""["']([a-z][\w -]*)["']""", text)
        return [("", "", [name]) for name in names]
    text = (FMI / "snapshots" / f"it__fmi__{SNAPSHOTS[corpus]}.snap").read_text().split("---\n", 2)[2]
    faults = []
    for fault in re.split(r"^\d+\. ", text, flags=re.M)[1:]:
        old, rest = fault.rstrip("\n").split("\n-> ", 1)
        new, *findings = re.split(r"\n   (?! )", rest)
        faults.append((old, new, findings))
    return faults


def descriptions(corpus):
    """The good description and the faulty ones."""
    good = (FMI / f"good{corpus[-1]}.xml").read_text()
    for old, new, _ in [("", "", []), *planted(corpus)]:
        assert not old or good.count(old) == 1, old
        xml = good.replace(old, new) if old else good
        # fmpy does not read <ClockType>, and takes an output clock for an initial unknown.
        xml = xml.replace(' declaredType="Sampling"', ' intervalDecimal="0.1"')
        xml = xml.replace('valueReference="13" causality="output"', 'valueReference="13"')
        yield xml.replace('<Output valueReference="13" dependencies="12"/>', "")


def found_by(complaints, corpus):
    """Whether each fault adds to what a tool says of the good description."""
    said = []
    for xml in descriptions(corpus):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "modelDescription.xml").write_text(xml)
            said.append(complaints(folder))
    return [of_fault != said[0] for of_fault in said[1:]]


def of_fmpy(folder):
    """What fmpy says."""
    from fmpy.validation import validate_fmu

    with ZipFile(Path(folder) / "a.fmu", "w") as archive:
        archive.write(Path(folder) / "modelDescription.xml", "modelDescription.xml")
    return validate_fmu(str(Path(folder) / "a.fmu"))


class Row:
    """A check of another tool."""

    def __init__(self, line):
        self.cells = [cell.strip() for cell in line.split("|")[1:-1]]
        self.section, self.what, says, fault = self.cells[:4]
        self.reason = says.removeprefix("no fault: ") if says.startswith("no fault: ") else None
        self.parts = says.strip("` ").split(" … ")
        self.fault = fault.strip("` ")

    def fits(self, finding):
        """Whether `validate` finds this."""
        words = ".*".join(re.escape(part) for part in self.parts)
        in_section = not self.section or f"section {self.section}" in finding
        return self.reason is None and in_section and re.search(words, finding) is not None

    def faults(self, corpus):
        """The numbers of its faults, from 0."""
        return [
            number
            for number, (old, new, findings) in enumerate(planted(corpus))
            if self.fault in f"{old} -> {new}" and any(map(self.fits, findings))
        ]


def tables(page):
    """The tables' headings with their rows: tool, what is faulty, rows."""
    for part in page.split("\n### ")[1:]:
        heading, *lines = part.splitlines()
        tool, corpus = heading.split(": ")
        rows = [Row(line) for line in lines if line.startswith("|")][2:]
        yield tool, corpus, rows


def summary(found, named):
    """Of how many planted faults each tool finds how many."""
    yield "| planted in a description of | faults | `validate` | fmpy | FMI Library | VDMCheck |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for corpus, by_tool in found.items():
        ours = sum(bool(findings) for _, _, findings in planted(corpus))
        numbers = [len(by_tool["fmpy"]), ours, sum(by_tool["fmpy"])]
        library = by_tool.get("FMI Library")
        numbers.append(sum(library) if library else f"{len(named['FMI Library', corpus])} by its sources")
        numbers.append(f"{len(named['VDMCheck', corpus])} by its rules")
        yield f"| {corpus} | " + " | ".join(map(str, numbers)) + " |"


def checks(everything):
    """How many checks each tool has."""
    count, reasons = Counter(), Counter()
    for tool, _, rows in everything:
        count[tool] += len(rows)
        reasons[tool] += sum(row.reason is not None for row in rows)
    yield "| tool | checks | of these no fault by the standard |"
    yield "| --- | --- | --- |"
    for tool in count:
        yield f"| {tool} | {count[tool]} | {reasons[tool]} |"
    yield f"| all | {count.total()} | {reasons.total()} |"


def cells(row, corpus, found):
    """The row's line, with how many of its faults each tool finds that runs."""
    numbers, runs = row.faults(corpus), found.get(corpus, {})
    hit = lambda tool: f"{sum(runs[tool][n] for n in numbers)} of {len(numbers)}" if numbers and tool in runs else ""
    return "| " + " | ".join(row.cells[:4] + list(map(hit, RUN))) + " |"


def by_rules(everything):
    """The numbers of the faults that the checks of a tool name."""
    named = {}
    for tool, corpus, rows in everything:
        is_named = lambda fault: any(row.fits(finding) for finding in fault[2] for row in rows)
        named[tool, corpus] = {n for n, fault in enumerate(planted(corpus)) if is_named(fault)}
    return named


def missing(everything, found, named):
    """Checks with neither fault nor reason, and what FMI Library finds though the table does not know it."""
    for tool, corpus, rows in everything:
        for row in rows:
            if not row.reason and not row.faults(corpus):
                yield f"{tool}, {corpus}: no fault for: {row.what}"
    for number, hit in enumerate(found["FMI 2"]["FMI Library"]):
        if hit and number not in named["FMI Library", "FMI 2"]:
            yield f"FMI Library, FMI 2: finds fault {number + 1}, which is no check of the table"


def main():
    """Fills the page anew."""
    environment.enter("peers", ["--no-deps", "-c", ROOT / "tests" / "requirements.txt", *PACKAGES])
    from fmilib import of_child

    page = PAGE.read_text()
    everything = list(tables(page))
    found = {corpus: {"fmpy": found_by(of_fmpy, corpus)} for corpus in ["FMI 2", "FMI 3"]}
    found["FMI 2"]["FMI Library"] = found_by(of_child, "FMI 2")
    named = by_rules(everything)
    text = [page.split("\n## ")[0].rstrip(), "", "## Planted faults", ""]
    text += [*summary(found, named), "", *checks(everything), "", "## Each check"]
    for tool, corpus, rows in everything:
        text += ["", f"### {tool}: {corpus}", "", HEAD, "| --- " * 6 + "|"]
        text += [cells(row, corpus, found) for row in rows]
    PAGE.write_text("\n".join(text) + "\n")
    sys.exit("\n".join(missing(everything, found, named)) or 0)


if __name__ == "__main__":
    main()
