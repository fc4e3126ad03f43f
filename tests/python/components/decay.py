"""FMI 3.0, by pythonfmu3: dx/dt = -k x, for model exchange and, by forward Euler, co-simulation."""

from pythonfmu3 import (
    CoSimulation,
    Float64,
    Fmi3Causality,
    Fmi3Initial,
    Fmi3SlaveBase,
    Fmi3Variability,
    ModelExchange,
)


class Decay(Fmi3SlaveBase, ModelExchange, CoSimulation):
    """Exponential decay."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        self.k = 1.0
        self.x = 1.0
        self.derx = 0.0
        continuous = {"variability": Fmi3Variability.continuous}
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, **continuous)
        )
        self.register_variable(
            Float64(
                "x", causality=Fmi3Causality.output, start=1, initial=Fmi3Initial.exact, **continuous
            )
        )
        self.register_variable(
            Float64("derx", causality=Fmi3Causality.local, derivative=1, **continuous)
        )
        self.register_variable(
            Float64("k", causality=Fmi3Causality.parameter, variability=Fmi3Variability.fixed)
        )

    def get_continuous_state_derivatives(self):
        self.derx = -self.k * self.x
        return [self.derx]

    def do_step(self, current_time, step_size):
        self.time = current_time + step_size
        self.x += -self.k * self.x * step_size
        return True
