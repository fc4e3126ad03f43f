//! Landings from single points: each as a flight, and as FMUs with a system file that repeats it.

use super::cases::{self, Case, Hands};
use super::numbers::Delay;
use super::{Args, DOTS, WIDTH};
use crate::cli::made::{made, program, quoted};
use crate::cli::{Failure, Outcome, folder, overwrite, system, terminal};
use crate::control::hv::{Landings, Manoeuvre};
use crate::cosim::{self, Algorithm, Clock, Ending, SeriesRecorder, SystemDescription};
use crate::export::{Export, Provenance};
use crate::models::TextModel;
use crate::report::figure::{Figure, Panel, Series as Line};
use crate::report::{PlainPage, plain_page};
use crate::series::{Column, Series};
use pilotage_text::number::significant;
use serde_json::{Value, json};
use std::path::Path;

/// How the FMUs are coupled, with the longest communication step \[s\]: without lag, and where that overshoots a jump of the
/// commands, which a pilot without states hands on at once, in shorter steps.
const COUPLINGS: [(Algorithm, f64); 2] =
    [(Algorithm::Strong, 0.005), (Algorithm::GaussSeidel, 0.001)];
/// Difference of S from which the co-simulation is another flight.
const AGREEMENT: f64 = 0.02;

/// A landing and what the co-simulation of its FMUs makes of it.
struct Flown<'a> {
    case: &'a Case,
    at: [f64; 2],
    delay: f64,
    manoeuvre: Manoeuvre,
    /// Static gains that were divided out of the pilot.
    gains: Option<[f64; 2]>,
    replayed: Replayed,
}

/// The co-simulation of the FMUs.
#[derive(Clone, Copy)]
struct Replayed {
    /// S at touch-down; NaN where the FMUs did not come to the ground, or the states are no outputs.
    s: f64,
    algorithm: Algorithm,
    step: f64,
    stop: f64,
}

/// Computes and writes all of them.
pub fn run(args: &Args, cases: &[Case], hands: Option<&Hands>) -> Result<Outcome, Failure> {
    let cases = cases.iter().filter(|own| own.has_pilot == hands.is_some());
    let wanted: Vec<(&Case, [f64; 2])> = cases
        .flat_map(|own| args.at.iter().map(move |at| (own, *at)))
        .collect();
    let mut computed = Vec::new();
    for (case, at) in &wanted {
        let Delay::Everywhere(delay) = case.delay else {
            let message =
                "on which side of the knee a point of --at is, is not known without a map";
            return Err(Failure::new(message).hint("give one time, such as --delay 0.5"));
        };
        let landings = cases::landings(args, case, hands)?;
        let [speed, height] = *at;
        let found = landings.manoeuvre(height, speed, delay);
        let found = found.ok_or_else(|| missing(&landings, *at))?;
        if !found.landing.s.is_finite() {
            let message = format!(
                "{speed} m/s at {height} m: no start of the optimiser converged, so that nothing is known of this point"
            );
            return Err(Failure::new(message).hint("take a lower point, or more --intervals: the program suits descents of a minute or less").ran());
        }
        computed.push((delay, found));
    }
    folder::create_new(&args.output, args.force)?;
    let mut all = Vec::new();
    for (k, ((case, at), (delay, manoeuvre))) in wanted.iter().zip(computed).enumerate() {
        let folder = match wanted.len() {
            1 => args.output.clone(),
            _ => args.output.join(format!("landing-{}", k + 1)),
        };
        let mut own = Flown {
            case,
            at: *at,
            delay,
            manoeuvre,
            gains: hands.map(|own| own.pilot.axes.each_ref().map(|axis| axis.gain)),
            replayed: Replayed {
                s: f64::NAN,
                algorithm: Algorithm::Strong,
                step: f64::NAN,
                stop: f64::NAN,
            },
        };
        std::fs::create_dir_all(&folder).map_err(|error| {
            Failure::new(format!(
                "cannot create the folder {}: {error}",
                folder.display()
            ))
        })?;
        own.write(args, &folder)?;
        all.push((own, folder));
    }
    let json: Vec<Value> = all.iter().map(|(own, _)| own.to_json()).collect();
    terminal::print(&match args.json {
        true => format!("{:#}\n", json!({ "landings": json })),
        false => all
            .iter()
            .map(|(own, folder)| own.to_text(folder))
            .collect(),
    })?;
    Ok(Outcome::Done)
}

