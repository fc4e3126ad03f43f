"""Runs an `OspSystemStructure.xml` in libcosim: osp.py FILE STOP

Prints `value instance.variable VALUE` for all outputs at the end, with all digits, among what libcosim says.
"""

import sys

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

OUTPUT = 2

execution = CosimExecution.from_osp_config_file(osp_path=sys.argv[1])
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.simulate_until(round(float(sys.argv[2]) * 1_000_000_000))
for own in execution.slave_infos():
    for variable in execution.slave_variables(slave_index=own.index):
        if variable.causality == OUTPUT:
            (value,) = observer.last_real_values(own.index, [variable.reference])
            print(f"value {own.name.decode()}.{variable.name.decode()} {value!r}")
