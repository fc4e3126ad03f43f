#!/usr/bin/env python3
"""Builds what is released, into a new folder:

    python3 scripts/dist.py                   # into dist/; minutes, all is optimised
    python3 scripts/dist.py --platforms FOLDER    # with the libraries of scripts/platforms.py: FMUs for all platforms

    pilotage-VERSION-cp311-abi3-PLATFORM.whl  the module for Python, with the command
    pilotage-VERSION-TARGET.tar.gz            the command, completions for shells, manual pages, licences
    pilotage_VERSION_ARCHITECTURE.deb         the same for Debian and Ubuntu (Linux alone)
    SHA256SUMS                                for `sha256sum -c`

It needs what `pip install .` and `cargo build` need. Equal sources, compilers and times (SOURCE_DATE_EPOCH; else that of the last commit) give
equal bytes.
"""

import argparse
import gzip
import hashlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from importlib.util import find_spec
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).resolve().parent.parent
# A file's name to what is in it.
Tree = dict[str, bytes]
# The oldest glibc on which it runs, where src/export/old_glibc.rs links for it.
GLIBC = {"x86_64-unknown-linux-gnu": (2, 17)}
ARCHITECTURES = {"x86_64": "amd64", "aarch64": "arm64"}
PROGRAM = "pilotage.exe" if os.name == "nt" else "pilotage"
DESCRIPTION = """\
identifies how a human pilot acts on a vehicle
 Fits pilots and other dynamic systems to recorded data by direct collocation,
 exports them as FMUs, and simulates coupled FMUs."""


def run(*command: str | Path) -> str:
    """What a command prints; it runs in the project's folder."""
    words = [str(word) for word in command]
    print("+", shlex.join(words), file=sys.stderr, flush=True)
    return subprocess.run(words, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def wheel(out: Path, profile: str, target: str) -> None:
    """Builds the wheel, which is refused where it would need a newer glibc."""
    arguments = f"--profile {profile}" + (" --compatibility manylinux2014" if target in GLIBC else "")
    # A maturin that stands beside this Python is taken.
    isolation = ["--no-build-isolation"] if find_spec("maturin") else []
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", *isolation]
    run(*pip, "--config-settings", f"build-args={arguments}", "--wheel-dir", out, ROOT)


def command(profile: str) -> Path:
    """Builds the command."""
    run("cargo", "build", "--locked", "--profile", profile, "--bin", "pilotage")
    folders = json.loads(run("cargo", "metadata", "--no-deps", "--format-version=1"))
    return Path(folders["target_directory"]) / profile / PROGRAM


def needed(program: bytes) -> tuple[int, ...]:
    """The newest version of glibc of which a program wants functions."""
    versions = re.findall(rb"\0GLIBC_(\d+(?:\.\d+)+)(?=\0)", program)
    return max(tuple(map(int, version.split(b"."))) for version in versions)


def licences(target: str) -> bytes:
    """The licences of all crates that are in the command and in the library of exported FMUs."""
    metadata = json.loads(run("cargo", "metadata", "--locked", "--format-version=1", "--filter-platform", target))
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    reached: set[str] = set()
    left = [key for key, package in packages.items() if package["name"] in ("pilotage", "pilotage-fmu", "pilotage-container")]
    while left:
        key = left.pop()
        if key not in reached:
            reached.add(key)
            left += [d["pkg"] for d in nodes[key]["deps"] if any(kind["kind"] is None for kind in d["dep_kinds"])]
    vendored = sorted((ROOT / "src/report/vendor").glob("*.LICENSE"))
    texts = {file.read_text().strip(): [file.stem] for file in vendored}
    names = [file.stem for file in vendored]
    for package in sorted((packages[key] for key in reached), key=lambda p: (p["name"], p["version"])):
        if package["source"] is None:
            continue
        name = f"{package['name']} {package['version']}"
        names.append(f"{name}: {package['license']}")
        for file in sorted(Path(package["manifest_path"]).parent.iterdir()):
            if re.match(r"(?i)(licen[cs]e|copying|notice|unlicense)", file.name) and file.is_file():
                texts.setdefault(file.read_text(errors="replace").strip(), []).append(name)
    parts = ["What others wrote and is in pilotage, by name, version and licence:\n\n" + "\n".join(names)]
    parts += [f"{', '.join(dict.fromkeys(users))}:\n\n{text}" for text, users in texts.items()]
    return ("\n\n" + "-" * 80 + "\n\n").join(parts).encode() + b"\n"


def manual(program: Path) -> Tree:
    """The manual pages."""
    with tempfile.TemporaryDirectory() as folder:
        run(program, "man", folder)
        return {file.name: file.read_bytes() for file in Path(folder).iterdir()}


def packed(tree: Tree, time: int, before: str = "") -> bytes:
    """A tar archive of files, each after the folders in which it is."""
    folders = {str(folder) for name in tree for folder in PurePosixPath(name).parents} - {"."}
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w", format=tarfile.GNU_FORMAT) as archive:
        for name in sorted(folders | set(tree)):
            entry = tarfile.TarInfo(before + name)
            entry.mtime, entry.uname, entry.gname = time, "root", "root"
            if name in folders:
                entry.type, entry.mode = tarfile.DIRTYPE, 0o755
                archive.addfile(entry)
                continue
            entry.size, entry.mode = len(tree[name]), 0o755 if "bin" in PurePosixPath(name).parts else 0o644
            archive.addfile(entry, io.BytesIO(tree[name]))
    return buffer.getvalue()


def compressed(content: bytes) -> bytes:
    """By gzip, without the time."""
    return gzip.compress(content, mtime=0)


def debian(share: Tree, fields: dict[str, str], time: int) -> bytes:
    """A Debian package: deb(5). It is written here, so that any Linux makes it."""
    tree = {f"usr/{name}": content for name, content in share.items()}
    tree |= {"usr/share/doc/pilotage/copyright": (ROOT / "LICENSE-MIT").read_bytes()}
    fields["Installed-Size"] = str(sum(map(len, tree.values())) // 1024)
    fields["Description"] = DESCRIPTION
    sums = "".join(f"{hashlib.md5(content).hexdigest()}  {name}\n" for name, content in sorted(tree.items()))
    control = "".join(f"{key}: {value}\n" for key, value in fields.items())
    members = {
        "debian-binary": b"2.0\n",
        "control.tar.gz": compressed(packed({"control": control.encode(), "md5sums": sums.encode()}, time, "./")),
        "data.tar.gz": compressed(packed(tree, time, "./")),
    }
    archive = b"!<arch>\n"
    for name, content in members.items():
        archive += f"{name:<16}{time:<12}{0:<6}{0:<6}{100644:<8}{len(content):<10}`\n".encode()
        archive += content + b"\n" * (len(content) % 2)
    return archive


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="the folder, which must not exist")
    parser.add_argument("--profile", default="release", help="cargo's profile")
    parser.add_argument("--command", type=Path, help="a command that is already built")
    parser.add_argument("--platforms", type=Path, help="the folder of scripts/platforms.py, for FMUs for all platforms")
    options = parser.parse_args()
    if options.platforms:
        os.environ["PILOTAGE_FMU_PLATFORMS"] = str(options.platforms.resolve())
    elif not options.command:
        print("note: FMUs will be for this machine alone; --platforms makes them for all", file=sys.stderr)
    place = options.out.resolve()
    if place.exists():
        parser.error(f"{place} exists; remove it, or choose another folder by --out")
    place.parent.mkdir(parents=True, exist_ok=True)
    try:
        with tempfile.TemporaryDirectory(dir=place.parent) as folder:
            made = Path(folder) / "dist"
            dist(made, options.profile, options.command)
            made.rename(place)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"error: {error}")
    for file in sorted(place.iterdir()):
        print(f"{file.stat().st_size / 1e6:8.2f} MB  {file}")


