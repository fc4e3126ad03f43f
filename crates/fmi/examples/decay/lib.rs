//! The library of the FMU on the crate page: `ẋ = -k x`.

use pilotage_sdk::{At, Equations, Scalar, Table};

#[derive(Default)]
struct Decay;

impl Equations for Decay {
    fn table(&self) -> Table {
        Table::new("decay", "Exponential decay")
            .parameter("k", "1/s", 1.0, "Rate")
            .output_state("x", "1", 1.0, "What decays")
    }

    fn derivative<T: Scalar>(&self, at: At<T>, dx: &mut [T]) {
        dx[0] = -at.p[0] * at.x[0];
    }
}

pilotage_sdk::export!(Decay);
