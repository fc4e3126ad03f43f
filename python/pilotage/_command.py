"""The command in the wheel: it runs in the interpreter's process, which it ends.

Processes that it starts of itself, such as those of isolated FMUs, are this file run by the same interpreter, without what
`site` sets up: whatever is in the working folder or in the environment, they find the library beside this file.
"""

import signal
import sys
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

NAME = "_pilotage"


def before(name: str) -> list[str]:
    """Arguments of the interpreter that stand before those of the command, which is called by this name."""
    return ["-I", "-S", str(Path(__file__).resolve()), name]


def native() -> ModuleType:
    """The library beside this file."""
    own = ".".join(filter(None, [__package__, NAME]))
    if own in sys.modules:
        return sys.modules[own]
    found = sorted(Path(__file__).resolve().parent.glob(f"{NAME}.*so"))
    path = str(found[0]) if found else NAME
    loader = ExtensionFileLoader(own, path)
    spec = spec_from_file_location(own, path, loader=loader)
    if spec is None:
        raise ImportError(f"{path} is missing", name=own)
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


def main() -> None:
    """Runs the command with the arguments of this process, and ends it with the command's exit code."""
    run(sys.argv)


def run(words: list[str]) -> None:
    """Runs the command; its name is the first word."""
    # As for any command: Ctrl-C is the command's, unless the shell ignores it.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    native().main(sys.executable, before(words[0]), words)


if __name__ == "__main__":
    run(sys.argv[1:])
