//! `pilotage demo`: the complete workflow on the six example trials, into a new folder.

use super::deadline::Deadline;
use super::fit::{self, Task, Watch};
use super::made::{made, program, quoted};
use super::{Failure, Outcome, folder, overwrite, terminal, validate};
use crate::cosim::{Algorithm, Clock, CsvRecorder, Ending, FmuComponent, System};
use crate::estimation::fit::alone::alone;
use crate::estimation::{Fit, Posed};
use crate::export::{Export, Provenance};
use crate::flights::trials::TrialSet;
use crate::flights::{self, FlightOptions};
use crate::models::{Model, Quadcopter, TextModel};
use crate::report::figure::{Figure, Look, Panel};
use crate::report::{self, palette::colour};
use crate::series::Series;
use crate::vehicle;
use pilotage_text::counted;
use pilotage_text::number::significant;
use std::path::PathBuf;

/// Arguments of `pilotage demo`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the results.
    #[arg(short, long, value_name = "FOLDER", default_value = "pilotage-demo")]
    output: PathBuf,
    /// Write into a folder that is not empty.
    #[arg(long)]
    force: bool,
}

macro_rules! trials {
    ($($name:literal),*) => {
        [$(($name, include_bytes!(concat!("../../examples/trials/", $name)).as_slice())),*]
    };
}

/// The files of `examples/trials`, embedded in the binary.
const TRIALS: [(&str, &[u8]); 7] = trials![
    "trials.toml",
    "10m-run1.csv",
    "10m-run2.csv",
    "10m-run3.csv",
    "20m-run1.csv",
    "20m-run2.csv",
    "20m-run3.csv"
];

/// Communication step of the co-simulations [s].
const STEP: f64 = 0.01;

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    folder::create_new(&args.output, args.force)?;
    let demo = Demo {
        folder: args.output,
    };
    let task = demo.task()?;
    let posed = Posed::new(&task.file, &flights::open)?;
    let found = demo.fit(&task, &posed)?;
    demo.export()?;
    let valid = demo.validate()?;
    let loops = demo.co_simulate(&task)?;
    let alone = alone(&posed, &found, &|| false);
    let outcome = fit::Outcomes {
        alone: alone.as_deref(),
        ..fit::outcomes((&posed, &found), &[])
    };
    let page = fit::page(&outcome, vec![figure(&task, &loops)], &made());
    demo.save("report.html", page.as_bytes())?;
    print_step("report", "report.html")?;
    terminal::print(&demo.what_lies_where(&loops))?;
    Ok(match found.is_answer() && valid {
        true => Outcome::Done,
        false => Outcome::No,
    })
}

/// A co-simulation to one target.
struct Flight {
    target: f64,
    file: String,
    series: Series,
}

struct Demo {
    folder: PathBuf,
}

impl Demo {
    fn path(&self, file: &str) -> PathBuf {
        self.folder.join(file)
    }

    fn save(&self, file: &str, content: &[u8]) -> Result<(), Failure> {
        overwrite::save(&self.path(file), content)
    }

    /// Writes the example trials and reads them like a user's.
    fn task(&self) -> Result<Task, Failure> {
        folder::create_new(&self.path("trials"), true)?;
        for (file, content) in TRIALS {
            self.save(&format!("trials/{file}"), content)?;
        }
        let trials = TrialSet::read(&[self.path("trials/trials.toml")])?;
        print_step("trials", &format!("{} recorded flights", trials.fit.len()))?;
        Task::of_flights(trials, FlightOptions::default())
    }

    fn fit(&self, task: &Task, posed: &Posed<'_>) -> Result<Fit, Failure> {
        let (_, mut found, _) = fit::solved(posed, Watch::new(Deadline::after(None), None, false));
        task.doubt(&mut found);
        for own in fit::planned(posed, Some(&self.path("pilot.toml")))? {
            own.write(posed, &found)?;
        }
        self.save(
            "vehicle.toml",
            vehicle::to_toml(&Quadcopter::default()).as_bytes(),
        )?;
        let unknowns = found
            .solved
            .as_ref()
            .map(|own| own.solution.iterate.z.len());
        print_step(
            "fit",
            &format!(
                "{}: {}, {}, {} s; rms residual {} m",
                found.verdict(),
                counted(unknowns.unwrap_or_default(), "unknown"),
                counted(found.refinement.iterations, "iteration"),
                significant(found.seconds.total(), 3),
                significant((found.chi2 / found.samples as f64).sqrt(), 3)
            ),
        )?;
        for own in &found.diagnostics {
            print_step("", &format!("diagnostic [{}]: {own}", own.code()))?;
        }
        Ok(found)
    }

    fn export(&self) -> Result<(), Failure> {
        let pilot = TextModel::read(&self.path("pilot.toml"))?;
        let own = &pilot.compiled().file;
        let mut provenance = Provenance::model_file("pilot.toml", &own.source);
        provenance.caveat = own.fit.as_ref().and_then(|fit| fit.caveat());
        Export::text(&pilot, &provenance).write(&self.path("pilot.fmu"))?;
        let vehicle = Model::quadcopter(&Quadcopter::default());
        Export::new(&vehicle, &Provenance::vehicle(None)).write(&self.path("quadcopter.fmu"))?;
        print_step("export", "pilot.fmu and quadcopter.fmu")
    }

