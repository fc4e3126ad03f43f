//! The iterations of a fit as a table on stderr, with the column names usual in SQP and interior-point solvers.

use super::watch::Iterate;
use crate::cli::terminal::eprint;

/// Number of lines between two headers.
const PAGE: usize = 20;

const HEADER: &str = "start  mesh  iter     objective    inf_pr    inf_du     compl     alpha     |d|    lg(rg)   penalty \
                      active  hessian";

/// Prints one line for each iteration.
#[derive(Default)]
pub struct IterationTable {
    lines: usize,
}

impl IterationTable {
    /// Prints an iteration.
    pub fn show(&mut self, iterate: &Iterate) {
        let mut text = String::new();
        if self.lines.is_multiple_of(PAGE) {
            text += HEADER;
            text += "\n";
        }
        self.lines += 1;
        text += &line(iterate);
        eprint(&text);
    }
}

fn line(iterate: &Iterate) -> String {
    let i = iterate.iteration;
    let damping = match i.damping > 0.0 {
        true => format!("{:.1}", i.damping.log10()),
        false => "-".into(),
    };
    format!(
        "{:>5} {:>5} {:>5} {:>13.6e} {:>9.2e} {:>9.2e} {:>9.2e} {:>9.2e} {:>7.0e} {damping:>9} {:>9.2e} {:>6}  {}\n",
        iterate.start + 1,
        iterate.refinement,
        i.number,
        iterate.objective,
        i.kkt.primal,
        i.kkt.dual,
        i.kkt.complementarity,
        i.step,
        i.length,
        i.penalty,
        i.active,
        i.model.as_str(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sqp::{Iteration, Kkt, StepModel};

    #[test]
    fn lines_stand_below_the_header() {
        let iteration = Iteration {
            number: 12,
            objective: -268.25,
            kkt: Kkt {
                dual: 1e-3,
                primal: 2.5e-9,
                complementarity: 0.0,
            },
            step: 0.5,
            length: 0.031,
            damping: 1e-4,
            penalty: 17.0,
            active: 41,
            model: StepModel::GaussNewton,
        };
        let text = line(&Iterate {
            start: 1,
            starts: 4,
            refinement: 0,
            objective: iteration.objective,
            iteration: &iteration,
        });
        insta::assert_snapshot!(format!("{HEADER}\n{text}"), @"
        start  mesh  iter     objective    inf_pr    inf_du     compl     alpha     |d|    lg(rg)   penalty active  hessian
            2     0    12   -2.682500e2   2.50e-9   1.00e-3    0.00e0   5.00e-1    3e-2      -4.0    1.70e1     41  gauss-newton
        ");
    }
}
