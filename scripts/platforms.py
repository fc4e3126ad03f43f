#!/usr/bin/env python3
"""Builds the libraries of exported FMUs for all platforms, for commands that write FMUs for all:

    python3 scripts/platforms.py                              # into target/platforms/; minutes
    PILOTAGE_FMU_PLATFORMS=$PWD/target/platforms cargo build --release

    python3 scripts/platforms.py --crate my-vehicle --out libraries     # a model in Rust (docs/fmu-models.md), for `pilotage pack`

It needs Linux, `rustup` or `rustc`, and Python's `venv`. All is linked by zig, of the Python package ziglang. The standard library of Rust for
other platforms comes from `rustup target add`; where that has none, from Debian's packages of Rust's compiler and sources (rustc-web,
rust-web-src), which are downloaded by apt-get and unpacked into the target folder; nothing is installed.
"""

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
import venv
import zipfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# What is in FMUs: the packages whose libraries the command embeds (build.rs).
PACKAGES = ["pilotage-fmu", "pilotage-container"]
PROFILE = "fmu"
ZIG = "ziglang==0.17.1"
# Time for rustup's server to answer [s].
PATIENCE = 120


@dataclass(frozen=True)
class Platform:
    """A platform: its name in FMI 2.0 and 3.0, in Rust and in zig, and the name of a library."""

    fmi2: str
    tuple: str
    rust: str
    zig: str
    library: str

    @property
    def variable(self) -> str:
        return f"CARGO_TARGET_{self.rust.upper().replace('-', '_')}_LINKER"


PLATFORMS = [
    Platform("linux64", "x86_64-linux", "x86_64-unknown-linux-gnu", "x86_64-linux-gnu.2.17", "lib{}.so"),
    Platform("aarch64-linux", "aarch64-linux", "aarch64-unknown-linux-gnu", "aarch64-linux-gnu.2.17", "lib{}.so"),
    Platform("win64", "x86_64-windows", "x86_64-pc-windows-gnullvm", "x86_64-windows-gnu", "{}.dll"),
    Platform("darwin64", "x86_64-darwin", "x86_64-apple-darwin", "x86_64-macos.11.0", "lib{}.dylib"),
    Platform("aarch64-darwin", "aarch64-darwin", "aarch64-apple-darwin", "aarch64-macos.11.0", "lib{}.dylib"),
]


def run(*command: str | Path, env: dict[str, str] | None = None, cwd: Path = ROOT, timeout: float | None = None) -> str:
    """What a command prints."""
    words = [str(word) for word in command]
    print("+", shlex.join(words), file=sys.stderr, flush=True)
    done = subprocess.run(words, cwd=cwd, check=True, stdout=subprocess.PIPE, text=True, timeout=timeout, env={**os.environ, **(env or {})})
    return done.stdout


def link(target: str, arguments: list[str]) -> None:
    """Becomes zig as the linker of rustc: what zig does not know, or brings itself, is left out."""
    # Zig brings the libraries of MinGW, of unwinding, and of macOS but for iconv, which nothing calls.
    dropped = {"-liconv", "-nolibc", "--unwindlib=none", "-lmingw32", "-lmingwex", "-lmsvcrt", "-Wl,--disable-auto-image-base"}
    kept = []
    for word in arguments:
        if word in dropped or word.startswith("-Wl,-exported_symbols_list") and "macos" not in target:
            continue
        # A list of what a DLL exports is a file to zig.
        kept.append(word.removeprefix("-Wl,") if word.endswith(".def") else word)
    if "macos" in target:
        # The system's own strip is not that of macOS; what is linked so is signed (ad hoc), as Macs with ARM demand.
        kept.append("-s")
        if "-dynamiclib" in kept:
            # Else it is the path on this machine.
            name = Path(kept[kept.index("-o") + 1]).name
            kept.append(f"-Wl,-install_name,@rpath/{name}")
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, *kept]
    os.execv(sys.executable, command)


