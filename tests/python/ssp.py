"""An SSP in FMPy: validates it against the schemas of SSP 1.0, simulates 5 s in steps of 0.05 s, and prints the outputs.

The values of the components' bindings, which FMPy reads but does not apply by itself, are handed over as one set.

    python3 tests/python/ssp.py loop.ssp
"""

import sys

from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import ParameterSet, find_components, read_ssd

file = sys.argv[1]
ssd = read_ssd(file, validate=True)
values = ParameterSet(name="all")
for component in find_components(ssd.system):
    for binding in component.parameterBindings:
        for own in binding.parameterValues:
            for parameter in own.parameters:
                parameter.name = component.name + "." + parameter.name
                values.parameters.append(parameter)
# Half a step before the end: sums of steps are not exactly 5.
result = simulate_ssp(file, stop_time=5 - 0.025, step_size=0.05, parameter_set=values)
names = [component.name + ".y" for component in find_components(ssd.system)]
for row in result:
    print(*(repr(float(row[name])) for name in names))
