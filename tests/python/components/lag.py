"""FMI 2.0, by pythonfmu: dy/dt = (u - y) / T, exact while u is held; and an integer, a boolean, a text."""

import math

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String


class Lag(Fmi2Slave):
    """First order lag."""

    description = "First order lag"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 0.0
        self.y = 0.0
        self.T = 0.5
        self.steps = 0
        self.high = False
        self.text = "lag"
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        discrete = {"causality": Fmi2Causality.output, "variability": Fmi2Variability.discrete}
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Real("T", **fixed))
        self.register_variable(Integer("steps", **discrete))
        self.register_variable(Boolean("high", **discrete))
        self.register_variable(String("text", **discrete))

    def do_step(self, current_time, step_size):
        self.y = self.u + (self.y - self.u) * math.exp(-step_size / self.T)
        self.steps += 1
        self.high = self.y > 0.5
        return True