    fn validate(&self) -> Result<bool, Failure> {
        let mut valid = true;
        for file in ["pilot.fmu", "quadcopter.fmu"] {
            let report = validate::check(&self.path(file), Some(validate::TIME_LIMIT))?;
            valid &= report.is_valid();
            if !report.is_clean() {
                terminal::print(&validate::to_text(&report))?;
            }
        }
        let verdict = match valid {
            true => "both FMUs follow FMI 2.0, and their binaries run",
            false => "NOT VALID: see above",
        };
        print_step("validate", verdict)?;
        Ok(valid)
    }

    /// Simulates a flight to each target of the trials.
    fn co_simulate(&self, task: &Task) -> Result<Vec<Flight>, Failure> {
        let mut flights: Vec<Flight> = Vec::new();
        for trial in task.trials() {
            let target = trial.summary().target;
            if flights.iter().any(|flight| flight.target == target) {
                continue;
            }
            let file = format!("closed-loop-{target}m.csv");
            let csv = self.fly(target, trial.summary().duration)?;
            self.save(&file, &csv)?;
            let series = Series::parse(&csv, &file)?;
            let position = series.column("quadcopter.z").map(|z| &z.values);
            let last = position.and_then(|z| z.last()).copied().unwrap_or(f64::NAN);
            print_step(
                "cosim",
                &format!("to {target} m: the vehicle ends at {last:.2} m"),
            )?;
            flights.push(Flight {
                target,
                file,
                series,
            });
        }
        Ok(flights)
    }

    /// Co-simulates the pilot's FMU and the quadcopter's FMU; returns the result as CSV.
    fn fly(&self, target: f64, duration: f64) -> Result<Vec<u8>, Failure> {
        let mut system = System::new();
        for name in ["pilot", "quadcopter"] {
            let component = FmuComponent::open(&self.path(&format!("{name}.fmu")), name)?;
            system.add(name, Box::new(component))?;
        }
        system.connect("pilot.stick", "quadcopter.stick")?;
        system.connect("quadcopter.z", "pilot.position")?;
        system.set("pilot.target", &target.to_string())?;
        let clock = Clock::new(0.0, duration, STEP)?;
        let mut recorder = CsvRecorder::new(Vec::new());
        let run = crate::cosim::run(system, &clock, None, Algorithm::GaussSeidel, &mut recorder)?;
        if !matches!(run.ending, Ending::Completed) {
            return Err(Failure::new(format!(
                "the co-simulation to {target} m ended at {} s: {:?}",
                run.time, run.ending
            )));
        }
        (recorder.finish()).map_err(|error| Failure::new(format!("cannot write a row: {error}")))
    }

    fn what_lies_where(&self, flights: &[Flight]) -> String {
        let results: Vec<&str> = flights.iter().map(|flight| flight.file.as_str()).collect();
        let rows = [
            (
                "report.html",
                "look at this first: the fit, the closed loop, all numbers",
            ),
            ("pilot.toml", "θ, and where it comes from"),
            (
                "vehicle.toml",
                "the vehicle that was flown; change it and fit again",
            ),
            (
                "pilot.fmu, quadcopter.fmu",
                "for any tool that reads FMI 2.0",
            ),
            (&results.join(", "), "what the two FMUs do together"),
            ("trials/", "the six recorded flights"),
        ];
        let width = rows
            .iter()
            .map(|(file, _)| file.chars().count())
            .max()
            .unwrap_or(0);
        let rows: String = (rows.iter())
            .map(|(file, what)| format!("  {file:<width$}  {what}\n"))
            .collect();
        let (folder, program) = (quoted(&self.folder.to_string_lossy()), program());
        format!(
            "\n{folder}/\n{rows}\nnext: {program} cosim {folder}/pilot.fmu {folder}/quadcopter.fmu \\\n          \
             --connect pilot.stick=quadcopter.stick --connect quadcopter.z=pilot.position \\\n          \
             --set pilot.target=15 --stop-time 15 --step 0.01 -o result.csv\n      \
             {program} fit YOUR-TRIALS.csv -o pilot.toml\n"
        )
    }
}

/// Prints one line of progress.
fn print_step(step: &str, what: &str) -> Result<(), Failure> {
    terminal::print(&format!("{step:<9} {what}\n"))
}

/// What the two FMUs do together, and the recordings.
fn figure(task: &Task, flights: &[Flight]) -> Figure {
    let recorded = task.trials().iter().flat_map(|own| {
        let line = |label: &str, colour: &str, values: &[f64]| {
            report::figure::Series::line(label, colour, &own.time, values)
        };
        [
            line("goal", "goal", &own.target).looks(Look::Dashed),
            line("recorded", "data", &own.position),
        ]
    });
    let flown = |column: &str| -> Vec<report::figure::Series> {
        let line = |(k, own): (usize, &Flight)| {
            let values = &own.series.column(column)?.values;
            let label = format!("FMUs, {} m", own.target);
            let line = report::figure::Series::line(&label, colour(k), &own.series.time, values);
            Some(line)
        };
        flights.iter().enumerate().filter_map(line).collect()
    };
    let positions = recorded.chain(flown("quadcopter.z")).collect();
    let caption = "The exported FMUs of pilot and vehicle, coupled by the master, from rest.";
    let mut figure = Figure::of(
        "closed-loop",
        "Closed loop",
        caption,
        Panel::over_time("position [m]", 300.0, positions),
    );
    figure
        .panels
        .push(Panel::over_time("stick", 220.0, flown("pilot.stick")));
    figure
}
