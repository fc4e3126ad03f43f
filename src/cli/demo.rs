//! `pilotage demo`: the complete workflow on the six example trials, into a new folder.

use super::deadline::Deadline;
use super::fit::{Watch, summary};
use super::made::{made, program, quoted};
use super::{Failure, Outcome, folder, overwrite, terminal, validate};
use crate::cosim::{Algorithm, Clock, CsvRecorder, Ending, FmuComponent, System};
use crate::export::{Export, Provenance};
use crate::flights::pilot::PilotFile;
use crate::identification::{Fit, FitOptions, Identification, Trial, TrialSet, pilot_file};
use crate::models::Model;
use crate::report::{self, ClosedLoop, Report};
use crate::series::Series;
use crate::vehicle;
use pilotage_inference::statistics::rms;
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
        options: FitOptions::default(),
    };
    let trials = demo.trials()?;
    let found = demo.fit(trials)?;
    demo.export(&found.fit)?;
    let valid = demo.validate()?;
    let loops = demo.co_simulate(&found.trials.fit)?;
    demo.report(&found, &loops)?;
    terminal::print(&demo.what_lies_where(&loops))?;
    Ok(match found.fit.is_answer() && valid {
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
    options: FitOptions,
}

impl Demo {
    fn path(&self, file: &str) -> PathBuf {
        self.folder.join(file)
    }

    fn save(&self, file: &str, content: &[u8]) -> Result<(), Failure> {
        overwrite::save(&self.path(file), content)
    }

    /// Writes the example trials and reads them like a user's.
    fn trials(&self) -> Result<TrialSet, Failure> {
        folder::create_new(&self.path("trials"), true)?;
        for (file, content) in TRIALS {
            self.save(&format!("trials/{file}"), content)?;
        }
        let trials = TrialSet::read(&[self.path("trials/trials.toml")])?;
        print_step("trials", &format!("{} recorded flights", trials.fit.len()))?;
        Ok(trials)
    }

    fn fit(&self, trials: TrialSet) -> Result<Identification, Failure> {
        let mut watch = Watch::new(Deadline::after(None), None, false);
        let options = self.options.clone();
        let found = Identification::new(trials, options, &mut |progress| watch.flights(progress));
        watch.end();
        let found = found?;
        let fitted = &found.fit;
        let text = pilot_file::to_toml(&found);
        self.save("pilot.toml", text.as_bytes())?;
        self.save(
            "vehicle.toml",
            vehicle::to_toml(&self.options.vehicle).as_bytes(),
        )?;
        let verdict = summary::verdict(fitted);
        let residual = rms(fitted.runs.iter().flat_map(|run| &run.residual));
        print_step(
            "fit",
            &format!(
                "{verdict}: {}, {}, {} s; rms residual {} m",
                counted(fitted.unknowns, "unknown"),
                counted(fitted.iterations, "iteration"),
                significant(fitted.seconds, 3),
                significant(residual, 3)
            ),
        )?;
        for diagnostic in &fitted.diagnostics {
            print_step(
                "",
                &format!("diagnostic ({}): {diagnostic}", diagnostic.code()),
            )?;
        }
        Ok(found)
    }

    fn export(&self, fit: &Fit) -> Result<(), Failure> {
        let text = crate::document::read(&self.path("pilot.toml"))?;
        let pilot = PilotFile::parse(&text, "pilot.toml")?;
        let provenance = Provenance::fit(text, pilot.is_stable_loop(), pilot.caveat());
        let model = Model::pilot(&fit.theta, self.options.stick_limit);
        Export::new(&model, &provenance).write(&self.path("pilot.fmu"))?;
        let vehicle = Model::quadcopter(&self.options.vehicle);
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
    fn co_simulate(&self, trials: &[Trial]) -> Result<Vec<Flight>, Failure> {
        let mut flights: Vec<Flight> = Vec::new();
        for trial in trials {
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

    fn report(&self, found: &Identification, flights: &[Flight]) -> Result<(), Failure> {
        let loops: Vec<ClosedLoop> = (flights.iter())
            .map(|flight| ClosedLoop {
                target: flight.target,
                series: &flight.series,
                position: "quadcopter.z",
                stick: "pilot.stick",
            })
            .collect();
        let page = report::page(&Report {
            found,
            refits: None,
            profiles: None,
            loops: &loops,
            made: &made(),
        });
        self.save("report.html", page.as_bytes())?;
        print_step("report", "report.html")
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