class Tools:
    """Zig and the standard libraries, in a folder."""

    def __init__(self, folder: Path, std: str) -> None:
        self.folder, self.std = folder, std
        self.python = folder / "zig/bin/python"
        if not (folder / "zig/ready").exists():
            venv.create(folder / "zig", with_pip=True, clear=True)
            run(self.python, "-m", "pip", "install", "--quiet", ZIG)
            (folder / "zig/ready").touch()
        self.debian: dict[str, str] | None = None

    def linker(self, platform: Platform) -> Path:
        """A program that links for a platform."""
        file = self.folder / f"link-{platform.tuple}"
        words = [str(self.python), str(Path(__file__).resolve()), "--link", platform.zig]
        cache = self.folder / "zig-cache"
        text = f"#!/bin/sh\nexport ZIG_GLOBAL_CACHE_DIR={shlex.quote(str(cache))} ZIG_LOCAL_CACHE_DIR={shlex.quote(str(cache))}\n"
        file.write_text(text + f'exec {shlex.join(words)} "$@"\n')
        file.chmod(0o755)
        return file

    def environment(self, platform: Platform) -> tuple[list[str], dict[str, str]]:
        """Arguments of cargo and variables with which it builds for a platform."""
        env = {platform.variable: str(self.linker(platform)), "MACOSX_DEPLOYMENT_TARGET": "11.0"}
        if "darwin" in platform.tuple:
            env["CARGO_PROFILE_FMU_STRIP"] = "none"
        if self.has_std(platform.rust):
            return [], env
        if self.debian is None:
            self.debian = self.of_debian()
        return ["-Zbuild-std=std,panic_unwind", "--ignore-rust-version"], env | self.debian

    def has_std(self, target: str) -> bool:
        """Whether the compiler has a target's standard library, or rustup gives it."""
        has = lambda: target in run("rustup", "target", "list", "--installed", cwd=ROOT).split()
        try:
            if has():
                return True
            if self.std == "debian":
                return False
            run("rustup", "target", "add", target, timeout=PATIENCE)
            return has()
        except (OSError, subprocess.SubprocessError) as error:
            print(f"rustup gives no standard library for {target} ({error}): Debian's packages", file=sys.stderr)
            # Nor for others.
            self.std = "debian"
            return False

    def of_debian(self) -> dict[str, str]:
        """Rust's compiler and sources of Debian, unpacked."""
        root = self.folder / "debian"
        if not (root / "ready").exists():
            packages = ["rustc-web", "libstd-rust-web-dev", "rust-web-src"]
            for pattern in (r"libstd-rust-web-\d\S*", r"libllvm\d+"):
                listed = run("apt-cache", "depends", packages[-1] if "llvm" in pattern else "libstd-rust-web-dev")
                packages.append(re.search(rf"Depends: ({pattern})", listed)[1])
            root.mkdir(parents=True, exist_ok=True)
            run("apt-get", "download", *packages, cwd=root)
            for file in sorted(root.glob("*.deb")):
                run("dpkg", "-x", file, root)
                file.unlink()
            (root / "ready").touch()
        libraries = next(root.glob("usr/lib/*-linux-gnu"))
        path = os.pathsep.join(filter(None, [str(libraries), os.environ.get("LD_LIBRARY_PATH")]))
        # Only a nightly compiler builds the standard library, or one that is told to.
        return {"RUSTC": str(root / "usr/bin/rustc"), "LD_LIBRARY_PATH": path, "RUSTC_BOOTSTRAP": "1"}


def remapped(places: dict[Path, str]) -> str:
    """Flags of rustc that leave folders of this machine out of the libraries."""
    return "\x1f".join(f"--remap-path-prefix={folder}={name}" for folder, name in places.items())


def artefacts(tools: Tools, platform: Platform, folder: Path, package: list[str], target: Path) -> list[dict]:
    """Builds; what cargo says of all that is made."""
    arguments, env = tools.environment(platform)
    cargo = Path(os.environ.get("CARGO_HOME") or Path.home() / ".cargo")
    env["CARGO_ENCODED_RUSTFLAGS"] = remapped({cargo: "cargo", tools.folder: "rust", folder.resolve(): "pilotage"})
    command = ["cargo", "build", "--target", platform.rust, "--target-dir", target, "--message-format=json-render-diagnostics"]
    printed = run(*command, *arguments, *package, env=env, cwd=folder)
    messages = map(json.loads, printed.splitlines())
    return [message for message in messages if message["reason"] == "compiler-artifact"]