def dist(out: Path, profile: str, built: Path | None) -> None:
    """Makes everything."""
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    target = re.search(r"^host: (.*)$", run("rustc", "-vV"), re.MULTILINE)[1]
    if "SOURCE_DATE_EPOCH" not in os.environ:
        os.environ["SOURCE_DATE_EPOCH"] = run("git", "log", "-1", "--format=%ct").strip()
    time = int(os.environ["SOURCE_DATE_EPOCH"])
    wheel(out, profile, target)

    built = (built or command(profile)).resolve()
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / PROGRAM
        if os.name == "nt":
            program.write_bytes(built.read_bytes())
        else:
            run("strip", "-o", program, built)
        content = program.read_bytes()
        pages = manual(program)
        completions = {shell: run(program, "completions", shell).encode() for shell in ("bash", "zsh", "fish")}
    if target in GLIBC and needed(content) > GLIBC[target]:
        sys.exit(f"{built} needs glibc {needed(content)}; docs/old-glibc.md says what to do")
    common = {
        f"bin/{PROGRAM}": content,
        "share/bash-completion/completions/pilotage": completions["bash"],
        "share/fish/vendor_completions.d/pilotage.fish": completions["fish"],
    }
    texts = {name: (ROOT / name).read_bytes() for name in ("README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE")}
    texts["LICENSES-OF-OTHERS"] = licences(target)

    name = f"pilotage-{version}-{target}"
    tree = common | texts | {"share/zsh/site-functions/_pilotage": completions["zsh"]}
    tree |= {f"share/man/man1/{page}": text for page, text in pages.items()}
    tarball = packed({f"{name}/{path}": text for path, text in tree.items()}, time)
    (out / f"{name}.tar.gz").write_bytes(compressed(tarball))

    if "linux-gnu" in target:
        # Where Debian's shells look, and its manual pages are compressed.
        tree = common | {"share/zsh/vendor-completions/_pilotage": completions["zsh"]}
        tree |= {f"share/doc/pilotage/{file}": text for file, text in texts.items()}
        tree |= {f"share/man/man1/{page}.gz": compressed(text) for page, text in pages.items()}
        fields = {
            "Package": "pilotage",
            "Version": version,
            "Architecture": ARCHITECTURES[target.split("-")[0]],
            "Maintainer": "the authors of pilotage",
            "Section": "science",
            "Priority": "optional",
            "Depends": f"libc6 (>= {'.'.join(map(str, needed(content)))})",
        }
        package = f"pilotage_{version}_{fields['Architecture']}.deb"
        (out / package).write_bytes(debian(tree, fields, time))

    sums = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in sorted(out.iterdir())]
    (out / "SHA256SUMS").write_text("".join(sums))


if __name__ == "__main__":
    main()
