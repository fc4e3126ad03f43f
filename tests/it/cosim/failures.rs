//! Whatever a component does wrong, under every algorithm: the rows until then are kept, and it is named.

use super::components::{Linear, simulate};
use pilotage::cosim::component::ComponentError;
use pilotage::cosim::{
    Abilities, Algorithm, Clock, Component, Control, Coupling, Ending, Experiment, Progress,
    System, Value, ValueKind, Variable,
};

/// What goes wrong in the step that begins at 0.5 s or later.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Error,
    Discard,
    DiscardOutside,
    End,
    EndInThePast,
    NotANumber,
    Infinite,
    CannotSet,
    CannotGet,
    CannotRestore,
}

/// A component that misbehaves.
struct Faulty {
    inner: Linear,
    fault: Fault,
    is_due: bool,
}

impl Faulty {
    fn check(&self, fault: Fault) -> Result<(), ComponentError> {
        match self.is_due && self.fault == fault {
            true => Err("out of order".into()),
            false => Ok(()),
        }
    }
}

impl Component for Faulty {
    fn variables(&self) -> &[Variable] {
        self.inner.variables()
    }

    fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
        self.inner.setup(experiment)
    }

    fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
        self.check(Fault::CannotSet)?;
        self.inner.set_reals(handles, values)
    }

    fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
        self.check(Fault::CannotGet)?;
        self.inner.get_reals(handles, values)?;
        match self.fault {
            Fault::NotANumber if self.is_due => values[0] = f64::NAN,
            Fault::Infinite if self.is_due => values[0] = f64::NEG_INFINITY,
            _ => {}
        }
        Ok(())
    }

    fn set(&mut self, handle: u32, value: &Value) -> Result<(), ComponentError> {
        self.inner.set(handle, value)
    }

    fn get(&mut self, handle: u32, kind: ValueKind) -> Result<Value, ComponentError> {
        self.inner.get(handle, kind)
    }

    fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
        self.is_due = t > 0.5 - 1e-9;
        if !self.is_due {
            return self.inner.step(t, h);
        }
        let reached = t + h / 4.0;
        match self.fault {
            Fault::Error => Err("the solver failed".into()),
            Fault::Discard => Ok(Progress::Discarded { reached }),
            Fault::DiscardOutside => Ok(Progress::Discarded {
                reached: t + 2.0 * h,
            }),
            Fault::End => Ok(Progress::EndRequested { reached }),
            Fault::EndInThePast => Ok(Progress::EndRequested { reached: t - 1.0 }),
            _ => self.inner.step(t, h),
        }
    }

    fn abilities(&self) -> Abilities {
        self.inner.abilities()
    }

    fn save(&mut self, place: usize) -> Result<(), ComponentError> {
        self.inner.save(place)
    }

    fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
        self.check(Fault::CannotRestore)?;
        self.inner.restore(place)
    }
}

fn system(fault: Fault) -> System {
    let mut system = System::new();
    let good = Linear::new(-1.0, 1.0, 1.0, 0.0).from(1.0).revocable();
    let faulty = Faulty {
        inner: Linear::new(-0.5, -2.0, 1.0, 0.0).from(0.25).revocable(),
        fault,
        is_due: false,
    };
    system.add("good", Box::new(good)).unwrap();
    system.add("bad", Box::new(faulty)).unwrap();
    system.connect("good.y", "bad.u").unwrap();
    system.connect("bad.y", "good.u").unwrap();
    system
}

fn describe(ending: &Ending) -> String {
    match ending {
        Ending::EndRequested { instance, time } => format!("{instance} wants the end at {time}"),
        Ending::Discarded {
            instance,
            time,
            reached,
            ..
        } => format!("{instance} discarded at {time}, reached {reached}"),
        Ending::Failed {
            instance,
            time,
            stage,
            source,
        } => format!("{instance} failed to {stage} at {time}: {source}"),
        other => format!("{other:?}"),
    }
}

