"""Fits in a notebook: verdict, parameters, figure."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._fit import Fit


def of_fit(fit: Fit) -> str:
    """The HTML of a fit."""
    doubts = "".join(f"<li><b>{escape(own.code)}</b> {escape(own.words)}</li>" for own in fit.diagnostics)
    return f"<p>{escape(fit.verdict)}</p>{table(fit)}<ul>{doubts}</ul>{figure(fit)}"


def table(fit: Fit) -> str:
    from ._fit import rows

    head = "".join(f"<th>{name}</th>" for name in ("", "value", "sd", "low", "high", "unit"))
    body = ""
    for name, value, sd, low, high, _, unit in [*rows(fit.json["parameters"]), *rows(fit.json["derived"])]:
        cells = "".join(f"<td>{number:.5g}</td>" for number in (value, sd, low, high))
        body += f"<tr><th>{escape(name)}</th>{cells}<td>{escape(unit)}</td></tr>"
    return f"<table><tr>{head}</tr>{body}</table>"


def figure(fit: Fit) -> str:
    """The plot as a picture; nothing without matplotlib."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        return ""
    own = Figure(figsize=(7, 3))
    FigureCanvasAgg(own)
    fit.plot(own)
    picture = BytesIO()
    own.savefig(picture, format="png", dpi=80)
    return f'<img alt="recorded and model" src="data:image/png;base64,{b64encode(picture.getvalue()).decode()}">'
