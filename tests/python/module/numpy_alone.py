"""Where NumPy alone is installed: a fit, a simulation, and what needs more says so."""

import pilotage as pl
from common import FLIGHTS, ROOT

fit = pl.fit(FLIGHTS[:2])
assert fit.params.dtype.names[:2] == ("name", "value"), fit.params.dtype
assert dict(zip(fit.params["name"], fit.params["value"], strict=True)) == fit.values
assert "img" not in fit._repr_html_()
result = pl.simulate(ROOT / "examples/systems/loop.toml", stop_time=1, step=0.1)
assert result.to_numpy().dtype.names[0] == "time"
assert result._repr_html_() is None
for call in (result.to_frame, fit.plot, fit.to_control):
    try:
        call()
    except ModuleNotFoundError:
        continue
    raise AssertionError(f"{call} needs more")