def build(tools: Tools, platform: Platform, folder: Path, package: list[str], target: Path) -> Path:
    """Builds a library; where it is."""
    built = [m for m in artefacts(tools, platform, folder, package, target) if "cdylib" in m["target"]["crate_types"]]
    if not built:
        sys.exit(f"error: {folder} makes no shared library; its Cargo.toml needs `crate-type = [\"cdylib\"]` below `[lib]`")
    ending = platform.library.rsplit(".", 1)[1]
    return next(Path(name) for name in built[-1]["filenames"] if name.endswith(f".{ending}"))


def embedded(tools: Tools, chosen: list[Platform], out: Path, target: Path) -> None:
    """An archive for each package, which build.rs embeds."""
    for package in PACKAGES:
        archive = out / f"{package}.zip"
        part = archive.with_suffix(".part")
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
            for platform in chosen:
                library = build(tools, platform, ROOT, ["--package", package, "--profile", PROFILE, "--locked"], target)
                content = library.read_bytes()
                # Without a time, the same libraries give the same archive.
                file.writestr(zipfile.ZipInfo(platform.tuple), content, zipfile.ZIP_DEFLATED)
                deflated = file.getinfo(platform.tuple).compress_size
                print(f"{len(content) / 1e6:8.2f} MB, deflated {deflated / 1e6:.2f} MB  {package} for {platform.fmi2}", flush=True)
        part.replace(archive)
        print(f"{archive.stat().st_size / 1e6:8.2f} MB  {archive}")
    print(f"next: PILOTAGE_FMU_PLATFORMS={out} cargo build --release")


def values(tools: Tools, chosen: list[Platform], out: Path, target: Path) -> None:
    """A program that runs FMUs, for tests of them by emulators (tests/it/tools/platforms.rs)."""
    package = ["--package", "pilotage-fmi", "--example", "values", "--profile", "quick", "--locked"]
    for platform in chosen:
        built = [m["executable"] for m in artefacts(tools, platform, ROOT, package, target) if m.get("executable")]
        place = out / f"values-{platform.tuple}{Path(built[-1]).suffix}"
        place.write_bytes(Path(built[-1]).read_bytes())
        place.chmod(0o755)
        print(f"{place.stat().st_size / 1e6:8.2f} MB  {place}")


def packed(tools: Tools, chosen: list[Platform], folder: Path, out: Path, target: Path) -> None:
    """Libraries of a crate of one's own, and how `pilotage pack` takes them."""
    settings = ["--release", "--config", 'profile.release.panic="unwind"', "--config", f'patch.crates-io.pilotage-sdk.path="{ROOT}/fmu/sdk"']
    words = []
    for platform in chosen:
        library = build(tools, platform, folder, settings, target)
        place = out / platform.tuple / library.name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(library.read_bytes())
        if platform.fmi2 != "linux64":
            words += ["--binary", f"{platform.tuple}={place}"]
    print(shlex.join(["pilotage", "pack", str(folder), *words]))


def main() -> None:
    if sys.argv[1:2] == ["--link"]:
        return link(sys.argv[2], sys.argv[3:])
    names = [platform.fmi2 for platform in PLATFORMS]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--platforms", default=",".join(names), help=f"some of {', '.join(names)} [default: all]")
    parser.add_argument("--out", type=Path, help="the folder [default: platforms in the target folder]")
    parser.add_argument("--crate", type=Path, help="the folder of a model in Rust, instead of pilotage's own libraries")
    parser.add_argument("--values", action="store_true", help="a program that runs FMUs, for tests, instead of libraries")
    parser.add_argument("--std", choices=["rustup", "debian"], default="rustup", help="where a standard library is looked for first")
    options = parser.parse_args()
    wanted = options.platforms.split(",")
    if unknown := set(wanted) - set(names):
        parser.error(f"there is no platform {', '.join(sorted(unknown))}; known are {', '.join(names)}")
    chosen = [platform for platform in PLATFORMS if platform.fmi2 in wanted]
    metadata = json.loads(run("cargo", "metadata", "--no-deps", "--format-version=1"))
    folder = Path(metadata["target_directory"])
    out = (options.out or folder / "platforms").resolve()
    out.mkdir(parents=True, exist_ok=True)
    try:
        tools = Tools((folder / "platforms-tools").resolve(), options.std)
        if options.crate:
            packed(tools, chosen, options.crate.resolve(), out, folder / "platforms-build")
        elif options.values:
            values(tools, chosen, out, folder / "platforms-build")
        else:
            embedded(tools, chosen, out, folder / "platforms-build")
    except (OSError, subprocess.SubprocessError) as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
