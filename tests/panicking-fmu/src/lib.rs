//! A model that panics when its input is positive: a faulty model must not end the tool that steps it.

use pilotage_sdk::{At, Equations, Scalar, Table};

/// Integrates its input until it panics.
#[derive(Default)]
struct Panicking;

impl Equations for Panicking {
    fn table(&self) -> Table {
        Table::new("panicking", "Panics when its input is positive.")
            .input("u", "1", "Input")
            .output_state("x", "1", 0.0, "Integral of the input")
    }

    fn derivative<T: Scalar>(&self, At { u, .. }: At<T>, dx: &mut [T]) {
        assert!(u[0].re() <= 0.0, "u is {}", u[0].re());
        dx[0] = u[0];
    }
}

pilotage_sdk::export!(Panicking);
