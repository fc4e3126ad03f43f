"""What FMI Library, the parser of FMUComplianceChecker, says of descriptions of FMI 2.0. libcosim carries it."""

import ctypes
import os
from pathlib import Path

import libcosimpy

library = ctypes.CDLL(str(Path(libcosimpy.__file__).parent / "libcosimc" / "libcosimc.so"))
c = ctypes.CDLL(None)
WARNING, INFO = 3, 4
LOGGER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p)


class Callbacks(ctypes.Structure):
    """`jm_callbacks`."""

    _fields_ = [(name, ctypes.c_void_p) for name in ["malloc", "calloc", "realloc", "free"]] + [
        ("logger", LOGGER),
        ("level", ctypes.c_int),
        ("context", ctypes.c_void_p),
        ("buffer", ctypes.c_char * 2000),
    ]


for name in ["fmi_import_allocate_context", "fmi2_import_parse_xml"]:
    getattr(library, name).restype = ctypes.c_void_p
library.fmi2_import_parse_xml.argtypes = [ctypes.c_void_p] * 3


def complaints(folder):
    """Errors and warnings of FMI Library about the description in a folder."""
    said = []

    @LOGGER
    def log(_callbacks, _module, level, message):
        if level <= WARNING:
            said.append(message.decode(errors="replace"))

    memory = [ctypes.cast(getattr(c, name), ctypes.c_void_p) for name in ["malloc", "calloc", "realloc", "free"]]
    callbacks = Callbacks(*memory, log, INFO)
    context = library.fmi_import_allocate_context(ctypes.byref(callbacks))
    read = library.fmi2_import_parse_xml(context, str(folder).encode(), None)
    if not read and not said:
        said.append("refused")
    return said


def of_child(folder):
    """As `complaints`, in a process of its own: FMI Library ends some."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        os.write(writing, "\n".join(complaints(folder)).encode())
        os._exit(0)
    os.close(writing)
    with open(reading, encoding="utf-8") as pipe:
        said = pipe.read().splitlines()
    _, status = os.waitpid(child, 0)
    return said + ["crashed"] * (status != 0)
