//! What a fit is given: a problem file, or flights, whose problem the command writes for itself.

use super::{Args, Compared, start};
use crate::cli::{Failure, recognise, terminal, vehicle};
use crate::estimation::{Fit, ProblemFile};
use crate::flights::FlightOptions;
use crate::flights::checks::doubts;
use crate::flights::options::Objective;
use crate::flights::trials::{Trial, TrialSet};
use std::path::{Path, PathBuf};

/// A problem, and where it is from.
pub struct Task {
    /// The problem.
    pub file: ProblemFile,
    /// The flights that pose it, unless a file does.
    pub flights: Option<(TrialSet, FlightOptions)>,
    /// The files that it is read from.
    pub inputs: Vec<PathBuf>,
}

/// The problem file among the arguments, if there is one.
fn problem_of(args: &Args) -> Result<Option<&Path>, Failure> {
    let Some(problem) = args.trials.iter().find(|path| recognise::is_problem(path)) else {
        return Ok(None);
    };
    if args.trials.len() > 1 {
        let message = format!(
            "{} is a problem file, which names its runs itself",
            problem.display()
        );
        return Err(Failure::new(message).hint("give the problem file alone"));
    }
    if let Some((_, flag, place)) = args.of_flights {
        let message = format!("{flag} belongs to `pilotage fit run*.csv`");
        return Err(Failure::new(message).hint(format!("in a problem file {place}")));
    }
    Ok(Some(problem))
}

impl Task {
    /// The task of these arguments.
    pub fn of(args: &Args) -> Result<Self, Failure> {
        match problem_of(args)? {
            Some(path) => Self::of_file(path),
            None => {
                let set = args.columns.read(&args.trials)?;
                set.notes.iter().for_each(|note| terminal::note(note));
                Self::of_flights(set, args.flight_options()?)
            }
        }
    }

    /// That of a problem file.
    pub fn of_file(path: &Path) -> Result<Self, Failure> {
        Ok(Self {
            file: ProblemFile::read(path)?,
            flights: None,
            inputs: vec![path.to_owned()],
        })
    }

    /// That of flights.
    pub fn of_flights(set: TrialSet, options: FlightOptions) -> Result<Self, Failure> {
        let file = options.problem(&set)?;
        let vehicle = options.vehicle_file.iter();
        Ok(Self {
            file,
            inputs: set.files.iter().chain(vehicle).cloned().collect(),
            flights: Some((set, options)),
        })
    }

    /// Where the fitted model goes unless the user says so: `pilot.toml` for flights; for a problem file the instances have
    /// names of their own.
    pub fn default_output(&self) -> Option<&'static Path> {
        self.flights.as_ref().map(|_| Path::new("pilot.toml"))
    }

    /// The flights that are fitted; none of a problem file.
    pub fn trials(&self) -> &[Trial] {
        let flights = self.flights.as_ref();
        flights.map_or(&[], |(set, _)| &set.fit)
    }

    /// Adds what flights and vehicle let doubt of a fit. What makes it meaningless comes first.
    pub fn doubt(&self, fit: &mut Fit) {
        if let Some((set, options)) = &self.flights {
            let found = doubts(fit, set, options);
            fit.diagnostics.extend(found);
        }
        (fit.diagnostics).sort_by_key(|own| !own.is_fatal());
    }
}

impl Args {
    /// What the flags say of the problem that flights pose.
    fn flight_options(&self) -> Result<FlightOptions, Failure> {
        Ok(FlightOptions {
            order: usize::from(self.order),
            fit: FlightOptions::default().fit,
            theta: (self.start.as_deref().filter(|all| start::is_unnamed(all))).map(start::values),
            stick_limit: self.stick_limit,
            vehicle: vehicle::resolve(self.vehicle.as_deref())?,
            vehicle_file: self.vehicle.clone(),
            initial_state: self.initial_state,
            initial_position: self.initial_position,
            stable_loop: !self.allow_unstable_loop,
            objective: match self.objective {
                Compared::One(objective) => objective,
                Compared::Both => Objective::Response,
            },
            columns: self.columns.names()?,
        })
    }
}