/// Why there is no landing from a point: speed and height.
fn missing(landings: &Landings, [speed, height]: [f64; 2]) -> Failure {
    let point = format!("{speed} m/s at {height} m");
    let [low, high, _] = landings.settings().cz;
    let words = match landings.helicopter().trim(height, speed) {
        Some(_) if landings.trim(height, speed).is_some() => {
            format!("{point}: the equations cannot be integrated over the delay")
        }
        Some(trim) => format!(
            "{point}: level flight needs a thrust of C_T/sigma {} and a tilt of {} deg, which are not within {low} to {high} and the --tilt",
            significant(trim.cz, 3),
            significant(trim.alpha.to_degrees(), 3),
        ),
        None => format!(
            "{point}: there is no level flight to begin from: the rotor cannot carry the helicopter"
        ),
    };
    Failure::new(words).hint("look at mass, density and power of the helicopter")
}

/// A number, if there is one.
fn shown(value: f64) -> String {
    if value.is_finite() {
        significant(value, 4)
    } else {
        "none".to_owned()
    }
}

impl Flown<'_> {
    fn class(&self) -> &'static str {
        self.manoeuvre.landing.class().as_str()
    }

    /// Writes flight, models, system file, replay, figure and page.
    fn write(&mut self, args: &Args, folder: &Path) -> Result<(), Failure> {
        overwrite::save(&folder.join("flight.csv"), self.table().to_csv())?;
        overwrite::save(&folder.join("commands.csv"), self.commands().to_csv())?;
        self.export(folder)?;
        let description = self.wired();
        overwrite::save(&folder.join("system.toml"), &description)?;
        self.replayed = self.repeated(args, &folder.join("system.toml"))?;
        overwrite::save(
            &folder.join("landing.json"),
            format!("{:#}\n", self.to_json()),
        )?;
        let figure = self.figure();
        let svg = crate::report::svg::to_svg(&figure, WIDTH);
        if let Ok(png) = crate::report::png::to_png(&svg, DOTS) {
            overwrite::save(&folder.join("landing.png"), png)?;
        }
        overwrite::save(&folder.join("landing.svg"), svg)?;
        overwrite::save(&folder.join("landing.html"), self.html(&figure))
    }

    /// The flight as a table.
    fn table(&self) -> Series {
        let own = &self.manoeuvre;
        let column = |name: String, unit: &str, values: &[f64]| Column {
            name,
            unit: unit.to_owned(),
            values: values.to_vec(),
        };
        let states = own
            .states
            .iter()
            .map(|(name, unit, values)| column(format!("helicopter.{name}"), unit, values));
        let mut columns: Vec<Column> = states.collect();
        let names = [("cz", "1"), ("alpha", "rad")];
        for ((name, unit), values) in names.iter().zip(&own.rotor) {
            columns.push(column(format!("helicopter.{name}"), unit, values));
        }
        if own.pilot.is_some() {
            columns.extend(self.commands().columns);
        }
        Series {
            time: own.time.clone(),
            columns,
            ..Series::default()
        }
    }

    /// The commands as a table that feeds the pilot, or without one the helicopter.
    fn commands(&self) -> Series {
        let own = &self.manoeuvre;
        let has_pilot = own.pilot.is_some();
        let column = |(name, values): (&str, &Vec<f64>)| Column {
            name: match has_pilot {
                true => format!("pilot.{name}_command"),
                false => format!("helicopter.{name}"),
            },
            unit: String::new(),
            values: values.clone(),
        };
        Series {
            time: own.time.clone(),
            columns: ["cz", "alpha"]
                .into_iter()
                .zip(&own.commands)
                .map(column)
                .collect(),
            ..Series::default()
        }
    }

    fn export(&self, folder: &Path) -> Result<(), Failure> {
        let one = |text: &str, name: &str| -> Result<(), Failure> {
            let model = TextModel::parse(text, &format!("{name}.toml"))?;
            let provenance =
                Provenance::model_file(&format!("{name}.toml"), &model.compiled().file.source);
            Ok(Export::text(&model, &provenance).write(&folder.join(format!("{name}.fmu")))?)
        };
        one(&self.manoeuvre.helicopter, "helicopter")?;
        self.manoeuvre
            .pilot
            .as_ref()
            .map_or(Ok(()), |text| one(text, "pilot"))
    }

    /// The system file of the replay.
    fn wired(&self) -> String {
        let mut text = String::from("[system.commands]\ntable = \"commands.csv\"\n");
        if self.manoeuvre.pilot.is_some() {
            text += "[system.pilot]\nmodel = \"pilot.fmu\"\n";
        }
        text += "[system.helicopter]\nmodel = \"helicopter.fmu\"\n";
        if self.manoeuvre.pilot.is_some() {
            text += "[connect]\n\"pilot.cz\" = \"helicopter.cz\"\n\"pilot.alpha\" = \"helicopter.alpha\"\n";
        }
        text
    }

    fn end(&self) -> f64 {
        *self.manoeuvre.time.last().unwrap_or(&0.0)
    }

    /// The co-simulation of the FMUs, by the first coupling that comes to the ground.
    fn repeated(&self, args: &Args, file: &Path) -> Result<Replayed, Failure> {
        let mut found = self.replayed;
        for (algorithm, longest) in COUPLINGS {
            // The delay, after which commands may jump, is a number of steps.
            let step = match self.delay > 0.0 {
                true => self.delay / (self.delay / longest).ceil(),
                false => longest,
            };
            let stop = step * (self.end() / step).ceil();
            found = Replayed {
                s: f64::NAN,
                algorithm,
                step,
                stop,
            };
            if stop <= 0.0 {
                break;
            }
            let built = system::open(SystemDescription::read(file)?)?;
            let mut recorder = SeriesRecorder::default();
            let clock = Clock::new(0.0, stop, step)?;
            let run = cosim::run(built.system, &clock, None, algorithm, &mut recorder)?;
            if matches!(run.ending, Ending::Completed) {
                found.s = self.landed(args, &recorder.series, step);
                break;
            }
        }
        Ok(found)
    }

    /// S of the rows at touch-down.
    fn landed(&self, args: &Args, series: &Series, step: f64) -> f64 {
        let at_end = |name: &str| {
            let values = &series.column(&format!("helicopter.{name}"))?.values;
            let place = (self.end() / step).min((values.len() - 1) as f64);
            let k = (place as usize).min(values.len() - 2);
            Some(values[k] + (place - k as f64) * (values[k + 1] - values[k]))
        };
        let speeds = at_end("u").zip(at_end("w"));
        speeds.map_or(f64::NAN, |(u, w)| cases::settings(args).touched(u, w))
    }

    fn figure(&self) -> Figure {
        let own = &self.manoeuvre;
        let state = |name: &str| {
            own.states
                .iter()
                .find(|state| state.0 == name)
                .map(|state| &state.2[..])
        };
        let mut panels = Vec::new();
        let mut panel = |label: &str, lines: &[(&str, &str, Option<&[f64]>)]| {
            let series = lines.iter().filter_map(|(name, colour, values)| {
                Some(Line::line(name, *colour, &own.time, (*values)?))
            });
            panels.push(Panel::over_time(label, 140.0, series.collect()));
        };
        panel("height [m]", &[("", "line-1", state("h"))]);
        panel(
            "speed [m/s]",
            &[
                ("forwards", "line-1", state("u")),
                ("downwards", "line-4", state("w")),
            ],
        );
        panel("rotor speed [rad/s]", &[("", "line-1", state("omega"))]);
        for (k, label) in ["thrust C_T/sigma [1]", "tilt [rad]"]
            .into_iter()
            .enumerate()
        {
            let command = own.pilot.is_some().then_some(&own.commands[k][..]);
            panel(
                label,
                &[
                    ("command", "line-4", command),
                    ("rotor", "line-1", Some(&own.rotor[k])),
                ],
            );
        }
        Figure {
            name: "landing".into(),
            title: "Landing".into(),
            caption: format!(
                "Power fails at 0 s, {} m above the ground at {} m/s; the controls stay for {} s.",
                self.at[1], self.at[0], self.delay
            ),
            panels,
        }
    }

    fn html(&self, figure: &Figure) -> String {
        let landing = &self.manoeuvre.landing;
        let facts = [
            ("S", shown(landing.s)),
            ("S, integrated again", shown(landing.replayed)),
            ("S of the FMUs", shown(self.replayed.s)),
            ("time to the ground [s]", shown(self.end())),
        ];
        let mut words = vec![
            "S is the larger of sink rate and speed at touch-down over what is permitted. A point is unsafe only if several starts \
             of the optimiser agree."
                .to_owned(),
            "The flight is optimal control's: of a pilot who knows everything and makes no error. It is no flight limitation."
                .to_owned(),
        ];
        words.extend(self.gains.map(super::page::pilot_words));
        plain_page(&PlainPage {
            title: &format!(
                "Landing from {} m/s at {} m, {}",
                self.at[0], self.at[1], self.case.name
            ),
            verdict: (
                &format!("The point is {}.", self.class()),
                self.class() != "unknown",
            ),
            facts: &facts,
            figures: std::slice::from_ref(figure),
            tables: Vec::new(),
            words: ("What this is", &words),
            made: &made(),
        })
    }

    fn to_json(&self) -> Value {
        let finite = |value: f64| value.is_finite().then_some(value);
        let landing = &self.manoeuvre.landing;
        json!({
            "case": self.case.name,
            "speed": self.at[0],
            "height": self.at[1],
            "delay": self.delay,
            "set": super::page::pairs(&self.case.set),
            "class": self.class(),
            "s": finite(landing.s),
            "replayed": finite(landing.replayed),
            "co_simulated": finite(self.replayed.s),
            "duration": self.end(),
        })
    }

    fn to_text(&self, folder: &Path) -> String {
        let landing = &self.manoeuvre.landing;
        let Replayed {
            algorithm,
            step,
            stop,
            ..
        } = self.replayed;
        let file = folder.join("system.toml");
        let mut text = format!(
            "{} m/s at {} m, {}: {}, S = {} ({} integrated again, {} by the FMUs), {} s to the ground\n",
            self.at[0],
            self.at[1],
            self.case.name,
            self.class(),
            significant(landing.s, 4),
            significant(landing.replayed, 4),
            shown(self.replayed.s),
            significant(self.end(), 3),
        );
        text += &format!(
            "wrote {}: flight.csv, landing.html, landing.svg, and the FMUs\n",
            terminal::shown(folder)
        );
        let far = (self.replayed.s - landing.replayed).abs();
        if far > AGREEMENT {
            text += &format!(
                "note: the FMUs land with another S: a flight of {} s without feedback multiplies what communication steps of {step} s are off\n",
                significant(self.end(), 3)
            );
        }
        text += &format!(
            "next: {} cosim {} --algorithm {algorithm} --step {step} --stop-time {stop} -o result.csv\n",
            program(),
            quoted(&file.to_string_lossy())
        );
        text
    }
}