#[test]
fn rows_are_kept_and_the_culprit_is_named() {
    let clock = Clock::new(0.0, 1.0, 0.125).unwrap();
    let controlled = Coupling {
        control: Some(Control::new(1e-3, &clock)),
        ..Algorithm::Strong.into()
    };
    for (fault, expected) in [
        (Fault::Error, "bad failed to step at 0.5: the solver failed"),
        (Fault::Discard, "bad discarded at 0.5, reached 0.53125"),
        (
            Fault::DiscardOutside,
            "bad failed to step at 0.5: it says that it stands at 0.75 s, outside the step from 0.5 s to 0.625 s",
        ),
        (Fault::End, "bad wants the end at 0.53125"),
        (
            Fault::EndInThePast,
            "bad failed to step at 0.5: it says that it stands at -0.5 s, outside the step from 0.5 s to 0.625 s",
        ),
        (
            Fault::NotANumber,
            "bad failed to give its outputs at 0.5: `y` is NaN and feeds others",
        ),
        (
            Fault::Infinite,
            "bad failed to give its outputs at 0.5: `y` is -inf and feeds others",
        ),
        (
            Fault::CannotGet,
            "bad failed to give its outputs at 0.5: out of order",
        ),
    ] {
        let has_come_further = [Fault::End, Fault::Discard].contains(&fault);
        for algorithm in [Algorithm::Jacobi, Algorithm::GaussSeidel, Algorithm::Strong] {
            let (run, recorder) = simulate(system(fault), 1.0, 0.125, algorithm);
            assert_eq!(describe(&run.ending), expected, "{algorithm}");
            let mut times = vec![0.0, 0.125, 0.25, 0.375, 0.5];
            if has_come_further {
                times.push(0.53125);
            }
            assert_eq!(run.steps, 4, "{algorithm}, {fault:?}");
            assert_eq!(Some(&run.time), times.last(), "{algorithm}, {fault:?}");
            let series = &recorder.series;
            assert_eq!(series.time, times, "{algorithm}, {fault:?}");
            for column in &series.columns {
                assert_eq!(column.values.len(), times.len());
                assert!(column.values.iter().all(|value| value.is_finite()));
            }
        }
        // Steps of other lengths; a discarded one is tried again until it is the shortest allowed.
        let (run, recorder) = simulate(system(fault), 1.0, 0.125, controlled);
        let words = describe(&run.ending);
        assert!(words.starts_with("bad "), "{words}");
        let rows = 5 + usize::from(has_come_further);
        assert_eq!(
            (run.steps, recorder.series.time.len()),
            (4, rows),
            "{words}"
        );
        if fault == Fault::Discard {
            assert!(
                words.starts_with("bad discarded at 0.5, reached 0.50000000"),
                "{words}"
            );
            assert!(run.report.steps.rejected > 10);
        }
    }
    // These show one step later, or with rollback only.
    let (run, _) = simulate(system(Fault::CannotSet), 1.0, 0.125, Algorithm::Jacobi);
    assert_eq!(
        describe(&run.ending),
        "bad failed to take its inputs at 0.625: out of order"
    );
    let (run, _) = simulate(system(Fault::CannotRestore), 1.0, 0.125, Algorithm::Strong);
    let words = "bad failed to go back to a saved state at 0.5: out of order";
    assert_eq!((describe(&run.ending).as_str(), run.steps), (words, 4));
}

/// A component that discards steps longer than it can do is stepped in shorter ones under control.
#[test]
fn discarded_steps_are_shortened_under_control() {
    struct Short(Linear);
    impl Component for Short {
        fn variables(&self) -> &[Variable] {
            self.0.variables()
        }
        fn setup(&mut self, experiment: &Experiment) -> Result<(), ComponentError> {
            self.0.setup(experiment)
        }
        fn set_reals(&mut self, handles: &[u32], values: &[f64]) -> Result<(), ComponentError> {
            self.0.set_reals(handles, values)
        }
        fn get_reals(&mut self, handles: &[u32], values: &mut [f64]) -> Result<(), ComponentError> {
            self.0.get_reals(handles, values)
        }
        fn step(&mut self, t: f64, h: f64) -> Result<Progress, ComponentError> {
            match h > 0.03 {
                true => Ok(Progress::Discarded { reached: t + 0.02 }),
                false => self.0.step(t, h),
            }
        }
        fn abilities(&self) -> Abilities {
            self.0.abilities()
        }
        fn save(&mut self, place: usize) -> Result<(), ComponentError> {
            self.0.save(place)
        }
        fn restore(&mut self, place: usize) -> Result<(), ComponentError> {
            self.0.restore(place)
        }
    }
    let mut system = System::new();
    let component = Short(Linear::new(-1.0, 0.0, 1.0, 0.0).from(1.0).revocable());
    system.add("short", Box::new(component)).unwrap();
    let clock = Clock::new(0.0, 1.0, 0.1).unwrap();
    let coupling = Coupling {
        control: Some(Control::new(1e-2, &clock)),
        ..Algorithm::Jacobi.into()
    };
    let (run, recorder) = simulate(system, 1.0, 0.1, coupling);
    assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
    let y = recorder.series.columns[0].values[10];
    assert!((y - (-1.0_f64).exp()).abs() < 1e-12);

    // Strong coupling takes further steps for its estimate of the error, which are discarded too: x'' + x' + x = 0.
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let mut system = System::new();
        let short = Short(Linear::new(-1.0, -1.0, 1.0, 0.0).from(1.0).revocable());
        system.add("short", Box::new(short)).unwrap();
        let other = Linear::new(0.0, 1.0, 1.0, 0.0).revocable();
        system.add("other", Box::new(other)).unwrap();
        system.connect("short.y", "other.u").unwrap();
        system.connect("other.y", "short.u").unwrap();
        let coupling = Coupling {
            control: Some(Control::new(tolerance, &clock)),
            ..Algorithm::Strong.into()
        };
        let (run, recorder) = simulate(system, 1.0, 0.1, coupling);
        assert!(matches!(run.ending, Ending::Completed), "{:?}", run.ending);
        let w = 0.75_f64.sqrt();
        let x = (-0.5_f64).exp() * (w.cos() - 0.5 / w * w.sin());
        let error = (recorder.series.column("short.y").unwrap().values[10] - x).abs();
        assert!(error < 0.1 * tolerance + 1e-4, "{tolerance}: {error}");
    }
    assert!(run.report.steps.longest <= 0.03);
    assert!(run.report.steps.rejected > 0);
}
