//! Runs FMUs and prints each value of each output with all digits: to compare machines.
//!
//!     cargo run -p pilotage-fmi --example values -- pilot.fmu quadcopter.fmu
//!
//! 200 steps of 0.05 s, by co-simulation and by model exchange, with real inputs that change at each step.

use pilotage_fmi::description::{Causality, ModelDescription, VariableKind};
use pilotage_fmi::{Fmu, Instance, InterfaceType, ModelExchangeRun, RunOptions, Step};
use std::error::Error;

const STEPS: u32 = 200;
const STEP: f64 = 0.05;

fn main() -> Result<(), Box<dyn Error>> {
    for path in std::env::args().skip(1) {
        for kind in [InterfaceType::CoSimulation, InterfaceType::ModelExchange] {
            let mut fmu = Fmu::open(path.as_ref())?;
            if fmu.kinds().iter().all(|(own, _)| *own != kind) {
                continue;
            }
            let description = fmu.description().clone();
            let instance = fmu.load()?.instantiate("values", kind)?;
            println!("{} {kind}", description.model_name);
            run(instance, &description, kind)?;
        }
    }
    Ok(())
}

fn run(
    mut instance: Instance,
    description: &ModelDescription,
    kind: InterfaceType,
) -> Result<(), Box<dyn Error>> {
    let inputs = reals(description, Causality::Input);
    let outputs = reals(description, Causality::Output);
    let input = |k: u32| -> Vec<f64> {
        let phase = f64::from(k % 40) / 40.0;
        let of = |own: usize| 0.1 * (own as f64 + 1.0) * (phase - 0.5);
        (0..inputs.len()).map(of).collect()
    };
    instance.setup_experiment(None, 0.0, None)?;
    instance.enter_initialization_mode()?;
    instance.set_real(&inputs, &input(0))?;
    instance.exit_initialization_mode()?;
    let mut values = vec![f64::NAN; outputs.len()];
    let time = |k: u32| STEP * f64::from(k);
    if kind == InterfaceType::CoSimulation {
        for k in 0..STEPS {
            instance.set_real(&inputs, &input(k))?;
            if instance.do_step(time(k), STEP)? != Step::Done {
                return Err("a step was not done".into());
            }
            instance.get_real(&outputs, &mut values)?;
            print(time(k + 1), &values);
        }
        return Ok(instance.terminate()?);
    }
    let mut run = ModelExchangeRun::new(instance, description, RunOptions::default());
    run.begin(0.0)?;
    for k in 0..STEPS {
        run.set_inputs(&inputs, &input(k), None)?;
        run.step_to(time(k + 1))?;
        run.instance().get_real(&outputs, &mut values)?;
        print(time(k + 1), &values);
    }
    Ok(run.instance().terminate()?)
}

/// Scalar real variables.
fn reals(description: &ModelDescription, causality: Causality) -> Vec<u32> {
    let wanted = description.variables.iter().filter(|variable| {
        variable.causality == causality
            && variable.dimensions.is_empty()
            && matches!(variable.kind, VariableKind::Real(_))
    });
    wanted.map(|variable| variable.value_reference).collect()
}

/// `{:?}` has all digits that tell a number from its neighbours.
fn print(time: f64, values: &[f64]) {
    let words: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    println!("{time:?} {}", words.join(" "));
}
