//! Tests of the input clocks of FMI 3.0: each ticks once, at its first possible time (section 2.2.9).

use super::subject::Subject;
use super::{Reporter, Stop};
use pilotage_abi::fmi3::IntervalQualifier;
use pilotage_fmi::InterfaceType;
use pilotage_fmi::description::{
    Causality, ClockAttributes, IntervalVariability, ModelDescription, VariableKind,
};
use pilotage_fmi::fmu::Library;

/// A clock and the time of its first tick.
struct Due {
    time: f64,
    reference: u32,
    name: String,
}

/// Whether there are clocks that the importer activates in event mode.
pub(super) fn are_there(description: &ModelDescription, kind: InterfaceType) -> bool {
    let cs = description.co_simulation.as_ref();
    let has_event_mode = match kind {
        InterfaceType::CoSimulation => cs.is_some_and(|cs| cs.has_event_mode),
        _ => kind == InterfaceType::ModelExchange,
    };
    has_event_mode && of(description, Causality::Input).next().is_some()
}

/// Value reference, name and attributes of the clocks with that causality.
fn of(
    description: &ModelDescription,
    causality: Causality,
) -> impl Iterator<Item = (u32, &str, &ClockAttributes)> {
    let clocks = description.variables.iter();
    let clocks = clocks.filter(move |v| v.causality == causality);
    clocks.filter_map(|v| match &v.kind {
        VariableKind::Clock { attributes, .. } => {
            Some((v.value_reference, v.name.as_str(), attributes))
        }
        _ => None,
    })
}

/// Time of the first tick of a periodic clock after the start, from its description \[s\].
fn shift(clock: &ClockAttributes) -> f64 {
    match (clock.interval_counter, clock.resolution) {
        (Some(_), Some(resolution)) => clock.shift_counter as f64 / resolution as f64,
        _ => clock.shift_decimal.into(),
    }
}

impl Reporter<'_> {
    /// Activates each input clock at its time, as far as steps can reach it.
    pub(super) fn clocks(&mut self, library: &Library) -> Result<(), Stop> {
        let mut subject = Subject::instantiate(library, "check", self)?;
        subject.enter_initialization(self)?;
        let mut due = subject.first_ticks(self)?;
        due.sort_by(|a, b| a.time.total_cmp(&b.time));
        self.stage("initializing");
        subject.instance.exit_initialization_mode()?;
        let (now, later) = due.split_at(due.partition_point(|d| d.time <= subject.time()));
        subject.tick(now, self)?;
        if !subject.begin(self)? || !subject.can_go_anywhere(self.kind) {
            return Ok(());
        }
        for together in later.chunk_by(|a, b| a.time == b.time) {
            if together[0].time > subject.stop() || !subject.step_to(together[0].time, self)? {
                break;
            }
            subject.instance.enter_event_mode()?;
            subject.tick(together, self)?;
            if !subject.leave_event_mode(self)? {
                break;
            }
        }
        Ok(())
    }
}

impl Subject {
    /// In initialization mode: first tick times of the input clocks, without those that the FMU does not know yet.
    fn first_ticks(&mut self, reporter: &mut Reporter) -> Result<Vec<Due>, Stop> {
        let description = self.description.clone();
        let mut due = Vec::new();
        for (reference, name, clock) in of(&description, Causality::Input) {
            reporter.stage(&format!("asking when the clock {name} ticks"));
            let after = match clock.interval_variability {
                IntervalVariability::Triggered => Some(0.0),
                IntervalVariability::Changing | IntervalVariability::Countdown => {
                    self.first_interval(reference, name, clock.interval_variability, reporter)?
                }
                // The description has it, so that an FMU may leave the function out.
                IntervalVariability::Constant => Some(shift(clock)),
                _ => self.instance.get_shifts(&[reference])?.pop(),
            };
            match after {
                Some(after) if !(after.is_finite() && after >= 0.0) => reporter.error(format!(
                    "the clock {name} first ticks {after} s after the start; it must be a finite time, not negative"
                )),
                Some(after) => due.push(Due {
                    time: self.time() + after,
                    reference,
                    name: name.to_owned(),
                }),
                None => {}
            }
        }
        Ok(due)
    }

    /// Time from the start to the first tick of an aperiodic clock; `None` if unknown, which is allowed only for a
    /// countdown clock.
    fn first_interval(
        &mut self,
        reference: u32,
        name: &str,
        variability: IntervalVariability,
        reporter: &mut Reporter,
    ) -> Result<Option<f64>, Stop> {
        let intervals = self.instance.get_intervals(&[reference])?;
        let known = intervals.first();
        let known = known.filter(|i| i.qualifier != IntervalQualifier::NOT_YET_KNOWN);
        if known.is_none() && variability == IntervalVariability::Changing {
            reporter.error(format!(
                "the interval of the clock {name} is not yet known, which that of a changing clock always is"
            ));
        }
        Ok(known.map(|interval| interval.value))
    }

    /// In event mode: activates these clocks and reads the output clocks.
    fn tick(&mut self, clocks: &[Due], reporter: &mut Reporter) -> Result<(), Stop> {
        if clocks.is_empty() {
            return Ok(());
        }
        let names: Vec<&str> = clocks.iter().map(|due| due.name.as_str()).collect();
        let (names, time) = (names.join(", "), self.time());
        reporter.stage(&format!("ticking {names} at {time} s"));
        let references: Vec<u32> = clocks.iter().map(|due| due.reference).collect();
        let on = vec![true; references.len()];
        self.instance.set_clocks(&references, &on)?;
        reporter.stage(&format!("reading output clocks when {names} ticks"));
        let description = self.description.clone();
        let outputs: Vec<u32> = (of(&description, Causality::Output))
            .map(|(reference, ..)| reference)
            .collect();
        let mut ticking = vec![false; outputs.len()];
        Ok(self.instance.get_clocks(&outputs, &mut ticking)?)
    }
}
